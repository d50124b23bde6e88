"""Intervals by resampling people: cases of one person are drawn together, as they are not independent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.values import Array

RESAMPLES = 1000
"""Resamples of an interval; its ends move by about .02 of its width with another seed."""


@dataclass(frozen=True)
class Interval:
    """A figure with the ends of its 95 % interval; all NaN where it is not defined."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.3f} [{self.low:.3f}, {self.high:.3f}]"


def resampled(groups: Sequence[str], *, count: int = RESAMPLES, seed: int = 0) -> Array:
    """(count, cases) how often each case is drawn when whole groups are drawn with replacement.

    Args:
        groups: (cases,) whom each case is of.
        seed: of the draws; they say how sure a figure is, so the same serve for every figure.

    Source: Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapter 8.
    """
    names, index = np.unique(np.array(groups), return_inverse=True)
    rng = np.random.default_rng(seed)
    drawn = rng.multinomial(len(names), np.full(len(names), 1 / len(names)), size=count)
    return np.asarray(drawn[:, index], dtype=np.float64)


def percentile_interval(value: float, figures: Array) -> Interval:
    """A figure and the middle 95 % of what it is in the resamples (count,); NaN among them are left out."""
    known = figures[np.isfinite(figures)]
    if not len(known) or not np.isfinite(value):
        return Interval(float("nan"), float("nan"), float("nan"))
    low, high = np.quantile(known, [0.025, 0.975])
    return Interval(float(value), float(min(low, value)), float(max(high, value)))
