"""Checks of the arguments that public functions share: types first, then ranges."""

from __future__ import annotations

from math import inf
from numbers import Real
from reprlib import repr as shorten

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.belief import check_belief
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array

MEMORY_LIMIT = 1e9
"""Default memory limit of a search, and of the check of its result, in bytes."""


def check_type(name: str, value: object, *kinds: type) -> None:
    """Raise a ModelError that names an argument unless it has one of some types."""
    if not isinstance(value, kinds):
        expected = " or ".join("number" if kind is Real else kind.__name__ for kind in kinds)
        raise ModelError(f"{name} must be a {expected}, not {shorten(value)} ({type(value).__name__})")


def check_solver_arguments(
    pomdp: Pomdp, start: npt.ArrayLike | None, precision: float, time_limit: float, callback: object = None
) -> Array:
    """Check the arguments that all solvers have; return the start beliefs (N, S).

    Args:
        start: None for the model's own, one belief (S,) or several (N, S).

    Raises:
        ModelError: an argument has a wrong type, a limit is wrong (see `check_limits`), a belief is not a
            distribution over the states, or there is none.
    """
    check_type("pomdp", pomdp, Pomdp)
    check_limits(precision, time_limit)
    if callback is not None and not callable(callback):
        raise ModelError(f"callback must be a function, not {shorten(callback)}")
    return check_beliefs(pomdp, pomdp.start if start is None else start, "start")


def check_beliefs(pomdp: Pomdp, value: npt.ArrayLike, name: str) -> Array:
    """Check one belief (S,) or several (N, S), an argument of this name; return them as (N, S).

    Raises:
        ModelError: one is not a distribution over the states, or there is none.
    """
    try:
        beliefs = np.atleast_2d(np.asarray(value))
    except ValueError:
        raise ModelError(f"{name} must be one belief or several, not {shorten(value)}") from None
    if not len(beliefs):
        raise ModelError(f"there is no {name} belief")
    return np.array([check_belief(pomdp, belief) for belief in beliefs])


def check_limits(precision: float, time_limit: float) -> None:
    """Reject limits of a solver: a precision that is not positive and finite, a time limit not positive."""
    check_positive("precision", precision)
    check_type("time limit", time_limit, Real)
    if not time_limit > 0:
        raise ModelError(f"the time limit is {time_limit}; expected a positive number")


def check_positive(name: str, number: float) -> None:
    """Reject a number that is not positive and finite."""
    check_type(name, number, Real)
    if not 0 < number < inf:
        raise ModelError(f"the {name} is {number}; expected a finite positive number")


def check_discounted(pomdp: Pomdp) -> None:
    """Reject a problem with discount 1, where only discounts below 1 make sense."""
    if pomdp.discount == 1:
        raise ModelError(
            "expected a discount below 1, not 1; with 1, use sarsop, perseus, exact, qmdp or fib if"
            " every policy ends, or a finite horizon"
        )


def check_memory_limit(size: float) -> None:
    """Reject a memory limit that is not positive."""
    check_type("memory limit", size, Real)
    if not size > 0:
        raise ModelError(f"the memory limit is {size}; expected a positive number of bytes")


def check_count(name: str, number: object, minimum: int) -> int:
    """Return an argument that is an integer of at least `minimum`; a ModelError names any other."""
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < minimum:
        raise ModelError(f"{name} must be an integer of at least {minimum}, not {number!r}")
    return int(number)


def check_discount(pomdp: Pomdp, discount: float | None) -> float:
    """Return the discount of a finite horizon, the model's own for None; reject invalid ones."""
    if discount is None:
        return pomdp.discount
    check_type("discount", discount, Real)
    if not 0 <= discount <= 1:
        raise ModelError(f"the discount of a finite horizon must be between 0 and 1, not {discount}")
    return float(discount)
