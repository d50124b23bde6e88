"""Values by brute force: enumeration of all belief trees."""

from __future__ import annotations

import numpy as np

from lcorpp.planning import Pomdp


def best(pomdp: Pomdp, belief, steps: int, discount: float | None = None) -> float:
    """The optimal expected reward of some steps; the belief may be unnormalised."""
    if steps == 0:
        return 0.0
    gamma = pomdp.discount if discount is None else discount
    values = []
    for a in range(len(pomdp.actions)):
        spread = belief @ pomdp.transition[a]
        following = sum(
            best(pomdp, spread * column, steps - 1, discount) for column in pomdp.observation[a].T
        )
        values.append(belief @ pomdp.reward[a] + gamma * following)
    return float(max(values))


def earned(pomdp: Pomdp, choose, belief, steps: int, discount: float | None = None) -> float:
    """The expected reward of `choose(belief, remaining steps)`; the belief may be unnormalised."""
    total = belief.sum()
    if steps == 0 or total == 0:
        return 0.0
    gamma = pomdp.discount if discount is None else discount
    a = choose(belief / total, steps)
    spread = belief @ pomdp.transition[a]
    following = sum(
        earned(pomdp, choose, spread * column, steps - 1, discount) for column in pomdp.observation[a].T
    )
    return float(belief @ pomdp.reward[a] + gamma * following)


def tail(pomdp: Pomdp, steps: int) -> tuple[float, float]:
    """Bounds on the rewards after some steps: the smallest and the largest reward in every step."""
    weight = pomdp.discount**steps / (1 - pomdp.discount)
    return weight * pomdp.reward.min(), weight * pomdp.reward.max()


def corners(pomdp: Pomdp) -> np.ndarray:
    """(S + 1, S) the beliefs that know the state, and the uniform belief."""
    S = len(pomdp.states)
    return np.concatenate([np.eye(S), np.full((1, S), 1 / S)])
