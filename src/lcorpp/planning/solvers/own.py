"""A solver in the user's file: `FILE.py:NAME`, with the signature of all solvers."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import replace
from math import isfinite
from time import monotonic

import numpy.typing as npt

from lcorpp.errors import ModelError, PolicyError
from lcorpp.planning.arguments import check_discounted, check_solver_arguments
from lcorpp.planning.policy import Policy, check_same_model
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solution import CONVERGED, BoundsRecord, Progress, Solution
from lcorpp.planning.solvers.table_policy import compute_informed_bound
from lcorpp.planning.upper_bounds import PiecewiseLinearBound
from lcorpp.user_code import UserFunction
from lcorpp.values import Array

BOUND_SHARE = 0.1
"""Share of the time limit for each of the two bounds against which the result is checked."""

TOLERANCE = 1e-6
"""Rounding error of a claimed value, relative to the largest one."""


class OwnSolver:
    """The user's function ``NAME(pomdp, start, *, precision, time_limit, callback)``.

    `start` is an array (N, S) of beliefs; the other arguments are those of `solve`. The function returns a
    `Solution`, or only a `Policy`: its vectors are then the lower bound, as those of every policy, and the
    fast informed bound is the upper one.

    Raises:
        ModelError: the function has other parameters.
    """

    def __init__(self, function: UserFunction) -> None:
        self.function = function
        keywords = dict.fromkeys(["precision", "time_limit", "callback"])
        try:
            signature = inspect.signature(function.function)
            signature.bind(None, None, **keywords)
        except TypeError as mismatch:
            raise ModelError(
                f"{function.location}: {function.name}{signature} cannot be called as a solver ({mismatch});"
                f" expected {function.name}(pomdp, start, *, precision, time_limit, callback)"
            ) from None
        except ValueError:
            pass  # a function without a signature

    def __call__(
        self,
        pomdp: Pomdp,
        start: npt.ArrayLike | None = None,
        *,
        precision: float = 5e-4,
        time_limit: float = 60.0,
        callback: Callable[[Progress], None] | None = None,
    ) -> Solution:
        """Call the function and check its result.

        Raises:
            ModelError: an argument is wrong; or the function fails, returns no policy for `pomdp`, or
                claims a value that no policy has.
        """
        starts = check_solver_arguments(pomdp, start, precision, time_limit, callback)
        check_discounted(pomdp)
        began = monotonic()
        result = self.function(pomdp, starts, precision=precision, time_limit=time_limit, callback=callback)
        if not isinstance(result, Solution | Policy):
            raise self._make_error(f"a {type(result).__name__}; expected a Solution or a Policy")
        policy = result if isinstance(result, Policy) else result.policy
        try:
            check_same_model(pomdp, policy)
        except PolicyError as error:
            raise self._make_error(f"a policy of another problem: {error}") from None
        table = compute_informed_bound(pomdp, precision, BOUND_SHARE * time_limit)
        self._check_values(policy, starts, table)
        if policy.upper_bound is None:
            policy = replace(policy, upper_bound=PiecewiseLinearBound(table))
        if isinstance(result, Solution):
            self._check_bounds(result, precision)
            return replace(result, pomdp=pomdp, policy=policy)
        record = BoundsRecord(pomdp, starts, began)
        lower = [policy.value(belief) for belief in starts]
        upper = [low + policy.gap(belief) for low, belief in zip(lower, starts, strict=True)]
        record.update(lower, upper, len(policy))
        reason = CONVERGED if record.upper - record.lower <= precision else "own solver ended"
        return record.make_solution(policy, reason, beliefs=len(starts), trials=0)

    def _check_values(self, policy: Policy, starts: Array, table: Array) -> None:
        """Reject vectors that promise more than any policy earns, by a table of upper bounds (A, S)."""
        for belief in starts:
            claimed, highest = policy.value(belief), float((table @ belief).max())
            if claimed > highest + TOLERANCE * max(1.0, abs(highest)):
                raise self._make_error(
                    f"a policy whose vectors promise {claimed:.6g} at a start belief, where no policy earns"
                    f" more than {highest:.6g}"
                )

    def _check_bounds(self, solution: Solution, precision: float) -> None:
        """Reject bounds that are not numbers, cross, or have not converged as the reason states."""
        lower, upper = solution.lower, solution.upper
        if not (isfinite(lower) and isfinite(upper) and lower <= upper):
            raise self._make_error(f"the bounds {lower} and {upper}; expected lower <= upper")
        if solution.converged and upper - lower > precision:
            raise self._make_error(f"{CONVERGED!r} with a gap of {upper - lower:.6g}, above {precision:g}")

    def _make_error(self, what: str) -> ModelError:
        return ModelError(f"{self.function.location}: {self.function.name}() returned {what}")
