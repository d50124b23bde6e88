"""Exact value iteration by incremental pruning, for small problems: the value at every belief.

An exact step backs up the value function at all beliefs (`incremental_pruning`). It is expensive, so between
two of them `point_based` improves the value function at the witnesses of the last step: beliefs where one of
its vectors was the best.

Sources: Cassandra, Littman and Zhang, UAI 1997; Zhang and Zhang, JAIR 2001, for the point-based steps.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from lcorpp.planning.any_discount import accept_undiscounted
from lcorpp.planning.arguments import check_solver_arguments
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solution import BoundsRecord, Progress, Solution
from lcorpp.planning.solvers.exact.dominance_lp import DeadlineExceeded
from lcorpp.planning.solvers.exact.dynamic_programming import DenseModel
from lcorpp.planning.solvers.exact.incremental_pruning import back_up, max_prunings
from lcorpp.planning.solvers.exact.point_based import Plans, improve
from lcorpp.planning.solvers.exact.pruning import excess, prune
from lcorpp.planning.upper_bounds import PiecewiseLinearBound
from lcorpp.values import Array

MAX_LOSS_SHARE = 0.2
"""Largest loss of a step by pruning, as a share of the rise that proves the precision."""

MAX_EARLY_LOSS_SHARE = 0.05
"""Largest loss of a step by pruning, as a share of the rise in the step before, if that is larger."""

MAX_RISE_RATIO = 0.5
"""If the value rises by more than this share of the rise in the step before, pruning loses too much."""

MIN_GAIN_SHARE = 0.01
"""Point-based improvement stops if a round gains no more than this share of the rise in the last step."""


@accept_undiscounted
def solve_exact(
    pomdp: Pomdp,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 1e-3,
    time_limit: float = 60.0,
    callback: Callable[[Progress], None] | None = None,
) -> Solution:
    """Find the value of every belief to a precision, by value iteration with incremental pruning.

    Let an exact step with pruning raise the value by at most `rise` at any belief, lower it by at most `fall`
    and lose at most `loss` by pruning. Then the optimal value is at most loss + (rise + loss) gamma /
    (1 - gamma) above the vectors after the step, and these vectors, lowered by fall gamma / (1 - gamma), are
    lower bounds on the value of the policy. Linear programs prove rise, fall and loss (`dominance_lp`) up to
    the rounding of doubles.

    At the time limit or after Ctrl-C, the result is the best policy so far.

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
    starts = check_solver_arguments(pomdp, start, precision, time_limit, callback)
    search = _ValueIteration(pomdp, starts, precision, time_limit)
    try:
        with threadpool_limits(1):  # small matrices and programs: threads would only wait for each other
            reason = search.run(callback)
    except KeyboardInterrupt:
        reason = "interrupted"
    except DeadlineExceeded:
        reason = "time limit"
    return search.make_solution(reason)


