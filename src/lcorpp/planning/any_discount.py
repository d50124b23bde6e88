"""Solvers for discounts below 1 as solvers for any discount."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import wraps
from inspect import signature
from math import inf
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from lcorpp.planning.arguments import check_beliefs, check_solver_arguments
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solution import Progress, Solution

_Solver = TypeVar("_Solver", bound=Callable[..., Solution])


def accept_undiscounted(solver: _Solver) -> _Solver:
    """Decorate a solver for discounts below 1: it solves problems with discount 1 as discounted ones."""

    default: float = signature(solver).parameters["precision"].default

    @wraps(solver)
    def solve(pomdp: Pomdp, start: npt.ArrayLike | None = None, **options: Any) -> Solution:
        if not isinstance(pomdp, Pomdp) or pomdp.discount < 1:
            return solver(pomdp, start, **options)
        precision, time_limit = options.get("precision", default), options.get("time_limit", inf)
        callback = options.get("callback")
        starts = check_solver_arguments(pomdp, start, precision, time_limit, callback)
        from lcorpp.planning.undiscounted import DiscountedForm  # few problems need it

        form = DiscountedForm.of(pomdp)
        beliefs = starts
        if options.get("mixed") is not None:
            mixed = check_beliefs(pomdp, options["mixed"], "mixed")
            options["mixed"], beliefs = form.convert_beliefs(mixed), np.concatenate([starts, mixed])
        scale = float(form.scale(beliefs).max())
        options["precision"] = precision / scale
        if callback is not None:
            options["callback"] = lambda now: callback(_scale_progress(now, scale))
        previous = options.get("previous")
        if isinstance(previous, Solution) and previous.policy.fingerprint == pomdp.fingerprint:
            options["previous"] = replace(previous, policy=form.convert_policy(previous.policy))
        return form.restore_solution(solver(form.pomdp, form.convert_beliefs(starts), **options))

    return solve  # type: ignore[return-value]


def _scale_progress(now: Progress, scale: float) -> Progress:
    return replace(now, lower=scale * now.lower, upper=scale * now.upper)
