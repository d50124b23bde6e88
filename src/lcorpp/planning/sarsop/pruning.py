"""PRUNE: beliefs that no optimal policy reaches, vectors that serve no other belief, points outdone.

Source: Kurniawati, Hsu and Lee, RSS 2008, section III-D (pruning, delta-dominance).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lcorpp.planning.sarsop.tree import Node, Tree
from lcorpp.values import Array

_BLOCK = 512
"""Beliefs compared at once; keeps the table of vectors by beliefs small."""


def reachable(roots: Sequence[Node]) -> list[Node]:
    """The nodes reached from the roots by actions that may still be optimal.

    An action whose upper bound is below another's lower bound at the same belief is never taken again.
    """
    found = {id(root): root for root in roots}
    waiting = list(roots)
    while waiting:
        node = waiting.pop()
        open_ = node.q_upper >= node.q_lower.max()
        for k, child in node.links.items():
            if open_[node.action[k]] and id(child) not in found:
                found[id(child)] = child
                waiting.append(child)
    return list(found.values())


def prune_vectors(tree: Tree, roots: Sequence[Node], delta: float, cap: float) -> None:
    """Keep the vectors that are best at a reachable belief, or nearly.

    A vector survives at belief b when the best vector there does not beat it in all of b's neighbourhood of
    radius delta, that is when (best - vector).b < delta |best - vector|. Too tight a rule freezes the search,
    for vectors that would be best between the beliefs are lost; too loose a one slows it.

    Args:
        delta: radius in the space of beliefs.
        cap: at most this many times the vectors that are best somewhere are kept, the nearest ones.
    """
    alphas = tree.alphas
    beliefs = np.array([node.belief for node in reachable(roots)])
    vectors = alphas.vectors
    best = np.concatenate([(block @ vectors.T).argmax(axis=1) for block in _blocks(beliefs)])
    winners = np.unique(best)
    distances = _distances(vectors, vectors[winners])
    radius = np.full(len(vectors), np.inf)  # the least delta with which a vector survives
    for block, champions in zip(_blocks(beliefs), _blocks(best), strict=True):
        values = vectors @ block.T
        loss = values[champions, np.arange(len(champions))] - values
        distance = distances[:, np.searchsorted(winners, champions)]
        # the same vector twice has distance 0 and loss 0: the copy goes unless it is itself a winner
        ratio = np.divide(loss, distance, out=np.full_like(loss, np.inf), where=distance > 0)
        np.minimum(radius, ratio.min(axis=1), out=radius)
    radius[winners] = -1.0
    allowed = int(cap * len(winners))
    if np.count_nonzero(radius < delta) > allowed:
        delta = float(np.partition(radius, allowed)[allowed])
    alphas.keep((radius < delta) | (radius == -1.0))


def prune_points(tree: Tree) -> None:
    """Drop the points whose belief has a lower one by now."""
    tree.sawtooth.drop(tree.outdated)
    tree.outdated = set()


def _blocks(rows: Array) -> list[Array]:
    return [rows[i : i + _BLOCK] for i in range(0, len(rows), _BLOCK)]


def _distances(left: Array, right: Array) -> Array:
    """(K, W) Euclidean distances between rows."""
    squares = (left**2).sum(axis=1)[:, None] + (right**2).sum(axis=1) - 2 * left @ right.T
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))
