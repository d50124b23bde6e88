"""What the best and the worst can earn from each state: the range that any policy's value lies in."""

from __future__ import annotations

from typing import Any

import numpy as np

from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array

MOST_WORK = 2**31
"""Multiplications that value iteration may take. It is a bound wherever it stops."""

CLOSE = 1e-4
"""Value iteration stops at a bound this close to the truth, as a share of the range of rewards ahead."""


def mdp_value_bounds(pomdp: Pomdp) -> tuple[Array, Array]:
    """Bounds on the value of any policy, by state.

    With every state seen, nothing can earn more than the best choice in each state, and nothing less than
    the worst; what sees less lies between. A policy's value at a belief is linear in the state it starts in,
    so it lies between the beliefs' averages.

    Returns:
        (S,) at least and (S,) at most, in reward units.

    Source: value iteration with the bounds of MacQueen (1966); Puterman, Markov Decision Processes, 1994,
    section 6.3.
    """
    return -_highest(pomdp, -pomdp.reward), _highest(pomdp, pomdp.reward)


def _highest(pomdp: Pomdp, reward: Array) -> Array:
    """(S,) an upper bound on the value of the MDP with rewards (A, S)."""
    from scipy.sparse import csr_array

    T, gamma = pomdp.transition, pomdp.discount
    A, S, _ = T.shape
    matrix: Any = csr_array((T.values, T.columns, T.begins), shape=(A * S, S))
    ahead = gamma / (1 - gamma)
    close = CLOSE * (float(np.ptp(reward)) / (1 - gamma))
    value = np.zeros(S)
    bound = np.full(S, np.inf)
    for _ in range(max(2, MOST_WORK // max(1, len(T.values)))):
        after = (reward + gamma * (matrix @ value).reshape(A, S)).max(axis=0)
        change = after - value
        bound = np.minimum(bound, after + ahead * float(change.max()))
        value = after
        if ahead * float(np.ptp(change)) <= close:
            break
    # rounding of the last sweep, which the bound would repeat for ever
    return bound + 1e-14 * (float(np.abs(reward).max()) / (1 - gamma)) / (1 - gamma)
