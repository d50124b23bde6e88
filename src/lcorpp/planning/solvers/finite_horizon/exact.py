"""Exact finite-horizon solution at every belief, by incremental pruning.

Source: Cassandra, Littman and Zhang, Incremental pruning, UAI 1997.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.planning.arguments import check_count, check_discount, check_solver_arguments
from lcorpp.planning.policy import AlphaVectors
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solution import Progress
from lcorpp.planning.solvers.exact.dominance_lp import DeadlineExceeded
from lcorpp.planning.solvers.exact.dynamic_programming import DenseModel
from lcorpp.planning.solvers.exact.incremental_pruning import Backup, back_up, max_prunings
from lcorpp.planning.solvers.finite_horizon.solution import FiniteHorizonSolution, make_finite_policy
from lcorpp.planning.upper_bounds import PiecewiseLinearBound
from lcorpp.values import Array


def solve_finite_horizon_exact(
    pomdp: Pomdp,
    horizon: int,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 1e-6,
    time_limit: float = 60.0,
    callback: Callable[[Progress], None] | None = None,
    discount: float | None = None,
) -> FiniteHorizonSolution:
    """Find the policies for every belief and every number of remaining steps up to a horizon.

    All vectors are values of plans that continue with those of one step less, so every policy earns what it
    promises. The losses of pruning are proven (`dominance_lp`) and added to the upper bounds. At the time
    limit or after Ctrl-C, the result has fewer steps than requested.

    Args:
        pomdp: the problem. The number of vectors limits the method.
        horizon: the number of steps, at least 1.
        start: (S,) belief of the reported bounds, or (N, S) several; the model's own when None. The policies
            are as good at all beliefs.
        precision: largest loss by pruning at any belief, in reward units.
        time_limit: wall-clock seconds.
        callback: called after each step; `trials` is the number of steps.
        discount: from 0 to 1 (the undiscounted sum of rewards); the model's own when None.

    Returns:
        The policy for every number of remaining steps, bounds for the largest number, the seconds used and
        why the computation stopped: "precision reached", "time limit" or "interrupted".

    Raises:
        ModelError: `start` is not a distribution over the states, a number is out of range, or the problem is
            too large for memory.

    Source: Cassandra, Littman and Zhang, UAI 1997.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import solve_finite_horizon_exact
        >>> pomdp = load_domain("intention").pomdp
        >>> round(solve_finite_horizon_exact(pomdp, 2).lower, 3)  # -4 + 0.99 (0.9 - 0.1) 80
        59.36
    """
    starts = check_solver_arguments(pomdp, start, precision, time_limit, callback)
    horizon = check_count("horizon", horizon, 1)
    factor = check_discount(pomdp, discount)
    began = monotonic()
    search = _FiniteValueIteration(pomdp, starts, factor, began)
    try:
        reason = search.run(horizon, precision, began + time_limit, callback)
    except KeyboardInterrupt:
        reason = "interrupted"
    except DeadlineExceeded:
        reason = "time limit"
    return search.make_solution(reason)


class _FiniteValueIteration:
    """The value functions for 1, 2, ... remaining steps.

    backups: their alpha vectors; `loss` is that of all prunings so far.
    """

    def __init__(self, pomdp: Pomdp, starts: Array, discount: float, began: float) -> None:
        self.pomdp, self.starts, self.began = pomdp, starts, began
        self.model = DenseModel(pomdp, discount)
        self.history: list[tuple[float, float, float, int]] = []
        # with one remaining step, the value of an action is its reward
        self.backups = [Backup(pomdp.reward, np.arange(self.model.actions), starts, 0.0)]

    def run(
        self, horizon: int, precision: float, deadline: float, callback: Callable[[Progress], None] | None
    ) -> str:
        """Compute one value function after the other up to the horizon; return the reason to stop."""
        model = self.model
        weight = float((model.discount ** np.arange(horizon)).sum())
        tolerance = precision / (weight * (max_prunings(model) + 1))
        self._report(callback)
        while len(self.backups) < horizon:
            last = self.backups[-1]
            after = back_up(model, last.vectors, last.witnesses, tolerance=tolerance, deadline=deadline)
            witnesses = np.concatenate([self.starts, after.witnesses])
            loss = after.loss + model.discount * last.loss
            self.backups.append(after._replace(witnesses=witnesses, loss=loss))
            self._report(callback)
        return "precision reached"

    def _report(self, callback: Callable[[Progress], None] | None) -> None:
        last = self.backups[-1]
        low = float((self.starts @ last.vectors.T).max(axis=1)[0])
        self.history.append((monotonic() - self.began, low, low + last.loss, len(last.actions)))
        if callback is not None:
            callback(Progress(*self.history[-1], len(last.witnesses), len(self.backups)))

    def make_solution(self, reason: str) -> FiniteHorizonSolution:
        """Return the result for the steps so far."""
        policies = []
        for remaining, (vectors, actions, _, loss) in enumerate(self.backups, 1):
            alphas = AlphaVectors(np.arange(self.model.states), vectors, actions)
            upper = PiecewiseLinearBound(vectors, loss)
            policies.append(make_finite_policy(self.pomdp, [alphas], remaining, self.model.discount, upper))
        low = policies[-1].value(self.starts[0])  # the gap is the loss at every start
        return FiniteHorizonSolution(
            policies=tuple(policies),
            lower=low,
            upper=low + self.backups[-1].loss,
            seconds=monotonic() - self.began,
            reason=reason,
            history=tuple(self.history),
            start_count=len(self.starts),
        )
