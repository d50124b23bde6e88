"""How much a case of each class counts in training."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError
from lcorpp.values import Array


def class_weights(
    given: str | Mapping[Any, float] | None, classes: npt.NDArray[Any], counts: npt.NDArray[np.intp]
) -> Array:
    """(K,) the weight of a case of each class, as scikit-learn's classifiers have it.

    Args:
        given: None: 1 for all; "balanced": what makes all classes count the same and the mean over the cases
            1; or class name -> weight.
        classes: (K,) the class names. counts: (K,) how many cases there are of each.

    Raises:
        DataError: `given` is none of these, is of other classes, or holds what is not positive and finite.
    """
    if given is None:
        return np.ones(len(classes))
    if isinstance(given, str) and given == "balanced":
        return np.asarray(counts.sum() / (len(classes) * counts), dtype=np.float64)
    if not isinstance(given, Mapping):
        raise DataError(f"class_weight must be None, 'balanced' or a mapping, not {given!r}")
    names = classes.tolist()
    if set(given) != set(names):
        raise DataError(f"class_weight is for {sorted(map(str, given))}, the classes are {names}")
    if not all(isinstance(given[name], Real) and 0 < given[name] < np.inf for name in names):
        raise DataError(f"class_weight must hold positive finite numbers, not {dict(given)}")
    return np.array([given[name] for name in names], dtype=np.float64)
