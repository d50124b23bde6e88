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

MAX_LOSS_SHARE = 0.2
"""Largest loss of a step by pruning, as a share of the rise at which value iteration may stop."""

MAX_INITIAL_LOSS_SHARE = 0.05
"""Largest loss of an early step by pruning, as a share of the rise in the step before."""

MIN_GAIN_SHARE = 0.01
"""Point-based improvement stops if a round gains no more than this share of the rise in the last step."""


@dataclass(frozen=True, eq=False, repr=False)
class ShiftedBound:
    """The upper bound max over v of v.b + shift of vectors (K, S): `lcorpp.planning.policy.UpperBound`."""

    vectors: Array
    shift: float

    def __repr__(self) -> str:
        return f"<ShiftedBound: {len(self.vectors)} vectors + {self.shift:.3g}>"

    def value(self, belief: Belief) -> float:
        """Return the bound at a belief (S,)."""
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

    A step is an exact backup. Let it raise the value by at most d at any belief, lower it by at most f, and
    lose at most e by pruning. Then the optimal value is at most e + (d + e) gamma / (1 - gamma) above the
    vectors after the step, and these vectors, lowered by f gamma / (1 - gamma), are lower bounds on the
    value of the policy. The bounds d, e and f are proven (`dominance_lp`) up to the rounding of doubles.

    Between two steps, `point_based` improves the plans at the beliefs where the last step found one of them
    to be the best, because an exact step costs many times as much. At the time limit or after Ctrl-C, the
    result is the best policy so far.

    Args:
        pomdp: the problem. The number of vectors limits the method: it may explode with a dozen states and
            observations.
        start: (S,) belief of the reported bounds, or (N, S) several; the model's own when None. The precision
            applies to all beliefs.
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
    search = _ValueIteration(pomdp, check_starts(pomdp, start), precision, monotonic() + time_limit)
    try:
        reason = search.run(callback)
    except KeyboardInterrupt:
        reason = "interrupted"
    except DeadlineExceeded:
        reason = "time limit"
    return search.make_solution(reason)


