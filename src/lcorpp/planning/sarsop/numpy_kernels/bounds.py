"""Where both bounds start: blind policies below, the fast informed bound above.

An operator F that is monotone and shifts by gamma c when its argument shifts by c (all three below) has its
fixed point between F(v) + gamma / (1 - gamma) times the least and the largest change F(v) - v. So a sweep
ends with a shift: where all values change alike, as they do under slow discounts, few sweeps are enough.
Every sweep is a bound, so that it may stop anywhere.

Sources: Hauskrecht, Value-function approximations for POMDPs, JAIR 2000 (blind policies, MDP, fast informed
bound); MacQueen, A modified dynamic programming method for Markovian decision problems, 1966 (the shift).
"""

from __future__ import annotations

from math import isnan
from time import monotonic
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from lcorpp.planning.sarsop.numpy_kernels.model import Indices, Model, entries
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array


def blind_policies(model: Model, tolerance: float, seconds: float) -> Array:
    """(A, S) the value of doing one action for ever, from below, to within `tolerance` if time allows.

    Args:
        tolerance: how far below the truth the result may be, in reward units.
        seconds: of wall-clock time.

    Raises:
        ValueError: tolerance or seconds are no numbers, or the tolerance is negative.
    """
    _check(tolerance, seconds)
    deadline = monotonic() + seconds
    gamma = model.discount
    values = np.empty((model.actions, model.states))
    for a, T in enumerate(_matrices(model.transition)):
        reward = model.reward[a]
        value = np.full(model.states, reward.min() / (1 - gamma))
        while True:
            following = reward + gamma * (T @ value)
            rise = following - value
            least = max(0.0, float(rise.min()))
            value = following + gamma / (1 - gamma) * least
            if (float(rise.max()) - least) * gamma / (1 - gamma) <= tolerance or monotonic() >= deadline:
                break
        values[a] = value
    return values


def mdp_bound(model: Model, tolerance: float, seconds: float) -> Array:
    """(A, S) Q values above those of the fully observed problem; arguments as for `blind_policies`."""
    _check(tolerance, seconds)
    deadline = monotonic() + seconds
    gamma, matrices = model.discount, _matrices(model.transition)
    # no policy earns more than the largest reward at every step
    value = np.full(model.states, model.reward.max() / (1 - gamma))
    while True:
        Q = model.reward + gamma * np.array([T @ value for T in matrices])
        fall = value - Q.max(axis=0)
        least = max(0.0, float(fall.min()))
        shift = gamma / (1 - gamma) * least
        value = Q.max(axis=0) - shift
        if (float(fall.max()) - least) * gamma / (1 - gamma) <= tolerance or monotonic() >= deadline:
            return np.asarray(Q - shift)


def fast_informed_bound(model: Model, Q: Array, tolerance: float, seconds: float) -> Array:
    """(A, S) the fast informed bound, iterated downwards from Q values (A, S) that are above the truth.

    Q(a, s) <- R(a, s) + gamma sum over o of max over a' of sum over s' of P(s', o | s, a) Q(a', s').
    Arguments as for `blind_policies`.
    """
    _check(tolerance, seconds)
    deadline = monotonic() + seconds
    gamma = model.discount
    Q = checked_table(model, Q)
    joint = [_joint(model, a) for a in range(model.actions)]
    while monotonic() < deadline:
        lowered = np.empty_like(Q)
        for a, (matrix, state) in enumerate(joint):
            best = (matrix @ np.ascontiguousarray(Q.T)).max(axis=1)
            lowered[a] = model.reward[a] + gamma * np.bincount(state, best, minlength=model.states)
        fall = Q - lowered
        least = max(0.0, float(fall.min()))
        Q = np.minimum(Q, lowered - gamma / (1 - gamma) * least)
        if (float(fall.max()) - least) * gamma / (1 - gamma) <= tolerance:
            break
    return Q


def checked_table(model: Model, table: Array) -> Array:
    """A copy of a table (A, S).

    Raises:
        ValueError: the shape is another, or a number is not finite.
    """
    copy = np.array(table, dtype=np.float64)
    if copy.shape != (model.actions, model.states) or not np.isfinite(copy).all():
        raise ValueError("expected a table of actions by states, of finite numbers")
    return copy


def _check(tolerance: float, seconds: float) -> None:
    # a sweep that may never be near enough must not run for ever because of a number that is none
    if not tolerance >= 0 or isnan(seconds):
        raise ValueError("tolerance and seconds are numbers, the tolerance not negative")


def _matrices(rows: SparseTables) -> list[Any]:
    """Each action's table as a matrix of scipy."""
    matrices = []
    for a in range(rows.shape[0]):
        part = rows.action_slice(a)
        begins = rows.begins[a * rows.shape[1] : (a + 1) * rows.shape[1] + 1] - part.start
        matrices.append(csr_array((rows.values[part], rows.columns[part], begins), shape=rows.shape[1:]))
    return matrices


def _joint(model: Model, action: int) -> tuple[Any, Indices]:
    """P(s', o | s, a) of one action, a row for each (s, o) that can be, a column for each s'; the rows' s."""
    T, Z = model.transition, model.observation
    part = T.action_slice(action)
    reached = T.columns[part].astype(np.intp)
    index, owner = entries(Z, action * model.states + reached)
    state = T.rows[part][owner] - action * model.states
    weight = T.values[part][owner] * Z.values[index]
    pair, row = np.unique(state * model.observations + Z.columns[index], return_inverse=True)
    shape = (len(pair), model.states)
    return csr_array((weight, (row, reached[owner])), shape=shape), pair // model.observations
