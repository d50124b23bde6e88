"""Array types and read-only copies."""

from __future__ import annotations

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
