"""Uncertain labels as weighted cases of each class."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError
from lcorpp.values import Dataset, Indices


@check_arguments
def split_by_class(
    dataset: Dataset, distributions: Sequence[Mapping[str, float] | None]
) -> tuple[Dataset, Indices]:
    """Return the data set in which an uncertain case is a case of each possible class, and their origins.

    Args:
        distributions: (cases,) class -> probability, which multiplies the weight of the case; None keeps the
            case with its label.

    Returns:
        The data set, and for each of its cases the number of the case in `dataset` from which it is.

    Raises:
        DataError: there are other numbers of cases and distributions.
    """
    if len(distributions) != len(dataset):
        raise DataError(f"{len(distributions)} distributions do not fit {len(dataset)} cases")
    cases = [
        (row, name, probability)
        for row, (label, own) in enumerate(zip(dataset.labels, distributions, strict=True))
        for name, probability in ([(label, 1.0)] if own is None else sorted(own.items()))
        if probability > 0
    ]
    origins = np.array([row for row, _, _ in cases], dtype=np.intp)
    taken = dataset.take(origins)
    weights = taken.weights * np.array([probability for _, _, probability in cases])
    return replace(taken, labels=tuple(name for _, name, _ in cases), weights=weights), origins
