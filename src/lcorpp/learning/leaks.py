"""Does a data set give its labels away by something that is not motion?"""

from __future__ import annotations

import numpy as np
from sklearn.neighbors import KNeighborsClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from lcorpp.errors import DataError
from lcorpp.learning.motion import PLACE
from lcorpp.learning.validation import cross_validate
from lcorpp.values import Array, Dataset

SUSPICIOUS = 0.7
"""From this AUC on, a score on the data says more about places than about motion."""


def end_position_leak(dataset: Dataset) -> float:
    """AUC with which the last position alone tells the label: .5 is chance, 1 a perfect leak.

    Cases are called what their nearest neighbours by end position are, cross-validated in five grouped
    folds, so that memory does not look like a leak and the rule may have any shape.

    Raises:
        DataError: there are not two classes, or too few groups to divide.
    """
    if len(set(dataset.labels)) != 2:
        raise DataError(f"an AUC needs two classes, not {len(set(dataset.labels))}")
    neighbours = max(3, round(np.sqrt(len(dataset)) / 2))
    nearest = KNeighborsClassifier(neighbours, weights="distance")
    rule = make_pipeline(FunctionTransformer(_end), StandardScaler(), nearest)
    auc = cross_validate(rule, dataset).auc
    assert auc is not None  # there are two classes
    return auc


def leak_note(dataset: Dataset) -> str | None:
    """A sentence to print beside any score on `dataset`, None where the end position tells little."""
    auc = end_position_leak(dataset)
    if auc < SUSPICIOUS:
        return None
    return (
        f"The end position alone tells the label (AUC {auc:.2f}): a classifier that sees positions"
        " learns places, not intentions; give it motion relative to the first point."
    )


def _end(tracks: Array) -> Array:
    """(cases, 2) the last x and y."""
    return tracks[:, :PLACE, -1]
