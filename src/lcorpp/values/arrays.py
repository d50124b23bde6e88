"""Array types, read-only copies and confidence intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
"""Array of floats; each use documents the shape."""

Belief = npt.NDArray[np.float64]
"""(S,) distribution over the states of a POMDP."""


def freeze(array: npt.ArrayLike) -> Array:
    """Return a read-only float64 copy of `array`."""
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy


@dataclass(frozen=True)
class Interval:
    """A point estimate and its confidence interval.

    estimate: the point estimate, in the unit of the estimated quantity; NaN if it is undefined.
    low, high: ends of the interval. It need not be symmetric around the estimate.
    confidence: nominal coverage, between 0 and 1.
    """

    estimate: float
    low: float
    high: float
    confidence: float = 0.95

    @classmethod
    def exact(cls, value: float) -> Interval:
        """Return the interval of width 0 of a value that is known exactly."""
        return cls(value, value, value)

    def __str__(self) -> str:
        return f"{self:.3f}"

    def __format__(self, spec: str) -> str:
        """Format all three numbers alike: ``f"{interval:.2f}"`` is ``0.63 [0.60, 0.67]``."""
        if not spec:
            return str(self)
        return f"{self.estimate:{spec}} [{self.low:{spec}}, {self.high:{spec}}]"

    def __repr__(self) -> str:
        return f"Interval({self}, {self.confidence:.6g})"
