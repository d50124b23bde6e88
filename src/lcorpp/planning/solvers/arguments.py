"""What the solvers ask of their arguments."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.belief import check_belief
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array


def checked_limits(precision: float, time_limit: float) -> None:
    """Refuse a precision or a time limit that is not positive.

    Raises:
        ModelError: one is not.
    """
    if not precision > 0 or not time_limit > 0:
        raise ModelError(f"precision {precision} and time limit {time_limit} must be positive")


def checked_starts(pomdp: Pomdp, start: npt.ArrayLike | None) -> Array:
    """(N, S) the beliefs to start from: the model's own for None, one (S,) or several (N, S).

    Raises:
        ModelError: one is not a distribution over the states.
    """
    given = np.atleast_2d(np.asarray(pomdp.start if start is None else start))
    if not len(given):
        raise ModelError("there is no start belief")
    return np.array([check_belief(pomdp, belief) for belief in given])


def checked_count(name: str, number: object, least: int) -> int:
    """A whole number that is not below `least`.

    Raises:
        ModelError: it is not; it is named.
    """
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < least:
        raise ModelError(f"{name} is a whole number from {least}, not {number!r}")
    return int(number)


def checked_discount(pomdp: Pomdp, discount: float | None) -> float:
    """The factor asked for, the model's own when None.

    Raises:
        ModelError: it is not above 0 and at most 1.
    """
    if discount is None:
        return pomdp.discount
    if not 0 < discount <= 1:
        raise ModelError(f"discount {discount} of a finite number of steps is not above 0 and at most 1")
    return float(discount)
