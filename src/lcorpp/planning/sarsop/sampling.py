"""SAMPLE: one path of beliefs from the root, towards where the bounds matter most for the root.

Source: Kurniawati, Hsu and Lee, RSS 2008, Algorithm 2 (SAMPLE, SAMPLEPOINTS).
"""

from __future__ import annotations

from time import monotonic

import numpy as np

from lcorpp.planning.sarsop.prediction import Prediction
from lcorpp.planning.sarsop.tree import Node, Tree
from lcorpp.values import Array

NEGLIGIBLE = 0.1
"""Share of the allowed gap below which even selective deep sampling has nothing left to find."""


def sample(
    tree: Tree,
    root: Node,
    prediction: Prediction,
    *,
    target: float,
    depth: int,
    deadline: float,
    greedy_below: bool,
) -> list[Node]:
    """The nodes of one trial, the root first.

    The path goes on while a node's gap may still matter at the root (gap termination with the level U), or
    while the predicted value says that the lower bound may still rise there (selective deep sampling, level
    L). Beliefs already on the path are passed over while another child has a gap that matters: under a slow
    discount a trial would circle in one belief to its end.

    Args:
        target: gap wanted at the root; a node t steps down may keep target / gamma^t.
        depth: the most nodes on the path.
        deadline: on the monotonic clock; the path ends there.
        greedy_below: follow the action that is best in the lower bound instead of the upper.
    """
    gamma = tree.dynamics.discount
    node, path = root, [root]
    tree.refresh(root)
    L, U, allowed = root.low, root.low + target, target
    while len(path) < depth and monotonic() < deadline:
        predicted = prediction.value(node)
        if node.high - node.low <= NEGLIGIBLE * allowed:
            break
        if predicted <= L and node.high <= max(U, node.low + allowed):
            break
        action = int((node.q_lower if greedy_below else node.q_upper).argmax())
        part = node.children(action)
        lower, upper, probability = node.lower[part], node.upper[part], node.probability[part]
        allowed /= gamma
        excess = upper - lower - probability * allowed
        fresh = [node.links.get(part.start + i) not in path for i in range(len(excess))]
        if (excess[fresh] > 0).any():
            excess = np.where(fresh, excess, -np.inf)
        k = int(excess.argmax())
        L = max(L, float(node.q_lower.max()))
        U = max(U, float(node.q_lower.max()) + allowed * gamma)
        L = _level(L, node.immediate[action], gamma, lower, k) / probability[k]
        U = _level(U, node.immediate[action], gamma, upper, k) / probability[k]
        node = tree.child(node, part.start + k)
        tree.refresh(node)
        prediction.learn(node)
        path.append(node)
    return path


def _level(level: float, immediate: float, gamma: float, bound: Array, k: int) -> float:
    """What child k must be worth, times its probability, for its parent to reach `level`.

    bound: (n,) bounds of all children times their probability; the others stay as they are.
    """
    return float((level - immediate) / gamma - (bound.sum() - bound[k]))
