"""Initial bounds: blind policies from below, the MDP and the fast informed bound from above.

Let F be a monotone operator that shifts by gamma c if its argument shifts by c (all three operators below).
Its fixed point lies between F(v) + gamma / (1 - gamma) times the minimum and the maximum of F(v) - v. Every
sweep therefore ends with a shift: if all values change by similar amounts, as under slow discounts, few
sweeps suffice. Every sweep yields a valid bound, so the iteration may stop at any time: the result is
within `tolerance`, in reward units, or `seconds` of wall-clock time are over.

Sources: Hauskrecht, Value-function approximations for POMDPs, JAIR 2000 (blind policies, MDP, fast informed
bound); MacQueen, A modified dynamic programming method for Markovian decision problems, 1966 (the shift).
"""

from __future__ import annotations

from math import isnan
from time import monotonic
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from lcorpp.planning.sarsop.numpy_kernels.model import Model
from lcorpp.planning.sparse import SparseTables, joint_matrix
from lcorpp.values import Array


def blind_policies(model: Model, tolerance: float, seconds: float) -> Array:
    """Return (A, S) lower bounds on the value of repeating one action forever."""
    _check_limits(tolerance, seconds)
    deadline = monotonic() + seconds
    gamma = model.discount
    values = np.empty((model.actions, model.states))
    for a, T in enumerate(_make_matrices(model.transition)):
        reward = model.reward[a]
        value = np.full(model.states, reward.min() / (1 - gamma))
        while True:
            backed_up = reward + gamma * (T @ value)
            change = backed_up - value
            smallest = max(0.0, float(change.min()))
            value = backed_up + gamma / (1 - gamma) * smallest
            if (float(change.max()) - smallest) * gamma / (1 - gamma) <= tolerance or monotonic() >= deadline:
                break
        values[a] = value
    return values


def mdp_bound(model: Model, tolerance: float, seconds: float) -> Array:
    """Return (A, S) upper bounds on the Q values of the fully observable problem."""
    _check_limits(tolerance, seconds)
    deadline = monotonic() + seconds
    gamma, matrices = model.discount, _make_matrices(model.transition)
    # no policy earns more than the largest reward in every step
    value = np.full(model.states, model.reward.max() / (1 - gamma))
    while True:
        Q = model.reward + gamma * np.array([T @ value for T in matrices])
        change = value - Q.max(axis=0)
        smallest = max(0.0, float(change.min()))
        shift = gamma / (1 - gamma) * smallest
        value = Q.max(axis=0) - shift
        if (float(change.max()) - smallest) * gamma / (1 - gamma) <= tolerance or monotonic() >= deadline:
            return np.asarray(Q - shift)


def fast_informed_bound(model: Model, Q: Array, tolerance: float, seconds: float) -> Array:
    """Return (A, S) the fast informed bound, iterated downwards from Q values (A, S) that are upper bounds.

    Q(a, s) <- R(a, s) + gamma sum over o of max over a' of sum over s' of P(s', o | s, a) Q(a', s').
    """
    _check_limits(tolerance, seconds)
    deadline = monotonic() + seconds
    gamma = model.discount
    Q = copy_table(model, Q)
    joint = [joint_matrix(model.transition, model.observation, a) for a in range(model.actions)]
    while monotonic() < deadline:
        lowered = np.empty_like(Q)
        for a, (matrix, _, state) in enumerate(joint):
            best = (matrix @ np.ascontiguousarray(Q.T)).max(axis=1)
            lowered[a] = model.reward[a] + gamma * np.bincount(state, best, minlength=model.states)
        change = Q - lowered
        smallest = max(0.0, float(change.min()))
        Q = np.minimum(Q, lowered - gamma / (1 - gamma) * smallest)
        if (float(change.max()) - smallest) * gamma / (1 - gamma) <= tolerance:
            break
    return Q


def copy_table(model: Model, table: Array) -> Array:
    """Return a copy of a table (A, S) of finite numbers; raise a ValueError for another."""
    copy = np.array(table, dtype=np.float64)
    if copy.shape != (model.actions, model.states) or not np.isfinite(copy).all():
        raise ValueError("expected a table of finite numbers of actions by states")
    return copy


def _check_limits(tolerance: float, seconds: float) -> None:
    # with a NaN the iteration would never terminate
    if not tolerance >= 0 or isnan(seconds):
        raise ValueError("tolerance and seconds must not be NaN, tolerance not negative")


def _make_matrices(table: SparseTables) -> list[Any]:
    """Return the table of each action as a scipy matrix."""
    matrices = []
    for a in range(table.shape[0]):
        part = table.action_slice(a)
        begins = table.begins[a * table.shape[1] : (a + 1) * table.shape[1] + 1] - part.start
        matrices.append(csr_array((table.values[part], table.columns[part], begins), shape=table.shape[1:]))
    return matrices
