"""Updates of a node's bounds with the vectors and points that were added since its last visit.

An action is expanded at its first update: until then the informed bound is its upper bound.
"""

from __future__ import annotations

import numpy as np

from lcorpp.planning.sarsop.numpy_kernels.model import BeliefBatch
from lcorpp.planning.sarsop.numpy_kernels.node import BeliefNode, Branch, Outcomes, compute_outcomes
from lcorpp.planning.sarsop.numpy_kernels.search_state import SearchState


def refresh(state: SearchState, node: BeliefNode) -> None:
    """Update the upper bound of the best action and the lower bounds of all actions that may be the best."""
    action, _ = refresh_best_upper(state, node)
    lower = float(node.q_lower.max())
    refresh_lower(state, node, action)
    lower = max(lower, float(node.q_lower[action]))
    for a in range(state.model.actions):
        if a != action and node.q_upper[a] > lower:
            refresh_lower(state, node, a)
            lower = max(lower, float(node.q_lower[a]))
    update_best_vector(state, node)
    node.lower = max(node.lower, lower, node.lower_value)


def select_action(state: SearchState, node: BeliefNode, use_lower_bound: bool) -> int:
    """Return the best action by the upper or lower bound, after an update of that action's bounds."""
    action, updated = refresh_best_upper(state, node)
    update_best_vector(state, node)
    if use_lower_bound:
        action = int(node.q_lower.argmax())
        if node.q_lower[action] < node.lower_value:
            vectors = state.sets[node.belief.group]
            action = int(vectors.actions[vectors.find(node.best_vector)])
        if action not in updated:
            refresh_upper(state, node, action)
    refresh_lower(state, node, action)
    node.lower = max(node.lower, float(node.q_lower[action]), node.lower_value)
    return action


def refresh_best_upper(state: SearchState, node: BeliefNode) -> tuple[int, set[int]]:
    """Update upper bounds until that of the best action is up to date; return it and the updated actions."""
    updated: set[int] = set()
    while (action := int(node.q_upper.argmax())) not in updated:
        refresh_upper(state, node, action)
        updated.add(action)
    node.upper = min(node.upper, float(node.q_upper[action]))
    return action, updated


def refresh_lower(state: SearchState, node: BeliefNode, action: int) -> None:
    """Update the lower bound of one action."""
    branch = node.branches.get(action)
    if branch is not None and branch.vectors_version == state.next_vector:
        return
    branch, outcomes = expand(state, node, action)
    for children, beliefs in outcomes.batches:
        vectors = state.sets[beliefs.group]
        first = vectors.first_since(branch.vectors_version)
        if first < vectors.count:
            best, value = vectors.best(beliefs, first)
            better = value > branch.lower[children]
            branch.lower[children[better]] = value[better]
            branch.best_vectors[children[better]] = vectors.stamps[best[better]]
    node.q_lower[action] = node.expected_rewards[action] + state.model.discount * branch.lower.sum()
    branch.vectors_version = state.next_vector


def refresh_upper(state: SearchState, node: BeliefNode, action: int) -> None:
    """Update the upper bound of one action."""
    branch, sawtooth = node.branches.get(action), state.sawtooth
    if branch is not None and branch.refreshed and branch.points_version == sawtooth.next_stamp:
        return
    branch, outcomes = expand(state, node, action)
    for children, beliefs in outcomes.batches:
        bound = sawtooth.compute_bound(beliefs, branch.points_version)
        branch.upper[children] = np.minimum(branch.upper[children], bound)
    for c in np.flatnonzero(branch.child_nodes >= 0).tolist():
        node_bound = state.nodes[branch.child_nodes[c]].upper + branch.lipschitz_slack[c]
        branch.upper[c] = min(branch.upper[c], branch.probability[c] * node_bound)
    look_ahead = node.expected_rewards[action] + state.model.discount * branch.upper.sum()
    node.q_upper[action] = min(node.q_upper[action], look_ahead)
    branch.points_version = sawtooth.next_stamp
    branch.refreshed = True


def update_best_vector(state: SearchState, node: BeliefNode) -> float:
    """Update the best vector at a node; return its value."""
    vectors = state.sets[node.belief.group]
    if node.best_vector >= 0 and vectors.find(node.best_vector) < 0:  # it was pruned
        node.vectors_version, node.lower_value = 0, -np.inf
    first = vectors.first_since(node.vectors_version)
    if first < vectors.count:
        best, value = vectors.best(node.belief, first)
        if value[0] > node.lower_value:
            node.lower_value, node.best_vector = float(value[0]), int(vectors.stamps[best[0]])
    node.vectors_version = state.next_vector
    return node.lower_value


def update_upper_bound(state: SearchState, node: BeliefNode) -> float:
    """Update the sawtooth value at a node; return the smaller of it and the node's own upper bound."""
    newer = float(state.sawtooth.compute_bound(node.belief, node.sawtooth_version)[0])
    node.sawtooth_value = min(node.sawtooth_value, newer)
    node.sawtooth_version = state.sawtooth.next_stamp
    return min(node.sawtooth_value, node.upper)


def forget_lower(node: BeliefNode) -> None:
    """Discard the lower bounds of all actions, because a remembered vector was pruned."""
    node.q_lower[:] = -np.inf
    for branch in node.branches.values():
        branch.lower[:] = -np.inf
        branch.vectors_version = 0


def expand(state: SearchState, node: BeliefNode, action: int) -> tuple[Branch, Outcomes]:
    """Return the branch of an action, created if necessary, and its next beliefs."""
    branch = node.branches.get(action)
    if branch is not None and branch.outcomes is not None:
        return branch, branch.outcomes
    outcomes = compute_outcomes(state.model, node.belief, action)
    if branch is None:
        branch = Branch.of(outcomes)
        if outcomes.size <= state.cache_budget:
            state.cache_budget -= outcomes.size
            branch.outcomes = outcomes
        node.branches[action] = branch
    return branch, outcomes


def find_or_add_child(state: SearchState, node: BeliefNode, action: int, child: int) -> int:
    """Return the node of a child of an expanded action, created if necessary."""
    branch = node.branches[action]
    if branch.child_nodes[child] < 0:
        states, weights = expand(state, node, action)[1].belief(child)
        group = int(branch.group[child])
        positions = state.model.find_positions(group, states)
        number = state.find_or_add_node(BeliefBatch(group, states, positions, weights[None]))
        # the values of two beliefs differ by at most the largest value times their distance
        difference = state.dense_belief(number)
        difference[states] -= weights
        branch.lipschitz_slack[child] = state.max_abs_value * float(np.abs(difference).sum())
        branch.child_nodes[child] = number
    return int(branch.child_nodes[child])
