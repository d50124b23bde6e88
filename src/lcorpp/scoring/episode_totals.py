"""Sums over all further actions of episodes at once, where no new point of decisions is reached.

The points and hidden states are then the states of an absorbing Markov chain; the expected numbers of visits
solve a linear system (Kemeny and Snell, Finite Markov Chains, 1960, theorem 3.2.4).
"""

from __future__ import annotations

import numpy as np

from lcorpp.scoring.decision_graph import DecisionGraph
from lcorpp.scoring.episode_model import EpisodeModel
from lcorpp.values import Array, Indices

MAX_SIZE = 20_000
"""Maximum number of pairs (point, hidden state) of a linear system."""

MAX_LEAK = 1e-11
"""Maximum probability of reaching a point that is not in the system; such branches are pruned."""


MAX_ERROR = 1e-9
"""Maximum error of the probability of all ends: near a singular system, episodes hardly ever end."""


class EpisodeTotals:
    """The linear system of the points of a graph as far as it is known.

    Attributes:
        n_arcs: the number of known arcs, by which a graph that has grown differs.
    """

    def __init__(self, model: EpisodeModel, graph: DecisionGraph) -> None:
        self.n_arcs, self._solver = graph.n_arcs, None
        self._shape = len(graph), len(model.values)
        size = len(graph) * len(model.values)
        if size > MAX_SIZE:
            return
        from scipy.sparse import coo_array, csc_array
        from scipy.sparse.linalg import splu

        actions = graph.find_actions(np.arange(len(graph)))
        self._is_end = ~np.isin(actions, list(model.transition))
        states = np.arange(size)
        rows, columns, weights = [states], [states], [np.ones(size)]  # of 1 - the transposed transitions
        self._leaving = np.zeros(self._shape)  # probability of reaching an unknown node
        self._cost = np.zeros(self._shape)
        for a, transition in model.transition.items():
            here = np.flatnonzero(actions == a)
            self._cost[here] = -model.reward[a]
            observations, probabilities = model.feedback[a]
            children = graph.list_known_children(here, observations)
            moves = coo_array(transition)
            i, j = moves.row, moves.col
            moved = moves.data * probabilities[:, j]  # (k, entries)
            o, entry = np.nonzero(moved)
            i, j, moved = i[entry], j[entry], moved[o, entry]
            after = children[:, o]
            known = after >= 0
            rows.append((after * len(model.values) + j)[known])
            columns.append(np.add.outer(here * len(model.values), i)[known])
            weights.append(np.broadcast_to(-moved, known.shape)[known])
            for e in np.flatnonzero(~known.all(axis=0)).tolist():
                self._leaving[here[~known[:, e]], i[e]] += moved[e]
        entries = np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))
        self._system = csc_array(entries, shape=(size, size))
        try:
            self._solver = splu(self._system)
        except RuntimeError:  # singular: some episodes never end
            return

    def find(self, nodes: Indices, owners: Indices, moments: Array, count: int) -> Array | None:
        """Sum the moments of episodes over the actions from here on.

        Args:
            nodes, owners, moments: (n,), (n,) and (n, 3, J), as in `sum_episodes`. count: K, of strategies.

        Returns:
            (N, K, 3, J) the summed moments at each of the N nodes of the graph; None if the system is too
            large, or episodes leave it or never end.
        """
        if self._solver is None:
            return None
        solver, (n, size) = self._solver, self._shape

        def collect(order: int) -> Array:
            start = np.zeros((n, count, size))
            start[nodes, owners] = moments[:, order]
            return start.swapaxes(1, 2).reshape(n * size, count)

        c = self._cost.reshape(-1, 1)
        visits: Array = solver.solve(collect(0))
        ended = visits.reshape(n, -1)[self._is_end].sum()
        left = float((visits.sum(axis=1) * self._leaving.ravel()).sum())
        if not (left <= MAX_LEAK and abs(ended + left - moments[:, 0].sum()) <= MAX_ERROR):
            return None
        paid = c * visits
        first = solver.solve(collect(1) + paid - self._system @ paid)
        paid = c * (2 * first + paid)
        second = solver.solve(collect(2) + paid - self._system @ paid)
        total = np.stack([visits, first, second]).reshape(3, n, size, count)
        return total.transpose(1, 3, 0, 2)
