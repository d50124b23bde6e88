"""Reduce a finite-horizon problem to an infinite-horizon one by adding the observed time step to the state.

The states at time t are those after t steps; the last step leads to a terminal state without rewards.
Rewards are weighted so that their sum has the requested discount, including 1, although the time-expanded
problem has a discount below 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.planning.policy import UpperBound
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sparse import MAX_BYTES, SparseTables
from lcorpp.values import Array, Belief


@dataclass(frozen=True, eq=False, repr=False)
class TimeExpandedPomdp:
    """The time-expanded problem of H steps.

    pomdp: H S + 1 states, t S + s for state s after t steps, and the terminal state; H O + 1 observations.
    weights: (H,) factors of the values at each time.
    """

    pomdp: Pomdp
    weights: Array

    def __repr__(self) -> str:
        return f"<TimeExpandedPomdp: {self.horizon} steps, {self.states} states>"

    @property
    def horizon(self) -> int:
        """H."""
        return len(self.weights)

    @property
    def states(self) -> int:
        """S."""
        return (len(self.pomdp.states) - 1) // self.horizon

    def belief(self, belief: Belief, time: int) -> Belief:
        """Return (H S + 1,) a belief (S,) at a time."""
        expanded = np.zeros(len(self.pomdp.states))
        expanded[time * self.states : (time + 1) * self.states] = belief
        return expanded


@dataclass(frozen=True, eq=False, repr=False)
class TimeStepBound:
    """The upper bound of a time-expanded problem at one time: `lcorpp.planning.policy.UpperBound`."""

    expanded: TimeExpandedPomdp
    time: int
    bound: UpperBound

    def __repr__(self) -> str:
        return f"<TimeStepBound: time {self.time} of {self.expanded.horizon}>"

    def value(self, belief: Belief) -> float:
        """Return the bound at a belief (S,)."""
        return self.bound.value(self.expanded.belief(belief, self.time)) / float(
            self.expanded.weights[self.time]
        )


def time_expand(pomdp: Pomdp, horizon: int, discount: float) -> TimeExpandedPomdp:
    """Build the time-expanded problem.

    Args:
        horizon: H, at least 1.
        discount: of the H steps, from 0 to 1.

    Raises:
        ModelError: the tables would be too large.
    """
    A, S = pomdp.reward.shape
    entries = horizon * (len(pomdp.transition.values) + len(pomdp.observation.values) + 2 * A * S)
    if 16 * entries > MAX_BYTES:
        raise ModelError(
            f"{horizon} steps of a problem of {S} states need tables of {entries} numbers, which is too many"
        )
    # close enough to the requested discount that the weights stay similar
    own = discount if discount < 1 else 1 - 1 / (2 * horizon + 2)
    factor = discount / own if own > 0 else 1.0
    weights: Array = np.power(factor, np.arange(horizon, dtype=np.float64))
    reward = np.concatenate([pomdp.reward * weight for weight in weights] + [np.zeros((A, 1))], axis=1)
    expanded = Pomdp(
        states=(*(f"{name}@{t}" for t in range(horizon) for name in pomdp.states), "end"),
        actions=pomdp.actions,
        observations=(*(f"{name}@{t}" for t in range(horizon) for name in pomdp.observations), "end"),
        transition=_stack(pomdp.transition, horizon, shift=1),
        observation=_stack(pomdp.observation, horizon, shift=0),
        reward=reward,
        discount=own,
        start=np.append(pomdp.start, np.zeros((horizon - 1) * S + 1)),
        file=pomdp.file,
    )
    return TimeExpandedPomdp(expanded, weights)


def _stack(table: SparseTables, horizon: int, *, shift: int) -> SparseTables:
    """Repeat a table (A, S, N) at every time: (A, H S + 1, H N + 1), with columns `shift` times later."""
    A, S, N = table.shape
    inner = horizon - shift
    sizes, columns, values = [], [], []
    for a in range(A):
        part = table.action_slice(a)
        counts = np.diff(table.begins[a * S : (a + 1) * S + 1])
        sizes += [np.tile(counts, inner), np.ones(shift * S + 1, dtype=np.int64)]
        offsets = np.repeat((np.arange(inner) + shift) * N, part.stop - part.start)
        columns += [np.tile(table.columns[part], inner) + offsets, np.full(shift * S + 1, horizon * N)]
        values += [np.tile(table.values[part], inner), np.ones(shift * S + 1)]
    begins = np.concatenate([[0], np.cumsum(np.concatenate(sizes))])
    shape = (A, horizon * S + 1, horizon * N + 1)
    return SparseTables(shape, begins, np.concatenate(columns).astype(np.int32), np.concatenate(values))
