"""A check of promises: whether the vectors of a policy suffice to earn the value of one of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import linprog

from lcorpp.planning import AlphaVectors, Policy, Pomdp


def assert_vectors_are_earned(
    pomdp: Pomdp, policy: Policy, *, sample: int = 40, tolerance: float = 1e-8
) -> None:
    """Assert that no vector exceeds the reward of its action plus the next vectors at any belief."""
    sets, rng = policy.vector_sets, np.random.default_rng(0)
    scale = max(np.abs(each.vectors).max() for each in sets)
    for each in sets:
        for row in rng.permutation(len(each.vectors))[:sample]:
            # a vector that replaces a pruned one may be smaller by 1e-11 of the largest value
            assert largest_shortfall(pomdp, sets, each, int(row)) <= tolerance * scale


def largest_shortfall(pomdp: Pomdp, sets: Sequence[AlphaVectors], own: AlphaVectors, row: int) -> float:
    """The largest excess at any belief of a vector over its action's reward plus the best next vectors.

    A linear program: minimise R b + gamma sum t - vector b over beliefs b and one t for each observation,
    with every t at least the value of each vector after the observation.
    """
    action, states = int(own.actions[row]), own.states
    T, Z = pomdp.transition[action][states], pomdp.observation[action]
    n, possible = len(states), np.flatnonzero((T @ Z).any(axis=0))
    rows, bounds = [], [(0.0, 1.0)] * n + [(None, None)] * len(possible)
    for o in possible:
        joint = T * Z[:, o]
        reached = np.flatnonzero(joint.any(axis=0))
        after = next(each for each in sets if set(reached) <= set(each.states))
        for values in (joint[:, after.states] @ after.vectors.T).T:
            rows.append(np.concatenate([values, np.where(possible == o, -1.0, 0.0)]))
    cost = np.concatenate(
        [pomdp.reward[action, states] - own.vectors[row], np.full(len(possible), pomdp.discount)]
    )
    total = np.concatenate([np.ones(n), np.zeros(len(possible))])[None]
    result = linprog(cost, np.array(rows), np.zeros(len(rows)), total, [1.0], bounds)
    assert result.success, result.message
    return -float(result.fun)