class _ValueIteration:
    """The state of value iteration.

    plans: of the last step. proven_plans: plans whose vectors are proven lower bounds on the policy's value.
    upper: the best upper bound. beliefs: (n, S) of point-based improvement. n_steps: number of exact steps.
    history: of the bounds, as in `Solution`.
    """

    def __init__(self, pomdp: Pomdp, starts: Array, precision: float, deadline: float) -> None:
        self.began, self.deadline = monotonic(), deadline
        self.pomdp, self.starts, self.precision = pomdp, starts, precision
        self.model = DenseModel(pomdp)
        self.plans = self.proven_plans = Plans(self.model.evaluate_blind(), np.arange(self.model.actions))
        self.beliefs = np.concatenate([starts, np.eye(self.model.states)])
        # no policy earns more than the largest reward in every step
        largest = float(pomdp.reward.max()) / (1 - pomdp.discount)
        self.upper = ShiftedBound(np.full((1, self.model.states), largest), 0.0)
        self.n_steps = 0
        self.history: list[tuple[float, float, float, int]] = []
        self._record_bounds()

    def run(self, callback: Callable[[Progress], None] | None) -> str:
        """Iterate until the precision is reached; return the reason to stop."""
        # `target`: the rise of a step that proves the precision; `n_prunings`: of a step, each with its loss
        target, n_prunings = self.precision * (1 - self.model.discount), self.model.max_prunings + 1
        rise, loss_share = float(np.ptp(self.pomdp.reward)), MAX_INITIAL_LOSS_SHARE
        while True:
            loss = max(MAX_LOSS_SHARE * target, loss_share * rise) / n_prunings
            self._improve(MIN_GAIN_SHARE * max(target, rise), loss)
            before, (rise, gap) = rise, self._step(loss, MIN_GAIN_SHARE * target)
            if rise > 0.5 * before:
                loss_share *= 0.5  # pruning loses too much for the steps to converge
            _, low, high = self._record_bounds()
            if callback is not None:
                vectors, beliefs = len(self.proven_plans.actions), len(self.beliefs)
                callback(Progress(self.history[-1][0], low, high, vectors, beliefs, self.n_steps))
            if gap <= self.precision:
                return "precision reached"

    def _improve(self, gain: float, loss: float) -> None:
        """Improve the plans at `beliefs`, and keep the old plans that are best at other beliefs.

        Args:
            gain: a round of improvement that gains no more, in reward units, is the last.
            loss: largest loss by pruning, in reward units.
        """
        # `closed` are plans that continue with each other only: their vectors are proven lower bounds
        better, closed = improve(self.model, self.plans, self.beliefs, gain=gain, deadline=self.deadline)
        if closed is not None:
            self._raise_lower_bound(closed)
        # the old plans keep what exact steps gained at other beliefs
        vectors = np.concatenate([better.vectors, self.plans.vectors])
        actions = np.concatenate([better.actions, self.plans.actions])
        rows = prune(vectors, self.beliefs, tolerance=loss, deadline=self.deadline).rows
        self.plans = Plans(vectors[rows], actions[rows])

    def _step(self, loss: float, tolerance: float) -> tuple[float, float]:
        """Run one exact step.

        Args:
            loss: largest loss of each pruning, in reward units.
            tolerance: of the computed rise and fall of the value, in reward units.

        Returns:
            The largest rise of the value at any belief, and the largest gap between the bounds that the step
            proves for all beliefs.
        """
        model, old, deadline = self.model, self.plans, self.deadline
        tail_factor = model.discount / (1 - model.discount)  # the sum of gamma^t over t = 1, 2, ...
        after = model.backup(old.vectors, self.beliefs, tolerance=loss, deadline=deadline)
        new, beliefs = Plans(after.vectors, after.actions), np.concatenate([self.starts, after.witnesses])
        rise = excess(new.vectors, old.vectors, beliefs, tolerance=tolerance, deadline=deadline)
        upper = ShiftedBound(new.vectors, after.loss + tail_factor * (rise + after.loss))
        # a new plan continues with old plans, but the policy continues with the best new plan, which is worth
        # less than the old plan by at most the fall: the policy loses this in each later step
        fall = excess(old.vectors, new.vectors, self.beliefs, tolerance=tolerance, deadline=deadline)
        proven = Plans(new.vectors - tail_factor * fall, new.actions)
        gap = upper.shift + tail_factor * fall
        if gap <= self.precision or self._find_widest_gap(upper)[2] <= self._find_widest_gap(self.upper)[2]:
            self.upper = upper
        if gap <= self.precision:
            self.proven_plans = proven
        else:
            self._raise_lower_bound(proven)
        self.plans, self.beliefs, self.n_steps = new, beliefs, self.n_steps + 1
        return rise, gap

    def _raise_lower_bound(self, plans: Plans) -> None:
        """Replace `proven_plans` by other proven plans if the sum of their values at the starts is larger."""
        if self._compute_values(plans).sum() > self._compute_values(self.proven_plans).sum():
            self.proven_plans = plans

    def _compute_values(self, plans: Plans) -> Array:
        """Return (N,) the value of the best plan at each start."""
        return np.asarray((self.starts @ plans.vectors.T).max(axis=1))

    def _find_widest_gap(self, upper: ShiftedBound) -> tuple[int, float, float]:
        """Return the index of the start with the widest gap, and its bounds."""
        low = self._compute_values(self.proven_plans)
        high = (self.starts @ upper.vectors.T).max(axis=1) + upper.shift
        widest = int((high - low).argmax())
        return widest, float(low[widest]), max(float(low[widest]), float(high[widest]))

    def _record_bounds(self) -> tuple[int, float, float]:
        """Append the bounds to the history; return them as `_find_widest_gap`."""
        widest, low, high = self._find_widest_gap(self.upper)
        self.history.append((monotonic() - self.began, low, high, len(self.proven_plans.actions)))
        return widest, low, high

    def make_solution(self, reason: str) -> Solution:
        """Return the result so far."""
        widest, low, high = self._record_bounds()
        alphas = AlphaVectors(np.arange(self.model.states), *self.proven_plans)
        return Solution(
            pomdp=self.pomdp,
            policy=Policy.of_sets(self.pomdp, [alphas], self.upper),
            lower=low,
            upper=high,
            seconds=monotonic() - self.began,
            reason=reason,
            history=tuple(self.history[:-1]),
            beliefs=len(self.beliefs),
            trials=self.n_steps,
            start=self.starts[widest],
        )
