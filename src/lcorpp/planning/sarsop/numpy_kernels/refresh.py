"""The bounds of a node are brought up to date with the vectors and points added since the last visit.

An action is worked out when it is looked at first: until then the informed bound stands for its upper bound.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lcorpp.planning.sarsop.numpy_kernels.node import Branch, Node
from lcorpp.planning.sarsop.numpy_kernels.outcomes import Outcomes, outcomes

if TYPE_CHECKING:
    from lcorpp.planning.sarsop.numpy_kernels.tree import Tree


def refresh(tree: Tree, node: Node) -> None:
    """From above the action that is best, from below all that may be best."""
    action, _ = best_above(tree, node)
    low = float(node.lower.max())
    refresh_lower(tree, node, action)
    low = max(low, float(node.lower[action]))
    for a in range(tree.model.actions):
        if a != action and node.upper[a] > low:
            refresh_lower(tree, node, a)
            low = max(low, float(node.lower[a]))
    witness(tree, node)
    node.low = max(node.low, low, node.held)


def look(tree: Tree, node: Node, below: bool) -> int:
    """The action to follow, best in the upper or the lower bound, with both its bounds up to date."""
    action, fresh = best_above(tree, node)
    witness(tree, node)
    if below:
        action = int(node.lower.argmax())
        if node.lower[action] < node.held:
            vectors = tree.sets[node.belief.group]
            action = int(vectors.actions[vectors.find(node.witness)])
        if action not in fresh:
            refresh_upper(tree, node, action)
    refresh_lower(tree, node, action)
    node.low = max(node.low, float(node.lower[action]), node.held)
    return action


def best_above(tree: Tree, node: Node) -> tuple[int, set[int]]:
    """The action that is best in the upper bound, and those that are up to date with the points.

    Only the action that looks best need be: the others' old bounds are bounds still.
    """
    fresh: set[int] = set()
    while (action := int(node.upper.argmax())) not in fresh:
        refresh_upper(tree, node, action)
        fresh.add(action)
    node.high = min(node.high, float(node.upper[action]))
    return action, fresh


def refresh_lower(tree: Tree, node: Node, action: int) -> None:
    """One action's lower bound."""
    branch = node.branches.get(action)
    if branch is not None and branch.seen_vectors == tree.next_vector:
        return
    branch, found = open_branch(tree, node, action)
    for children, beliefs in found.parts:
        vectors = tree.sets[beliefs.group]
        first = vectors.first_since(branch.seen_vectors)
        if first < vectors.count:
            best, value = vectors.best(beliefs, first)
            better = value > branch.lower[children]
            branch.lower[children[better]] = value[better]
            branch.best[children[better]] = vectors.stamps[best[better]]
    node.lower[action] = node.immediate[action] + tree.discount * branch.lower.sum()
    branch.seen_vectors = tree.next_vector


def refresh_upper(tree: Tree, node: Node, action: int) -> None:
    """One action's upper bound."""
    branch = node.branches.get(action)
    if branch is not None and branch.refreshed and branch.seen_points == tree.sawtooth.next_stamp:
        return
    branch, found = open_branch(tree, node, action)
    for children, beliefs in found.parts:
        bound = tree.sawtooth.bound(beliefs, branch.seen_points)
        branch.upper[children] = np.minimum(branch.upper[children], bound)
    for c in np.flatnonzero(branch.link >= 0).tolist():
        above = tree.nodes[branch.link[c]].high + branch.apart[c]
        branch.upper[c] = min(branch.upper[c], branch.probability[c] * above)
    look_ahead = node.immediate[action] + tree.discount * branch.upper.sum()
    node.upper[action] = min(node.upper[action], look_ahead)
    branch.seen_points = tree.sawtooth.next_stamp
    branch.refreshed = True


def witness(tree: Tree, node: Node) -> None:
    """The vector that is best at a node, and its value."""
    vectors = tree.sets[node.belief.group]
    if node.witness >= 0 and vectors.find(node.witness) < 0:  # it was pruned
        node.seen_vectors, node.held = 0, -np.inf
    first = vectors.first_since(node.seen_vectors)
    if first < vectors.count:
        best, value = vectors.best(node.belief, first)
        if value[0] > node.held:
            node.held, node.witness = float(value[0]), int(vectors.stamps[best[0]])
    node.seen_vectors = tree.next_vector


def forget_lower(node: Node) -> None:
    """Make the next visit look at all vectors: a remembered one was pruned."""
    node.lower[:] = -np.inf
    for branch in node.branches.values():
        branch.lower[:] = -np.inf
        branch.seen_vectors = 0


def open_branch(tree: Tree, node: Node, action: int) -> tuple[Branch, Outcomes]:
    """An action's children and the beliefs they stand for."""
    branch = node.branches.get(action)
    if branch is not None and branch.outcomes is not None:
        return branch, branch.outcomes
    found = outcomes(tree.model, node.belief, action)
    if branch is None:
        branch = Branch.of(found)
        if found.size <= tree.room:
            tree.room -= found.size
            branch.outcomes = found
        node.branches[action] = branch
    return branch, found
