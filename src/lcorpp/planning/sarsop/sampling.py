"""SAMPLE: one path of beliefs from a root, towards where the bounds matter most for the root.

This is the search itself, on the methods of a tree. Write another one and hand it to `solve`: it runs on the
compiled kernels as it does on numpy's. Without one, both kinds of kernels run what is below, the compiled
ones a copy of it in C++.

Source: Kurniawati, Hsu and Lee, RSS 2008, Algorithm 2 (SAMPLE, SAMPLEPOINTS).
"""

from __future__ import annotations

from time import monotonic
from typing import TYPE_CHECKING

import numpy as np

from lcorpp.values import Array

if TYPE_CHECKING:
    from lcorpp.planning.sarsop.kernels import Prediction, Tree

NEGLIGIBLE = 0.1
"""Share of the allowed gap below which even selective deep sampling has nothing left to find."""

ABOVE = 1e-6
"""Share of the allowed gap by which a value must be above a level to count as above it. Often a belief is
worth the very level it is held against, and rounding must not decide then."""


def trial(
    tree: Tree,
    prediction: Prediction,
    root: int,
    target: float,
    depth: int,
    seconds: float,
    greedy_below: bool,
) -> int:
    """Sample a path and back up along it, the last belief first.

    The path goes on while a node's gap may still matter at the root (gap termination with the level U), or
    while the predicted value says that the lower bound may still rise there (selective deep sampling, level
    L). Beliefs already on the path are passed over while another child has a gap that matters: under a slow
    discount a trial would circle in one belief to its end.

    Args:
        prediction: a guess at the value of a node, learnt on the way.
        root: the node to begin at.
        target: the gap wanted there, in reward units; a node t steps down may keep target / gamma^t.
        depth: the most nodes on the path.
        seconds: of wall-clock time; at the end it stops wherever it is.
        greedy_below: follow the action that is best in the lower bound instead of the upper.

    Returns:
        The number of nodes on the path.
    """
    deadline, gamma = monotonic() + seconds, tree.discount
    node, path = root, [root]
    action = tree.look(root, greedy_below)
    allowed = target
    L, U = tree.low(root), tree.low(root) + allowed
    while len(path) < depth and monotonic() < deadline:
        low, high = tree.low(node), tree.high(node)
        if high - low <= NEGLIGIBLE * allowed:
            break
        slack = ABOVE * allowed
        if prediction.value(tree, node) <= L + slack and high <= max(U, low + allowed) + slack:
            break
        immediate = float(tree.immediate(node)[action])
        _, probability, lower, upper, link = tree.children(node, action)
        L, U = max(L, low), max(U, low + allowed)
        allowed /= gamma
        excess = upper - lower - probability * allowed
        fresh = ~np.isin(link, path)
        if (excess[fresh] > 0).any():
            excess = np.where(fresh, excess, -np.inf)
        k = int(excess.argmax())
        L = _level(L, immediate, gamma, lower, k) / float(probability[k])
        U = _level(U, immediate, gamma, upper, k) / float(probability[k])
        node = tree.child(node, action, k)
        action = tree.look(node, greedy_below)
        prediction.learn(tree, node)
        path.append(node)
    for number in reversed(path):
        tree.backup(number)
        if monotonic() >= deadline:
            break
    return len(path)


def _level(level: float, immediate: float, gamma: float, bound: Array, k: int) -> float:
    """What child k must be worth, times its probability, for its parent to reach `level`.

    bound: (n,) bounds of all children times their probability; the others stay as they are.
    """
    return (level - immediate) / gamma - float(bound.sum() - bound[k])
