"""Checks of the arguments that solvers share."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.belief import check_belief
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array


def check_limits(precision: float, time_limit: float) -> None:
    """Reject a precision or a time limit that is not positive.

    Raises:
        ModelError: one of them is not positive.
    """
    if not precision > 0 or not time_limit > 0:
        raise ModelError(f"precision {precision} and time limit {time_limit} must be positive")


def check_starts(pomdp: Pomdp, start: npt.ArrayLike | None) -> Array:
    """Return the start beliefs (N, S): the model's own for None, one (S,) or several (N, S).

    Raises:
        ModelError: a belief is not a distribution over the states, or there is none.
    """
    beliefs = np.atleast_2d(np.asarray(pomdp.start if start is None else start))
    if not len(beliefs):
        raise ModelError("there is no start belief")
    return np.array([check_belief(pomdp, belief) for belief in beliefs])


def check_count(name: str, number: object, minimum: int) -> int:
    """Return an argument that is an integer of at least `minimum`.

    Raises:
        ModelError: it is not; the message names it.
    """
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < minimum:
        raise ModelError(f"{name} must be an integer of at least {minimum}, not {number!r}")
    return int(number)


def check_discount(pomdp: Pomdp, discount: float | None) -> float:
    """Return the discount of a finite horizon, the model's own for None.

    Raises:
        ModelError: it is not above 0 and at most 1.
    """
    if discount is None:
        return pomdp.discount
    if not 0 < discount <= 1:
        raise ModelError(f"the discount of a finite horizon must be above 0 and at most 1, not {discount}")
    return float(discount)
