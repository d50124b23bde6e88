"""PRUNE: vectors that serve no belief which an optimal policy may reach, and points that were replaced.

Source: Kurniawati, Hsu and Lee, RSS 2008, section III-D (pruning, delta-dominance).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from lcorpp.planning.sarsop.numpy_kernels.backup import GAIN
from lcorpp.planning.sarsop.numpy_kernels.node import Node
from lcorpp.planning.sarsop.numpy_kernels.refresh import witness
from lcorpp.values import Array

if TYPE_CHECKING:
    from lcorpp.planning.sarsop.numpy_kernels.tree import Tree

LOOKED = 2000
"""Beliefs that are looked at for vectors that are nearly the best; all are looked at for the best."""

FEW = 100
"""So many vectors more are never too many."""


def prune(tree: Tree, roots: Sequence[int], delta: float, cap: float, growth: float) -> None:
    """Keep the vectors that are best, or nearly, at a belief that matters.

    Args:
        roots: nodes from which the others are reached.
        delta: radius in the space of beliefs, see `_prune_set`.
        cap: at most this many times the vectors that are best somewhere are kept.
        growth: a set is looked at when it has grown by this factor, and a few, since the last time.
    """
    tree.sawtooth.compact()
    grown = [g for g, held in enumerate(tree.sets) if held.count > growth * tree.kept[g] + FEW]
    if not grown:
        return
    at: dict[int, list[Node]] = {}
    for number in reachable(tree, roots):
        node = tree.nodes[number]
        at.setdefault(node.belief.group, []).append(node)
    for g in grown:
        if g in at:
            _prune_set(tree, g, at[g], delta, cap)
        tree.kept[g] = tree.sets[g].count
    tree.origins_of.collect(tree.sets)


def reachable(tree: Tree, roots: Sequence[int]) -> list[int]:
    """The nodes that the roots reach by actions that may still be optimal.

    An action whose upper bound is below another's lower bound at the same belief is never taken again.
    """
    found = list(dict.fromkeys(roots))
    met = set(found)
    for number in found:  # which grows while it is read
        node = tree.nodes[number]
        low = node.lower.max()
        for action, branch in sorted(node.branches.items()):
            if node.upper[action] >= low:
                new = [link for link in branch.link.tolist() if link >= 0 and link not in met]
                found.extend(dict.fromkeys(new))
                met.update(new)
    return found


def _prune_set(tree: Tree, group: int, at: list[Node], delta: float, cap: float) -> None:
    """A vector survives at b when the best one there does not beat it all around, as far as delta.

    That is when (best - vector).b < delta |best - vector|. Too tight a rule freezes the search, for vectors
    that would be best between the beliefs are lost; too loose a one slows it.
    """
    vectors = tree.sets[group]
    for node in at:
        witness(tree, node)
    winners = {vectors.find(node.witness) for node in at}
    radius = np.full(vectors.count, np.inf)  # the least delta with which a vector survives
    distances: dict[int, Array] = {}
    for node in at[:: max(1, len(at) // LOOKED)]:
        champion = vectors.find(node.witness)
        if champion not in distances:
            distances[champion] = vectors.distances(champion)
        values = vectors.values(node.belief)[0]
        # The same vector twice has distance 0: the copy goes unless it is itself a winner.
        away = distances[champion]
        ratio = np.divide(values[champion] - values, away, out=np.full(vectors.count, np.inf), where=away > 0)
        np.minimum(radius, ratio, out=radius)
    best = np.array(sorted(winners))
    radius[best] = -1.0
    # They go on with themselves.
    blind = vectors.stamps < tree.model.actions
    radius[blind] = -1.0
    allowed = int(min(cap * len(best), vectors.count))
    if allowed < vectors.count:
        delta = min(delta, float(np.partition(radius, allowed)[allowed]))
    kept = radius < delta
    kept[best] = True
    kept[blind] = True
    tree.origins_of.retire(vectors, group, kept, GAIN * tree.scale)
    vectors.keep(kept)
