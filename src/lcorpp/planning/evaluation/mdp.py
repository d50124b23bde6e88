"""The MDP below a POMDP: bounds on the value of any policy, and states without further rewards."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sparse import SparseTables, ragged_indices
from lcorpp.values import Array

MAX_PRODUCTS = 2**31
"""The maximal number of multiplications of value iteration, whose result is a bound at any time."""

MAX_PART_ENTRIES = 2**22
"""Entries of a table that are multiplied at once, to limit the memory."""

GAP_SHARE = 1e-4
"""Value iteration stops at a bound this close to the optimum, relative to the range of future rewards."""


def mdp_value_bounds(pomdp: Pomdp) -> tuple[Array, Array]:
    """Return bounds on the value of any policy, by initial state.

    The bounds are the values of the best and the worst policy of the MDP, in which the state is observed. The
    value of a policy at a belief is linear in the initial state, so it lies between the means of the bounds.

    Returns:
        (S,) lower and (S,) upper bounds, in reward units.

    Source: value iteration with the bounds of MacQueen (1966); Puterman, Markov Decision Processes, 1994,
    section 6.3.
    """
    return -bound_above(pomdp, -pomdp.reward), bound_above(pomdp, pomdp.reward)


def bound_above(
    pomdp: Pomdp, reward: Array, *, may_stop: bool = False, max_products: int = MAX_PRODUCTS
) -> Array:
    """Return (S,) an upper bound on the value of the MDP with rewards (A, S), for a discount below 1.

    Args:
        may_stop: whether a policy may stop after each step; the bound then holds for any number of steps.
        max_products: maximal number of multiplications, of at least two sweeps.
    """
    T, gamma = pomdp.transition, pomdp.discount
    S = len(pomdp.states)
    ahead = gamma / (1 - gamma)
    max_gap = GAP_SHARE * (float(np.ptp(reward)) / (1 - gamma))
    value = np.zeros(S)
    bound = np.full(S, np.inf)
    for _ in range(max(2, max_products // max(1, len(T.values)))):
        later = np.maximum(value, 0.0) if may_stop else value
        after = (reward + gamma * _expect(T, later)).max(axis=0)
        change = after - value
        # with stops, values that fall by c may lower those of the next sweep by less than gamma c
        rise = max(float(change.max()), 0.0) if may_stop else float(change.max())
        bound = np.minimum(bound, after + ahead * rise)
        value = after
        if ahead * float(np.ptp(change)) <= max_gap:
            break
    # rounding error of the last sweep, accumulated over all future steps
    return bound + 1e-14 * (float(np.abs(reward).max()) / (1 - gamma)) / (1 - gamma)


def _expect(table: SparseTables, value: Array) -> Array:
    """Return (A, S) the mean of values (S,) of the next states; without scipy, whose import takes longer."""
    A, S, _ = table.shape
    begins, means = table.begins, np.empty(A * S)
    cuts = np.searchsorted(begins, np.arange(0, begins[-1], MAX_PART_ENTRIES))
    for first, last in pairwise(np.unique([*cuts, A * S]).tolist()):
        part = slice(begins[first], begins[last])
        products = table.values[part] * value[table.columns[part]]
        means[first:last] = np.add.reduceat(products, begins[first:last] - begins[first])  # no row is empty
    return means.reshape(A, S)


def zero_reward_states(pomdp: Pomdp) -> npt.NDArray[np.bool_]:
    """Return (S,) whether no state with a non-zero reward is reachable from a state, for any actions."""
    table, S = pomdp.transition, len(pomdp.states)
    rewarding: npt.NDArray[np.bool_] = (pomdp.reward != 0).any(axis=0)
    positive = np.flatnonzero(table.values > 0)
    positive = positive[np.argsort(table.columns[positive], kind="stable")]
    sources = table.rows[positive] % S
    begins = np.searchsorted(table.columns[positive], np.arange(S + 1))
    frontier = np.flatnonzero(rewarding)
    while len(frontier):
        before = sources[ragged_indices(begins[frontier], begins[frontier + 1] - begins[frontier])]
        frontier = np.unique(before[~rewarding[before]])
        rewarding[frontier] = True
    return ~rewarding


def find_self_loop_classes(pomdp: Pomdp) -> npt.NDArray[np.intp]:
    """Return (A, S) the self-loop class of each action and state.

    The class is -1 if the action has a reward in the state or can leave the state. Otherwise it is a number
    from 0, equal for equal rows P(o | a, s) of the observation table. If all states of a belief have one
    class >= 0 under an action, no observation changes the belief, and all further rewards of the action are
    zero: the belief is absorbing.
    """
    T, Z, S = pomdp.transition, pomdp.observation, len(pomdp.states)
    positive = T.values > 0
    moving = T.columns[positive] != T.rows[positive] % S
    leaves = np.bincount(T.rows[positive], moving, minlength=len(T.begins) - 1) > 0
    classes = np.full((len(pomdp.actions), S), -1, dtype=np.intp)
    class_of_row: dict[bytes, int] = {}
    for row in np.flatnonzero(~leaves & (pomdp.reward.reshape(-1) == 0)).tolist():
        columns, values = Z.row(row // S, row % S)
        key = columns.tobytes() + values.tobytes()
        classes[row // S, row % S] = class_of_row.setdefault(key, len(class_of_row))
    return classes
