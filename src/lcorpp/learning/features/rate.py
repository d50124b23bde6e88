"""The rate at which the points of a track follow."""

from __future__ import annotations

from lcorpp.arguments import check_value
from lcorpp.errors import DataError

RATE = 3.0
"""The rate of the paper's classifier, points per second."""

MAX_RATE = 1000.0
"""The highest rate, points per second."""


def check_rate(rate: float) -> None:
    """Raise DataError unless `rate` is above 0 and at most `MAX_RATE`."""
    check_value(rate, float, "the rate")
    if not 0 < rate <= MAX_RATE:
        raise DataError(f"a rate of {rate} points per second; expected one above 0 and up to {MAX_RATE:g}")
