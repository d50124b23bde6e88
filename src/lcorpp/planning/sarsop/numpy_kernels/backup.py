"""BACKUP: improve both bounds at one belief by one step of look-ahead.

Source: Kurniawati, Hsu and Lee, RSS 2008, Algorithm 3 (BACKUP).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lcorpp.planning.sarsop.numpy_kernels.dependencies import Edge
from lcorpp.planning.sarsop.numpy_kernels.model import BeliefBatch, Model
from lcorpp.planning.sarsop.numpy_kernels.node import BeliefNode, predict
from lcorpp.planning.sarsop.numpy_kernels.refresh import (
    forget_lower,
    refresh,
    update_best_vector,
    update_upper_bound,
)
from lcorpp.planning.sarsop.numpy_kernels.search_state import MIN_GAIN, SearchState
from lcorpp.values import Array, Indices


def backup(state: SearchState, node: BeliefNode) -> None:
    """Add the best alpha vector at a node and lower the upper bound there."""
    refresh(state, node)
    action = int(node.q_lower.argmax())
    branch = node.branches[action]
    if any(state.sets[g].find(stamp) < 0 for g, stamp in zip(branch.group, branch.best_vectors, strict=True)):
        forget_lower(node)
        refresh(state, node)
        action = int(node.q_lower.argmax())
    _raise_lower_bound(state, node, action)
    _lower_sawtooth_bound(state, node)


def _raise_lower_bound(state: SearchState, node: BeliefNode, action: int) -> None:
    update_best_vector(state, node)
    if node.q_lower[action] > node.lower_value + MIN_GAIN * state.max_abs_value:
        vector, edges = _make_vector(state, node, action)
        # the value of the vector here, not the look-ahead value: their rounding errors differ
        value = float(node.belief.weights[0] @ vector[node.belief.positions])
        if value > node.lower_value:
            state.dependencies.record(state.next_vector, edges)
            state.sets[node.belief.group].add(vector, action, state.next_vector)
            node.lower_value, node.best_vector = value, state.next_vector
            state.next_vector += 1
    node.lower = node.lower_value


def _lower_sawtooth_bound(state: SearchState, node: BeliefNode) -> None:
    update_upper_bound(state, node)
    if node.upper < node.sawtooth_value - MIN_GAIN * state.max_abs_value:
        replaced = node.point_stamp
        node.point_stamp = state.sawtooth.add(node.belief, node.upper)
        if replaced >= 0:
            state.sawtooth.remove(node.belief.group, replaced)


def combine(model: Model, group: int, action: int, value_of: Callable[[Indices, Indices], Array]) -> Array:
    """Return (n,) R(a) + gamma sum over s' and o of T Z V, over the states of a group.

    Args:
        value_of: returns V (k,) after observations (k,) in next states (k,).
    """
    states = model.group_states(group)
    index, owner = model.transition.row_entries(action * model.states + states)
    reached, which = np.unique(model.transition.columns[index].astype(np.intp), return_inverse=True)
    seen, after = model.observation.row_entries(action * model.states + reached)
    values = value_of(model.observation.columns[seen].astype(np.intp), reached[after])
    next_values = np.bincount(after, model.observation.values[seen] * values, minlength=len(reached))
    sums = np.bincount(owner, model.transition.values[index] * next_values[which], minlength=len(states))
    return np.asarray(model.reward[action, states] + model.discount * sums)


def _make_vector(state: SearchState, node: BeliefNode, action: int) -> tuple[Array, list[Edge]]:
    """Return the vector (n,) of an action followed by the best vectors of its children, and its edges.

    After an observation that is impossible at the node any vector is valid; the default vector serves the
    neighbouring beliefs.
    """
    model, branch = state.model, node.branches[action]
    chosen = np.full(model.observations, -1, dtype=np.intp)
    chosen[branch.observation] = [
        state.sets[g].find(stamp) for g, stamp in zip(branch.group, branch.best_vectors, strict=True)
    ]
    children = branch.observation.tolist(), branch.group.tolist(), branch.best_vectors.tolist()
    edges = [Edge(*child) for child in zip(*children, strict=True)]

    def value_of(observation: Indices, next_state: Indices) -> Array:
        block, values = model.block[next_state], np.empty(len(next_state))
        for b in np.unique(block):
            own = np.flatnonzero(block == b)
            vector = chosen[observation[own]]
            if (without := vector < 0).any():
                vector[without] = default = _find_default_vector(state, node, action, int(b))
                stamp = int(state.sets[b].stamps[default])
                edges.extend(Edge(int(o), int(b), stamp) for o in np.unique(observation[own[without]]))
            values[own] = state.sets[b].table[model.local[next_state[own]], vector]
        return values

    return combine(model, node.belief.group, action, value_of), edges


def _find_default_vector(state: SearchState, node: BeliefNode, action: int, block: int) -> int:
    """Return the best vector of a block after an action, before any observation."""
    model, vectors = state.model, state.sets[block]
    states, mass = predict(model, node.belief, action)
    inside = model.block[states] == block
    if not inside.any():
        return vectors.central()
    own = states[inside]
    return int(vectors.best(BeliefBatch(block, own, model.local[own], mass[None, inside]))[0][0])
