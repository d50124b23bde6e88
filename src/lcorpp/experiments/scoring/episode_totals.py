"""Sums over all further actions of episodes at once, where no new point of decisions is reached.

The points and hidden states are then the states of an absorbing Markov chain; the expected numbers of visits
solve a linear system (Kemeny and Snell, Finite Markov Chains, 1960, theorem 3.2.4).
"""

from __future__ import annotations

import numpy as np

from lcorpp.experiments.scoring.decision_graph import DecisionGraph
from lcorpp.experiments.scoring.episode_model import EpisodeModel
from lcorpp.values import Array, Indices

MAX_SIZE = 20_000
"""Maximum number of pairs (point, hidden state) of a linear system."""

MAX_LEAK = 1e-11
"""Maximum probability of reaching a point that is not in the system; such branches are pruned."""


MAX_ERROR = 1e-9
"""Maximum error of the probability of all ends: near a singular system, episodes hardly ever end."""


def find_total_moments(
    model: EpisodeModel, graph: DecisionGraph, nodes: Indices, owners: Indices, moments: Array, count: int
) -> Array | None:
    """Sum the moments of episodes over the actions from here on.

    Args:
        nodes, owners, moments: (n,), (n,) and (n, 3, J), as in `sum_episodes`. count: K, of strategies.

    Returns:
        (N, K, 3, J) the summed moments at each of the N nodes of the graph; None if the system is too large,
        or episodes leave it or never end.
    """
    size = len(model.values)
    if len(graph) * size > MAX_SIZE:
        return None
    from scipy.sparse import coo_array, csc_array
    from scipy.sparse.linalg import splu

    actions = graph.find_actions(np.arange(len(graph)))
    states = np.arange(len(graph) * size)
    rows, columns, weights = [states], [states], [np.ones(len(states))]  # of 1 - the transposed transitions
    leaving = np.zeros((len(graph), size))  # probability of reaching an unknown node
    cost = np.zeros((len(graph), size))
    for a, transition in model.transition.items():
        here = np.flatnonzero(actions == a)
        cost[here] = -model.reward[a]
        observations, probabilities = model.feedback[a]
        children = graph.list_known_children(here, observations)
        moves = coo_array(transition)
        i, j = moves.row, moves.col
        moved = moves.data * probabilities[:, j]  # (k, entries)
        o, entry = np.nonzero(moved)
        i, j, moved = i[entry], j[entry], moved[o, entry]
        after = children[:, o]
        known = after >= 0
        rows.append((after * size + j)[known])
        columns.append(np.add.outer(here * size, i)[known])
        weights.append(np.broadcast_to(-moved, known.shape)[known])
        for e in np.flatnonzero(~known.all(axis=0)).tolist():
            leaving[here[~known[:, e]], i[e]] += moved[e]
    entries = np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))
    system = csc_array(entries, shape=(len(states), len(states)))
    try:
        solver = splu(system)
    except RuntimeError:  # singular: some episodes never end
        return None

    def collect(order: int) -> Array:
        start = np.zeros((len(graph), count, size))
        start[nodes, owners] = moments[:, order]
        return start.swapaxes(1, 2).reshape(leaving.size, count)

    c = cost.reshape(-1, 1)
    visits: Array = solver.solve(collect(0))
    ended = visits.reshape(len(graph), -1)[~np.isin(actions, list(model.transition))].sum()
    left = float((visits.sum(axis=1) * leaving.ravel()).sum())
    if not (left <= MAX_LEAK and abs(ended + left - moments[:, 0].sum()) <= MAX_ERROR):
        return None
    paid = c * visits
    first = solver.solve(collect(1) + paid - system @ paid)
    paid = c * (2 * first + paid)
    second = solver.solve(collect(2) + paid - system @ paid)
    total = np.stack([visits, first, second]).reshape(3, len(graph), size, count)
    return total.transpose(1, 3, 0, 2)
