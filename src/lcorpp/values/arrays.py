"""Array types, read-only copies and confidence intervals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import to_numbers
from lcorpp.errors import DataError

Array = npt.NDArray[np.float64]
"""Array of floats; each use documents the shape."""

Indices = npt.NDArray[np.intp]
"""Array of indices."""

Flags = npt.NDArray[np.bool_]

Z95 = 1.9599639845400536
"""The 95 % interval of a standard normal variable is [-Z95, Z95]."""

Belief = npt.NDArray[np.float64]
"""(S,) distribution over the states of a POMDP."""


Number = TypeVar("Number", float, Array)


def wrap_angle(angle: Number) -> Number:
    """Wrap an angle, or an array of angles, to (-pi, pi].

    Examples:
        >>> from lcorpp.values import wrap_angle
        >>> round(wrap_angle(4.0), 3)  # 4 - 2 pi
        -2.283
    """
    return np.pi - (np.pi - angle) % (2 * np.pi)


def check_rows(rows: npt.ArrayLike, n: int) -> Indices:
    """Return the numbers of rows as an array (k,).

    Raises:
        DataError: another shape, or a number that is none of the n rows.

    Examples:
        >>> from lcorpp.values import check_rows
        >>> check_rows([0, -1], 5).tolist()
        [0, -1]
        >>> check_rows([5], 5)
        Traceback (most recent call last):
            ...
        lcorpp.errors.DataError: the rows are [5]; expected a sequence of indices below 5
    """
    numbers = to_numbers(rows, "the rows")
    index = numbers.astype(np.intp) if np.isfinite(numbers).all() else np.full(1, n)
    if index.ndim != 1 or (len(index) and not -n <= index.min() <= index.max() < n):
        raise DataError(f"the rows are {index.tolist()}; expected a sequence of indices below {n}")
    return index


def freeze(array: npt.ArrayLike) -> Array:
    """Return a read-only float64 copy of `array`.

    Examples:
        >>> from lcorpp.values import freeze
        >>> freeze([0.5, 0.5]).flags.writeable
        False
    """
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy


def share_frozen(array: npt.ArrayLike) -> Array:
    """Return `array` itself if it is float64, read-only and owns its memory, otherwise a read-only copy.

    Examples:
        >>> from lcorpp.values import freeze, share_frozen
        >>> belief = freeze([0.5, 0.5])
        >>> share_frozen(belief) is belief
        True
    """
    if (
        isinstance(array, np.ndarray)
        and array.dtype == np.float64
        and array.flags.owndata
        and not array.flags.writeable
    ):
        return array
    return freeze(array)


@dataclass(frozen=True)
class Interval:
    """A point estimate and its confidence interval.

    estimate: the point estimate, in the unit of the estimated quantity; NaN if it is undefined.
    low, high: ends of the interval. It need not be symmetric around the estimate.
    confidence: nominal coverage, between 0 and 1.

    Examples:
        >>> from lcorpp import Interval
        >>> str(Interval.from_count(8, 10))  # the proportion of 8 successes of 10, by Wilson
        '0.800 [0.490, 0.943]'
    """

    estimate: float
    low: float
    high: float
    confidence: float = 0.95

    @classmethod
    def exact(cls, value: float) -> Interval:
        """Return the interval of width 0 of a value that is known exactly."""
        return cls(value, value, value)

    @classmethod
    def from_count(cls, hits: float, total: float) -> Interval:
        """Return the proportion hits / total with its 95 % Wilson interval; 0 with [0, 1] if the total is 0.

        Source: Wilson, "Probable inference, the law of succession, and statistical inference", JASA 22, 1927.
        """
        if total == 0:
            return cls(0.0, 0.0, 1.0)
        p, z2 = hits / total, Z95**2 / total
        middle = (p + z2 / 2) / (1 + z2)
        half = float(np.sqrt(z2 * (p * (1 - p) + z2 / 4))) / (1 + z2)
        return cls(p, min(p, max(0.0, middle - half)), max(p, min(1.0, middle + half)))

    @classmethod
    def from_sample(cls, numbers: Array) -> Interval:
        """Return the mean of a sample (n,) with its 95 % normal interval; of one number, with width 0."""
        middle, n = float(np.mean(numbers)), len(numbers)
        half = Z95 * float(np.std(numbers, ddof=min(1, n - 1))) / float(np.sqrt(n))
        return cls(middle, middle - half, middle + half)

    def __str__(self) -> str:
        return f"{self:.3f}"

    def __format__(self, spec: str) -> str:
        """Format all three numbers alike: ``f"{interval:.2f}"`` is ``0.63 [0.60, 0.67]``."""
        if not spec:
            return str(self)
        return f"{self.estimate:{spec}} [{self.low:{spec}}, {self.high:{spec}}]"

    def __repr__(self) -> str:
        return f"Interval({self}, {self.confidence:.6g})"
