"""Exact value iteration by incremental pruning: the value at every belief, for small problems.

Sources: Cassandra, Littman and Zhang, Incremental pruning: a simple, fast, exact method for partially
observable Markov decision processes, UAI 1997; Zhang and Zhang, JAIR 2001, for what is done between two
steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solution import Progress, Solution
from lcorpp.planning.solvers.arguments import checked_limits, checked_starts
from lcorpp.planning.solvers.exact.dominance_lp import OutOfTime
from lcorpp.planning.solvers.exact.dynamic_programming import Steps
from lcorpp.planning.solvers.exact.point_based import Plans, improved
from lcorpp.planning.solvers.exact.pruning import excess, prune
from lcorpp.values import Array, Belief

LOSS_SHARE = 0.2
"""Share of the precision that pruning may cost."""

COARSE = 0.05
"""While the value still changes, pruning may cost this share of the last change in a step."""

SHARE = 0.01
"""Between two steps plans are made better until a round gains no more than this share of what is aimed at."""


@dataclass(frozen=True, eq=False)
class RaisedBound:
    """The best of some vectors (K, S), and a number more: `lcorpp.planning.policy.UpperBound`."""

    vectors: Array
    more: float

    def value(self, belief: Belief) -> float:
        """The bound at a belief (S,)."""
        return float((self.vectors @ belief).max()) + self.more


def solve_exact(
    pomdp: Pomdp,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 1e-3,
    time_limit: float = 60.0,
    callback: Callable[[Progress], None] | None = None,
) -> Solution:
    """Find the value of every belief to a precision, by value iteration with incremental pruning.

    A step that raises the value by d at most, and may have lost e by pruning, bounds the optimal value from
    above: it is at most e + (d + e) gamma / (1 - gamma) above the vectors after the step. From below, vectors
    are values of plans that can be followed; where a step lets the value fall by f somewhere, for pruning,
    they are taken f gamma / (1 - gamma) lower, so that the policy earns what they say. All of d, e and f are
    proven (`margins`); what is left is the rounding of doubles.

    Between two steps the plans are made better at the beliefs where the last step found each to be the best
    (`point_based`), for a step of the full value costs many times as much. At the time limit, or at an
    interrupt from the keyboard, it returns the best so far.

    Args:
        pomdp: the problem. The number of vectors is what limits the method: it may grow beyond any measure
            with a dozen states and observations.
        start: (S,) belief at which the bounds are reported, or (N, S) several; the model's own when None. The
            policy is as good everywhere.
        precision: stop when upper - lower is at most this, in reward units, at every belief.
        time_limit: wall-clock seconds.
        callback: called after each step.

    Returns:
        The policy, both bounds, the seconds used and why it stopped; `trials` counts the steps, `beliefs`
        the vectors' witnesses.

    Raises:
        ModelError: `start` is not a distribution over the states, precision or limit are not positive, or
            the problem is too large for memory.

    Source: Cassandra, Littman and Zhang, UAI 1997.
    """
    checked_limits(precision, time_limit)
    search = _Iteration(pomdp, checked_starts(pomdp, start), precision, monotonic() + time_limit)
    try:
        reason = search.run(callback)
    except KeyboardInterrupt:
        reason = "interrupted"
    except OutOfTime:
        reason = "time limit"
    return search.solution(reason)


class _Iteration:
    """The plans so far, those of them that are sure, and what bounds the value from above."""

    def __init__(self, pomdp: Pomdp, starts: Array, precision: float, deadline: float) -> None:
        self.began, self.deadline = monotonic(), deadline
        self.pomdp, self.starts, self.precision = pomdp, starts, precision
        self.steps = Steps(pomdp)
        self.plans = self.sure = Plans(self.steps.blind(), np.arange(self.steps.actions))
        self.beliefs = np.concatenate([starts, np.eye(self.steps.states)])
        # no policy earns more than the largest reward at every step
        most = float(pomdp.reward.max()) / (1 - pomdp.discount)
        self.above = RaisedBound(np.full((1, self.steps.states), most), 0.0)
        self.done = 0
        self.history: list[tuple[float, float, float, int]] = []
        self._note()

    def run(self, callback: Callable[[Progress], None] | None) -> str:
        """Step until a reason to stop; the reason."""
        # what a step may still raise and lose at the end
        aim, prunings = self.precision * (1 - self.steps.discount), self.steps.most_prunings + 1
        rise, coarse = float(np.ptp(self.pomdp.reward)), COARSE
        while True:
            loss = max(LOSS_SHARE * aim, coarse * rise) / prunings
            self._improve(SHARE * max(aim, rise), loss)
            before, (rise, gap) = rise, self._step(loss, SHARE * aim)
            if rise > 0.5 * before:
                coarse *= 0.5  # too much is lost for steps to get anywhere
            _, low, high = self._note()
            if callback is not None:
                vectors, beliefs = len(self.sure.actions), len(self.beliefs)
                callback(Progress(self.history[-1][0], low, high, vectors, beliefs, self.done))
            if gap <= self.precision:
                return "precision reached"

    def _improve(self, gain: float, loss: float) -> None:
        """Make the plans better at the beliefs where they serve, and keep those that serve elsewhere."""
        better, closed = improved(self.steps, self.plans, self.beliefs, gain=gain, deadline=self.deadline)
        if closed is not None:
            self._keep(closed)
        # without the old ones what a step has gained between the beliefs would be lost again
        vectors = np.concatenate([better.vectors, self.plans.vectors])
        actions = np.concatenate([better.actions, self.plans.actions])
        rows = prune(vectors, self.beliefs, tolerance=loss, deadline=self.deadline).rows
        self.plans = Plans(vectors[rows], actions[rows])

    def _step(self, loss: float, tolerance: float) -> tuple[float, float]:
        """One step of value iteration; how far it raised the value, and the gap that it proves everywhere."""
        steps, old, deadline = self.steps, self.plans, self.deadline
        share = steps.discount / (1 - steps.discount)
        after = steps.backup(old.vectors, self.beliefs, tolerance=loss, deadline=deadline)
        new, beliefs = Plans(after.vectors, after.actions), np.concatenate([self.starts, after.witnesses])
        rise = excess(new.vectors, old.vectors, beliefs, tolerance=tolerance, deadline=deadline)
        above = RaisedBound(new.vectors, after.loss + share * (rise + after.loss))
        # a new plan goes on with old ones; who goes on with the best new one instead loses the fall at most
        fall = excess(old.vectors, new.vectors, self.beliefs, tolerance=tolerance, deadline=deadline)
        sure, gap = Plans(new.vectors - share * fall, new.actions), above.more + share * fall
        if gap <= self.precision or self._bounds(above)[2] <= self._bounds(self.above)[2]:
            self.above = above
        if gap <= self.precision:
            self.sure = sure
        else:
            self._keep(sure)
        self.plans, self.beliefs, self.done = new, beliefs, self.done + 1
        return rise, gap

    def _keep(self, plans: Plans) -> None:
        """Remember plans whose promise is sure, where they promise more than those before."""
        if self._worth(plans).sum() > self._worth(self.sure).sum():
            self.sure = plans

    def _worth(self, plans: Plans) -> Array:
        return np.asarray((self.starts @ plans.vectors.T).max(axis=1))

    def _bounds(self, above: RaisedBound) -> tuple[int, float, float]:
        """The start where the bounds are furthest apart, and the bounds there."""
        low = self._worth(self.sure)
        high = (self.starts @ above.vectors.T).max(axis=1) + above.more
        widest = int((high - low).argmax())
        return widest, float(low[widest]), max(float(low[widest]), float(high[widest]))

    def _note(self) -> tuple[int, float, float]:
        widest, low, high = self._bounds(self.above)
        self.history.append((monotonic() - self.began, low, high, len(self.sure.actions)))
        return widest, low, high

    def solution(self, reason: str) -> Solution:
        """The best so far."""
        widest, low, high = self._note()
        piece = AlphaVectors(np.arange(self.steps.states), *self.sure)
        return Solution(
            pomdp=self.pomdp,
            policy=Policy.of_sets(self.pomdp, [piece], self.above),
            lower=low,
            upper=high,
            seconds=monotonic() - self.began,
            reason=reason,
            history=tuple(self.history[:-1]),
            beliefs=len(self.beliefs),
            trials=self.done,
            start=self.starts[widest],
        )
