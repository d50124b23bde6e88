"""BACKUP: both bounds are improved at one belief by one step of looking ahead.

Source: Kurniawati, Hsu and Lee, RSS 2008, Algorithm 3 (BACKUP).
"""

from __future__ import annotations

import numpy as np

from lcorpp.planning.sarsop.tree import Node, Tree
from lcorpp.values import Array

_GAIN = 1e-11
"""Share of the largest value a new bound must gain; less is rounding."""


def backup(tree: Tree, node: Node, scale: float) -> None:
    """Add the alpha vector that is best at the node, and lower the upper bound there.

    Args:
        scale: largest value in the model, what rounding is measured by.
    """
    tree.refresh(node)
    action = int(node.q_lower.argmax())
    if (tree.alphas.rows(node.best[node.children(action)]) < 0).any():
        tree.forget_best(node)
        tree.refresh(node)
        action = int(node.q_lower.argmax())
    _raise_lower(tree, node, action, scale)
    _lower_upper(tree, node, scale)


def _raise_lower(tree: Tree, node: Node, action: int, scale: float) -> None:
    alphas = tree.alphas
    held = alphas.value(node.belief)
    if node.q_lower[action] > held + _GAIN * scale:
        vector = _alpha(tree, node, action)
        # what the vector is worth at b, not what the look-ahead estimated: their rounding differs
        value = float(vector @ node.belief)
        if value > held:
            alphas.add(vector, action)
            held = value
    node.low = held


def _alpha(tree: Tree, node: Node, action: int) -> Array:
    """(S,) R(a) + gamma sum over o of T Z (best vector at the child of a and o).

    Where an observation is impossible from this belief, the vector that is best after the action alone is
    taken: any vector is right there, this one serves the neighbouring beliefs.
    """
    dynamics, alphas = tree.dynamics, tree.alphas
    spread = dynamics.spread(node.belief)[action]
    rows = np.full(dynamics.observations, int((alphas.vectors @ spread).argmax()))
    part = node.children(action)
    rows[node.observation[part]] = alphas.rows(node.best[part])
    following = np.einsum("os,os->s", dynamics.observing[action], alphas.vectors[rows])
    return np.asarray(dynamics.reward[action] + dynamics.discount * dynamics.back(action, following))


def _lower_upper(tree: Tree, node: Node, scale: float) -> None:
    sawtooth = tree.sawtooth
    newer = sawtooth.bound(node.belief[None, :], node.seen_surface)
    node.surface, node.seen_surface = min(node.surface, float(newer[0])), sawtooth.next_stamp
    if node.high < node.surface - _GAIN * scale:
        old = node.point
        node.point = sawtooth.add(node.belief, node.high)
        if old >= 0:
            tree.outdated.add(old)
