"""Exact value iteration by incremental pruning, for small problems: the value at every belief.

Sources: Cassandra, Littman and Zhang, Incremental pruning: a simple, fast, exact method for partially
observable Markov decision processes, UAI 1997; Zhang and Zhang, JAIR 2001, for the point-based steps between
two exact steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.planning.arguments import check_limits, check_starts
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solution import Progress, Solution
from lcorpp.planning.solvers.exact.dominance_lp import DeadlineExceeded
from lcorpp.planning.solvers.exact.dynamic_programming import DenseModel
from lcorpp.planning.solvers.exact.point_based import Plans, improve
from lcorpp.planning.solvers.exact.pruning import excess, prune
from lcorpp.values import Array, Belief

LOSS_SHARE = 0.2
"""Largest loss by pruning, as a share of the precision."""

INITIAL_LOSS_SHARE = 0.05
"""Largest loss by pruning in early steps, as a share of the last change in a step."""

GAIN_SHARE = 0.01
"""Point-based improvement stops when a round gains no more than this share of the wanted change of a step."""


@dataclass(frozen=True, eq=False, repr=False)
class ShiftedBound:
    """The upper bound max over v of v.b + shift of vectors (K, S): `lcorpp.planning.policy.UpperBound`."""

    vectors: Array
    shift: float

    def __repr__(self) -> str:
        return f"<ShiftedBound: {len(self.vectors)} vectors + {self.shift:.3g}>"

    def value(self, belief: Belief) -> float:
        """The bound at a belief (S,)."""
        return float((self.vectors @ belief).max()) + self.shift


def solve_exact(
    pomdp: Pomdp,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 1e-3,
    time_limit: float = 60.0,
    callback: Callable[[Progress], None] | None = None,
) -> Solution:
    """Find the value of every belief to a precision, by value iteration with incremental pruning.

    If a step raises the value by at most d and loses at most e by pruning, the optimal value is at most
    e + (d + e) gamma / (1 - gamma) above the vectors after the step. From below, vectors are values of plans
    that can be followed; if pruning lowers the value by at most f in a step, the vectors are lowered by
    f gamma / (1 - gamma), so that the policy earns what they promise. The bounds d, e and f are proven
    (`dominance_lp`); only the rounding of doubles remains.

    Between two steps the plans are improved at the beliefs where the last step found each to be the best
    (`point_based`), because an exact step costs many times as much. At the time limit or after Ctrl-C, the
    result is the best policy so far.

    Args:
        pomdp: the problem. The number of vectors limits the method: it may explode with a dozen states and
            observations.
        start: (S,) belief of the reported bounds, or (N, S) several; the model's own when None. The policy is
            as good at all beliefs.
        precision: stop when upper - lower is at most this, in reward units, at every belief.
        time_limit: wall-clock seconds.
        callback: called after each step.

    Returns:
        The policy, both bounds, the seconds used and why the search stopped; `trials` counts the steps,
        `beliefs` the beliefs of point-based improvement.

    Raises:
        ModelError: `start` is not a distribution over the states, precision or limit are not positive, or
            the problem is too large for memory.

    Source: Cassandra, Littman and Zhang, UAI 1997.
    """
    check_limits(precision, time_limit)
    search = _Iteration(pomdp, check_starts(pomdp, start), precision, monotonic() + time_limit)
    try:
        reason = search.run(callback)
    except KeyboardInterrupt:
        reason = "interrupted"
    except DeadlineExceeded:
        reason = "time limit"
    return search.solution(reason)


class _Iteration:
    """The state of value iteration.

    plans: of the last step. sure: plans whose promise is proven. upper: the best upper bound.
    beliefs: of point-based improvement. done: number of steps.
    """

    def __init__(self, pomdp: Pomdp, starts: Array, precision: float, deadline: float) -> None:
        self.began, self.deadline = monotonic(), deadline
        self.pomdp, self.starts, self.precision = pomdp, starts, precision
        self.model = DenseModel(pomdp)
        self.plans = self.sure = Plans(self.model.evaluate_blind(), np.arange(self.model.actions))
        self.beliefs = np.concatenate([starts, np.eye(self.model.states)])
        # no policy earns more than the largest reward in every step
        largest = float(pomdp.reward.max()) / (1 - pomdp.discount)
        self.upper = ShiftedBound(np.full((1, self.model.states), largest), 0.0)
        self.done = 0
        self.history: list[tuple[float, float, float, int]] = []
        self._measure()

    def run(self, callback: Callable[[Progress], None] | None) -> str:
        """Step until a reason to stop; the reason."""
        # the change of a step that is small enough to stop
        target, prunings = self.precision * (1 - self.model.discount), self.model.max_prunings + 1
        rise, loss_share = float(np.ptp(self.pomdp.reward)), INITIAL_LOSS_SHARE
        while True:
            loss = max(LOSS_SHARE * target, loss_share * rise) / prunings
            self._improve(GAIN_SHARE * max(target, rise), loss)
            before, (rise, gap) = rise, self._step(loss, GAIN_SHARE * target)
            if rise > 0.5 * before:
                loss_share *= 0.5  # pruning loses too much for the steps to converge
            _, low, high = self._measure()
            if callback is not None:
                vectors, beliefs = len(self.sure.actions), len(self.beliefs)
                callback(Progress(self.history[-1][0], low, high, vectors, beliefs, self.done))
            if gap <= self.precision:
                return "precision reached"

    def _improve(self, gain: float, loss: float) -> None:
        """Improve the plans at the beliefs, and keep the old plans that are best at other beliefs."""
        better, closed = improve(self.model, self.plans, self.beliefs, gain=gain, deadline=self.deadline)
        if closed is not None:
            self._keep(closed)
        # without the old plans, the gains of exact steps between the beliefs would be lost
        vectors = np.concatenate([better.vectors, self.plans.vectors])
        actions = np.concatenate([better.actions, self.plans.actions])
        rows = prune(vectors, self.beliefs, tolerance=loss, deadline=self.deadline).rows
        self.plans = Plans(vectors[rows], actions[rows])

    def _step(self, loss: float, tolerance: float) -> tuple[float, float]:
        """Run one exact step; return how far it raised the value, and the gap that it proves at all
        beliefs."""
        model, old, deadline = self.model, self.plans, self.deadline
        share = model.discount / (1 - model.discount)
        after = model.backup(old.vectors, self.beliefs, tolerance=loss, deadline=deadline)
        new, beliefs = Plans(after.vectors, after.actions), np.concatenate([self.starts, after.witnesses])
        rise = excess(new.vectors, old.vectors, beliefs, tolerance=tolerance, deadline=deadline)
        upper = ShiftedBound(new.vectors, after.loss + share * (rise + after.loss))
        # a new plan continues with old plans; the best new plan instead loses at most the fall per step
        fall = excess(old.vectors, new.vectors, self.beliefs, tolerance=tolerance, deadline=deadline)
        sure, gap = Plans(new.vectors - share * fall, new.actions), upper.shift + share * fall
        if gap <= self.precision or self._bounds(upper)[2] <= self._bounds(self.upper)[2]:
            self.upper = upper
        if gap <= self.precision:
            self.sure = sure
        else:
            self._keep(sure)
        self.plans, self.beliefs, self.done = new, beliefs, self.done + 1
        return rise, gap

    def _keep(self, plans: Plans) -> None:
        """Keep plans whose promise is proven if they promise more than the earlier ones."""
        if self._values(plans).sum() > self._values(self.sure).sum():
            self.sure = plans

    def _values(self, plans: Plans) -> Array:
        return np.asarray((self.starts @ plans.vectors.T).max(axis=1))

    def _bounds(self, upper: ShiftedBound) -> tuple[int, float, float]:
        """The start with the widest gap, and its bounds."""
        low = self._values(self.sure)
        high = (self.starts @ upper.vectors.T).max(axis=1) + upper.shift
        widest = int((high - low).argmax())
        return widest, float(low[widest]), max(float(low[widest]), float(high[widest]))

    def _measure(self) -> tuple[int, float, float]:
        widest, low, high = self._bounds(self.upper)
        self.history.append((monotonic() - self.began, low, high, len(self.sure.actions)))
        return widest, low, high

    def solution(self, reason: str) -> Solution:
        """The result so far."""
        widest, low, high = self._measure()
        alphas = AlphaVectors(np.arange(self.model.states), *self.sure)
        return Solution(
            pomdp=self.pomdp,
            policy=Policy.of_sets(self.pomdp, [alphas], self.upper),
            lower=low,
            upper=high,
            seconds=monotonic() - self.began,
            reason=reason,
            history=tuple(self.history[:-1]),
            beliefs=len(self.beliefs),
            trials=self.done,
            start=self.starts[widest],
        )
