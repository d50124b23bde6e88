"""BACKUP: both bounds are improved at one belief by one step of looking ahead.

Source: Kurniawati, Hsu and Lee, RSS 2008, Algorithm 3 (BACKUP).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lcorpp.planning.sarsop.numpy_kernels.model import Beliefs, Indices, entries
from lcorpp.planning.sarsop.numpy_kernels.node import Node
from lcorpp.planning.sarsop.numpy_kernels.outcomes import spread
from lcorpp.planning.sarsop.numpy_kernels.refresh import forget_lower, refresh, witness
from lcorpp.values import Array

if TYPE_CHECKING:
    from lcorpp.planning.sarsop.numpy_kernels.tree import Tree

GAIN = 1e-11
"""Share of the largest value that a new bound must gain; less is rounding."""


def backup(tree: Tree, number: int) -> None:
    """Add the alpha vector that is best at a node, and lower the upper bound there."""
    node = tree.nodes[number]
    refresh(tree, node)
    action = int(node.lower.argmax())
    branch = node.branches[action]
    if any(tree.sets[g].find(stamp) < 0 for g, stamp in zip(branch.group, branch.best, strict=True)):
        forget_lower(node)
        refresh(tree, node)
        action = int(node.lower.argmax())
    _raise_lower(tree, node, action)
    _lower_upper(tree, number)


def _raise_lower(tree: Tree, node: Node, action: int) -> None:
    witness(tree, node)
    if node.lower[action] > node.held + GAIN * tree.scale:
        vector, origins = _alpha(tree, node, action)
        # what the vector is worth here, not what looking ahead said: their rounding differs
        value = float(node.belief.weights[0] @ vector[node.belief.places])
        if value > node.held:
            tree.origins_of.note(tree.next_vector, origins)
            tree.sets[node.belief.group].add(vector, action, tree.next_vector)
            node.held, node.witness = value, tree.next_vector
            tree.next_vector += 1
    node.low = node.held


def _lower_upper(tree: Tree, number: int) -> None:
    node = tree.nodes[number]
    tree.upper_at(number)
    if node.high < node.surface - GAIN * tree.scale:
        old = node.point
        node.point = tree.sawtooth.add(node.belief, node.high)
        if old >= 0:
            tree.sawtooth.retire(node.belief.group, old)


def _alpha(tree: Tree, node: Node, action: int) -> tuple[Array, list[int]]:
    """(n,) R(a) + gamma sum over o of T Z (the best vector at the child of a and o), by state of the group.

    Where an observation is impossible from this belief, the vector that is best after the action alone is
    taken: any vector is right there, this one serves the neighbouring beliefs. Beside it, the stamps of the
    vectors it goes on with.
    """
    model, branch = tree.model, node.branches[action]
    chosen = np.full(model.observations, -1, dtype=np.intp)
    chosen[branch.observation] = [
        tree.sets[g].find(stamp) for g, stamp in zip(branch.group, branch.best, strict=True)
    ]
    states = model.states_of(node.belief.group)
    index, owner = entries(model.transition, action * model.states + states)
    reached, which = np.unique(model.transition.columns[index].astype(np.intp), return_inverse=True)
    following, usual = _following(tree, node, action, chosen, reached)
    sums = np.bincount(owner, model.transition.values[index] * following[which], minlength=len(states))
    made = np.asarray(model.reward[action, states] + model.discount * sums)
    return made, [*branch.best.tolist(), *usual]


def _following(
    tree: Tree, node: Node, action: int, chosen: Indices, reached: Indices
) -> tuple[Array, list[int]]:
    """(n,) what is to be expected after an action that ended in the states reached (n,).

    chosen: (O,) by observation the vector of the block where it leads, -1 for one that is impossible: there
    one of the stamps beside it is taken.
    """
    model = tree.model
    index, owner = entries(model.observation, action * model.states + reached)
    seen, state = model.observation.columns[index], reached[owner]
    block, worth, taken = model.block[state], np.empty(len(index)), []
    for b in np.unique(block):
        own = np.flatnonzero(block == b)
        vector = chosen[seen[own]]
        if (vector < 0).any():
            usual = _usual(tree, node, action, int(b))
            vector[vector < 0] = usual
            taken.append(int(tree.sets[b].stamps[usual]))
        worth[own] = tree.sets[b].table[model.local[state[own]], vector]
    sums = np.bincount(owner, model.observation.values[index] * worth, minlength=len(reached))
    return np.asarray(sums, dtype=np.float64), taken


def _usual(tree: Tree, node: Node, action: int, block: int) -> int:
    """The vector of a block that is best after an action, before anything is observed."""
    model, vectors = tree.model, tree.sets[block]
    states, mass = spread(model, node.belief, action)
    inside = model.block[states] == block
    if not inside.any():
        return vectors.central()
    held = states[inside]
    return int(vectors.best(Beliefs(block, held, model.local[held], mass[None, inside]))[0][0])
