"""Problems of a given number of steps, solved at every belief: incremental pruning.

Source: Cassandra, Littman and Zhang, Incremental pruning, UAI 1997.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solution import Progress
from lcorpp.planning.solvers.arguments import checked_count, checked_discount, checked_limits, checked_starts
from lcorpp.planning.solvers.exact.dominance_lp import OutOfTime
from lcorpp.planning.solvers.exact.dynamic_programming import Steps
from lcorpp.planning.solvers.exact.incremental_pruning import RaisedBound
from lcorpp.planning.solvers.finite_horizon.solution import FiniteSolution, finite_policy
from lcorpp.values import Array


def solve_finite_exact(
    pomdp: Pomdp,
    horizon: int,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 1e-6,
    time_limit: float = 60.0,
    callback: Callable[[Progress], None] | None = None,
    discount: float | None = None,
) -> FiniteSolution:
    """Find what to do at every belief with every number of steps to go, up to a horizon.

    All vectors are values of plans that go on with those of one step less, so every policy earns what it
    promises. What pruning has lost is proven (`margins`) and added up into the upper bounds. When the time is
    up, or at an interrupt from the keyboard, policies for fewer steps are returned than were asked for.

    Args:
        pomdp: the problem. The number of vectors is what limits the method.
        horizon: the number of steps, from 1.
        start: (S,) belief at which the bounds are reported, or (N, S) several; the model's own when None. The
            policies are as good everywhere.
        precision: what pruning may cost at any belief, in reward units.
        time_limit: wall-clock seconds.
        callback: called after each step; `trials` is the number of steps.
        discount: 0 < discount <= 1, with 1 for the plain sum of the rewards; the model's own when None.

    Returns:
        The policy for every number of steps to go that was reached, bounds with that many steps to go, the
        seconds used and why it stopped: "precision reached", "time limit" or "interrupted".

    Raises:
        ModelError: `start` is not a distribution over the states, a number is out of range, or the problem is
            too large for memory.

    Source: Cassandra, Littman and Zhang, UAI 1997.
    """
    checked_limits(precision, time_limit)
    horizon = checked_count("horizon", horizon, 1)
    factor = checked_discount(pomdp, discount)
    began = monotonic()
    search = _Stages(pomdp, checked_starts(pomdp, start), factor, began)
    try:
        reason = search.run(horizon, precision, began + time_limit, callback)
    except KeyboardInterrupt:
        reason = "interrupted"
    except OutOfTime:
        reason = "time limit"
    return search.solution(reason)


@dataclass(frozen=True, eq=False)
class _Stage:
    """The value with some steps to go: vectors, witnesses and what all prunings have lost so far."""

    policy: Policy
    witnesses: Array
    lost: float


class _Stages:
    """The values with 1, 2, ... steps to go."""

    def __init__(self, pomdp: Pomdp, starts: Array, discount: float, began: float) -> None:
        self.pomdp, self.starts, self.began = pomdp, starts, began
        self.steps = Steps(pomdp, discount)
        self.history: list[tuple[float, float, float, int]] = []
        # with one step to go an action is worth its reward
        self.stages = [self._stage(pomdp.reward, np.arange(self.steps.actions), starts, 0.0, 1)]

    def run(
        self, horizon: int, precision: float, deadline: float, callback: Callable[[Progress], None] | None
    ) -> str:
        """Step back until the horizon is reached; the reason to stop."""
        steps = self.steps
        weight = float((steps.discount ** np.arange(horizon)).sum())
        tolerance = precision / (weight * (steps.most_prunings + 1))
        self._told(callback)
        while len(self.stages) < horizon:
            last = self.stages[-1]
            after = steps.backup(last.policy.vectors, last.witnesses, tolerance=tolerance, deadline=deadline)
            lost = after.loss + steps.discount * last.lost
            witnesses, to_go = np.concatenate([self.starts, after.witnesses]), len(self.stages) + 1
            self.stages.append(self._stage(after.vectors, after.actions, witnesses, lost, to_go))
            self._told(callback)
        return "precision reached"

    def _stage(
        self, vectors: Array, actions: npt.NDArray[np.intp], witnesses: Array, lost: float, to_go: int
    ) -> _Stage:
        pieces = [AlphaVectors(np.arange(self.steps.states), vectors, actions)]
        above = RaisedBound(vectors, lost)
        policy = finite_policy(self.pomdp, pieces, to_go, self.steps.discount, above)
        return _Stage(policy, witnesses, lost)

    def _told(self, callback: Callable[[Progress], None] | None) -> None:
        stage = self.stages[-1]
        low = float((self.starts @ stage.policy.vectors.T).max(axis=1)[0])
        self.history.append((monotonic() - self.began, low, low + stage.lost, len(stage.policy)))
        if callback is not None:
            callback(Progress(*self.history[-1], len(stage.witnesses), len(self.stages)))

    def solution(self, reason: str) -> FiniteSolution:
        """The stages so far."""
        last = self.stages[-1]
        low = last.policy.value(self.starts[0])
        return FiniteSolution(
            policies=tuple(stage.policy for stage in self.stages),
            lower=low,
            upper=low + last.lost,
            seconds=monotonic() - self.began,
            reason=reason,
            history=tuple(self.history),
        )
