"""SAMPLE: sample a path of beliefs from a root, towards the beliefs whose bounds matter most, and back it up.

The compiled kernels run native/sarsop/path_sampling.cpp, a copy of this function in C++; the numpy kernels
run this function. To change the search strategy, pass another function to `solve`: it uses only methods of a
tree, so it runs with both kernels.

Source: Kurniawati, Hsu and Lee, RSS 2008, Algorithm 2 (SAMPLE, SAMPLEPOINTS).
"""

from __future__ import annotations

from time import monotonic

import numpy as np

from lcorpp.planning.sarsop.kernel_protocols import Tree, ValuePredictor
from lcorpp.values import Array

NEGLIGIBLE_SHARE = 0.1
"""Share of the allowed gap below which selective deep sampling has nothing left to find."""

LEVEL_MARGIN = 1e-6
"""A value counts as above a level only if it exceeds the level by this share of the allowed gap: a value
often equals its level exactly, and this margin keeps rounding from deciding."""


def sample(
    tree: Tree,
    predictor: ValuePredictor,
    root: int,
    target: float,
    max_depth: int,
    seconds: float,
    use_lower_bound: bool,
) -> int:
    """Sample a path (a trial of SARSOP) and back up its nodes, from the last to the first.

    The path continues while a node's gap may matter at the root (gap termination with level U), or while the
    predicted value shows that the lower bound may still rise there (selective deep sampling with level L).
    Beliefs already on the path are skipped while another child has a gap that matters: under a slow discount
    a path would otherwise stay at one belief to its end.

    With discount 0 the root is the whole path.

    Args:
        predictor: predicts the value of a node; it learns from the path.
        root: the first node.
        target: gap wanted at the root, in reward units; a node t steps down may keep target / gamma^t.
        max_depth: largest number of nodes on the path.
        seconds: of wall-clock time, after which the function stops early.
        use_lower_bound: follow the best action of the lower bound instead of the upper bound.

    Returns:
        The number of nodes on the path.
    """
    deadline, gamma = monotonic() + seconds, tree.discount
    node, path = root, [root]
    action = tree.select_action(root, use_lower_bound)
    allowed = target
    L, U = tree.cached_lower(root), tree.cached_lower(root) + allowed
    while gamma > 0 and len(path) < max_depth and monotonic() < deadline:
        low, high = tree.cached_lower(node), tree.cached_upper(node)
        if high - low <= NEGLIGIBLE_SHARE * allowed:
            break
        margin = LEVEL_MARGIN * allowed
        if predictor.predict(tree, node) <= L + margin and high <= max(U, low + allowed) + margin:
            break
        reward = float(tree.expected_rewards(node)[action])
        _, probability, lower, upper, child_nodes = tree.children(node, action)
        L, U = max(L, low), max(U, low + allowed)
        allowed /= gamma
        excess = upper - lower - probability * allowed
        fresh = ~np.isin(child_nodes, path)
        if (excess[fresh] > 0).any():
            excess = np.where(fresh, excess, -np.inf)
        k = int(excess.argmax())
        L = _compute_child_level(L, reward, gamma, lower, k) / float(probability[k])
        U = _compute_child_level(U, reward, gamma, upper, k) / float(probability[k])
        node = tree.find_or_add_child(node, action, k)
        action = tree.select_action(node, use_lower_bound)
        predictor.learn(tree, node)
        path.append(node)
    for number in reversed(path):
        tree.backup(number)
        if monotonic() >= deadline:
            break
    return len(path)


def _compute_child_level(level: float, reward: float, gamma: float, bounds: Array, k: int) -> float:
    """Return the value that child k needs, times its probability, for its parent to reach `level`.

    Args:
        bounds: (n,) bounds of all children times their probability; the others stay unchanged.
    """
    return (level - reward) / gamma - float(bounds.sum() - bounds[k])
