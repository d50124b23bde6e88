"""PRUNE: drop alpha vectors that are useless at all beliefs that an optimal policy may reach.

Source: Kurniawati, Hsu and Lee, RSS 2008, section III-D (pruning, delta-dominance).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lcorpp.planning.sarsop.numpy_kernels.node import BeliefNode
from lcorpp.planning.sarsop.numpy_kernels.refresh import update_best_vector
from lcorpp.planning.sarsop.numpy_kernels.search_state import MIN_GAIN, SearchState

MAX_SAMPLED_BELIEFS = 2000
"""Largest number of beliefs at which nearly best vectors are searched; best vectors are searched at all."""

MIN_GROWTH = 100
"""A set is never pruned before it has this many vectors more than after its last pruning."""


def prune(state: SearchState, roots: Sequence[int], radius: float, max_ratio: float, growth: float) -> None:
    """Keep the vectors that are best, or nearly best, at a belief that an optimal policy may reach.

    Args:
        radius: in the space of beliefs, see `_prune_set`.
        max_ratio: at most this many times the vectors that are best at a belief are kept.
        growth: a set is pruned if it has this many times the vectors of its last pruning, plus MIN_GROWTH.
    """
    state.sawtooth.compact()
    grown = [
        g
        for g, vectors in enumerate(state.sets)
        if vectors.count > growth * state.sizes_after_pruning[g] + MIN_GROWTH
    ]
    if not grown:
        return
    by_group: dict[int, list[BeliefNode]] = {}
    for number in find_reachable(state, roots):
        node = state.nodes[number]
        by_group.setdefault(node.belief.group, []).append(node)
    for g in grown:
        if g in by_group:
            _prune_set(state, g, by_group[g], radius, max_ratio)
        state.sizes_after_pruning[g] = state.sets[g].count
    state.dependencies.remove_unneeded(state.sets)


def find_reachable(state: SearchState, roots: Sequence[int]) -> list[int]:
    """Return the nodes that the roots reach by actions that may be optimal.

    An action whose upper bound is below another's lower bound at the same belief is never taken again.
    """
    queue = list(dict.fromkeys(roots))
    visited = set(queue)
    for number in queue:  # the loop body appends to the queue
        node = state.nodes[number]
        lower = node.q_lower.max()
        for action, branch in sorted(node.branches.items()):
            if node.q_upper[action] >= lower:
                new = [child for child in branch.child_nodes.tolist() if child >= 0 and child not in visited]
                queue.extend(dict.fromkeys(new))
                visited.update(new)
    return queue


def _prune_set(
    state: SearchState, group: int, nodes: list[BeliefNode], radius: float, max_ratio: float
) -> None:
    """Keep a vector if the best vector at a belief b does not dominate it within a radius around b.

    That is, if (best - vector).b < radius |best - vector| for the belief b of a node. Too small a radius
    loses vectors that are best between the beliefs and stops the search; too large a radius slows it down.
    """
    vectors = state.sets[group]
    for node in nodes:
        update_best_vector(state, node)
    winner_of = [vectors.find(node.best_vector) for node in nodes]
    min_radius = np.full(vectors.count, np.inf)  # the smallest radius with which a vector survives
    step, measured = max(1, len(nodes) // MAX_SAMPLED_BELIEFS), -1
    sampled = zip(winner_of[::step], nodes[::step], strict=True)
    # by the best vector, so that the distances from each are computed once
    for winner, node in sorted(sampled, key=lambda pair: pair[0]):
        if winner != measured:
            measured, distance = winner, vectors.distances(winner)
        values = vectors.values(node.belief)[0]
        # a duplicate has distance 0: it is dropped unless it is itself a winner
        ratio = np.divide(
            values[winner] - values, distance, out=np.full(vectors.count, np.inf), where=distance > 0
        )
        np.minimum(min_radius, ratio, out=min_radius)
    best = np.unique(winner_of)
    min_radius[best] = -1.0
    blind = vectors.stamps < state.model.actions  # blind policies depend on themselves and always stay
    min_radius[blind] = -1.0
    max_kept = int(min(max_ratio * len(best), vectors.count))
    if max_kept < vectors.count:
        radius = min(radius, float(np.partition(min_radius, max_kept)[max_kept]))
    kept = min_radius < radius
    kept[best] = True
    kept[blind] = True
    state.dependencies.record_pruned_vectors(vectors, group, kept, MIN_GAIN * state.max_abs_value)
    vectors.keep(kept)