class _ValueIteration:
    """The state of value iteration.

    plans: the value function: alpha vectors, which are the values of plans, and the plans' first actions.
    lower: plans whose vectors are proven lower bounds on the value of their policy.
    upper: proven upper bound on the optimal value.
    witnesses: (n, S) the starts, and a belief for each plan of the last exact step where it was the best.
    n_steps: number of exact steps. record: of the bounds at the starts.
    """

    def __init__(self, pomdp: Pomdp, starts: Array, precision: float, time_limit: float) -> None:
        began = monotonic()
        self.pomdp, self.starts, self.precision, self.deadline = pomdp, starts, precision, began + time_limit
        self.model = DenseModel(pomdp)
        self.plans = self.lower = Plans(self.model.evaluate_blind(), np.arange(self.model.actions))
        # no policy earns more than the largest reward in every step
        largest = float(pomdp.reward.max()) / (1 - pomdp.discount)
        self.upper = PiecewiseLinearBound(np.full((1, self.model.states), largest))
        self.witnesses = np.concatenate([starts, np.eye(self.model.states)])
        self.n_steps, self.record = 0, BoundsRecord(pomdp, starts, began)
        self._update_record()

    def run(self, callback: Callable[[Progress], None] | None) -> str:
        """Alternate point-based improvement and exact steps; return the reason to stop."""
        target = self.precision * (1 - self.model.discount)  # the rise of a step that proves the precision
        rise = float(np.ptp(self.pomdp.reward))  # of the last step; at first a guess of its size
        n_prunings = max_prunings(self.model) + 1  # of a step and of the improvement before it
        loss_share = MAX_EARLY_LOSS_SHARE
        while True:
            loss = max(MAX_LOSS_SHARE * target, loss_share * rise) / n_prunings
            self._improve_at_witnesses(MIN_GAIN_SHARE * max(target, rise), loss)
            previous_rise = rise
            rise, gap = self._step(loss, MIN_GAIN_SHARE * target)
            if rise > MAX_RISE_RATIO * previous_rise:
                loss_share /= 2
            self._update_record()
            if callback is not None:
                vectors, beliefs = len(self.lower.actions), len(self.witnesses)
                callback(self.record.make_progress(vectors=vectors, beliefs=beliefs, trials=self.n_steps))
            if gap <= self.precision:
                return "precision reached"

    def _improve_at_witnesses(self, gain: float, loss: float) -> None:
        """Improve the plans at the witnesses, and keep the old plans that are the best at other beliefs.

        Args:
            gain: the improvement ends with a round that gains no more, in reward units.
            loss: largest loss by pruning, in reward units.
        """
        old, deadline = self.plans, self.deadline
        # closed plans continue with each other only, so their vectors are proven lower bounds
        better, closed = improve(self.model, old, self.witnesses, gain=gain, deadline=deadline)
        if closed is not None:
            self._raise_lower_bound(closed)
        vectors = np.concatenate([better.vectors, old.vectors])
        actions = np.concatenate([better.actions, old.actions])
        rows = prune(vectors, self.witnesses, tolerance=loss, deadline=deadline).rows
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
        old, deadline = self.plans, self.deadline
        after = back_up(self.model, old.vectors, self.witnesses, tolerance=loss, deadline=deadline)
        new, witnesses = Plans(after.vectors, after.actions), np.concatenate([self.starts, after.witnesses])
        rise = excess(new.vectors, old.vectors, witnesses, tolerance=tolerance, deadline=deadline)
        fall = excess(old.vectors, new.vectors, self.witnesses, tolerance=tolerance, deadline=deadline)
        tail_factor = self.model.discount / (1 - self.model.discount)  # the sum of gamma^t over t = 1, 2, ...
        upper = PiecewiseLinearBound(new.vectors, after.loss + tail_factor * (rise + after.loss))
        # a new plan continues with old plans, but the policy continues with the best new plan, which is worth
        # less than the old plan by at most the fall: the policy loses this in each later step
        lower = Plans(new.vectors - tail_factor * fall, new.actions)
        gap = upper.shift + tail_factor * fall
        if gap <= self.precision:  # at all beliefs, by the two bounds of this step
            self.lower, self.upper = lower, upper
        else:
            if self._value_at_widest_gap(upper) <= self._value_at_widest_gap(self.upper):
                self.upper = upper
            self._raise_lower_bound(lower)
        self.plans, self.witnesses, self.n_steps = new, witnesses, self.n_steps + 1
        return rise, gap

    def _raise_lower_bound(self, plans: Plans) -> None:
        """Replace `lower` by other proven plans if the sum of their values at the starts is larger."""
        if self._best_values(plans.vectors).sum() > self._best_values(self.lower.vectors).sum():
            self.lower = plans

    def _best_values(self, vectors: Array) -> Array:
        """Return (N,) the value of the best vector at each start."""
        return np.asarray((self.starts @ vectors.T).max(axis=1))

    def _value_at_widest_gap(self, upper: PiecewiseLinearBound) -> float:
        """Return the value of an upper bound at the start where its gap to the lower bound is the widest."""
        low, high = self._best_values(self.lower.vectors), self._best_values(upper.vectors) + upper.shift
        widest = int((high - low).argmax())
        return max(float(low[widest]), float(high[widest]))

    def _update_record(self) -> None:
        low, high = self._best_values(self.lower.vectors), self._best_values(self.upper.vectors)
        self.record.update(low.tolist(), (high + self.upper.shift).tolist(), len(self.lower.actions))

    def make_solution(self, reason: str) -> Solution:
        """Return the result so far."""
        self._update_record()
        alphas = AlphaVectors(np.arange(self.model.states), self.lower.vectors, self.lower.actions)
        policy = Policy.of_sets(self.pomdp, [alphas], self.upper)
        return self.record.make_solution(policy, reason, beliefs=len(self.witnesses), trials=self.n_steps)
