"""The rule by which robots decide today whether a person is engaged: mutual gaze over distance."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from sklearn.utils.validation import check_is_fitted

from lcorpp.errors import DataError
from lcorpp.learning.classifiers.learner_table import GAZE_RULE_FEATURES
from lcorpp.learning.contract import ProbabilityClassifier
from lcorpp.learning.data.dataset import check_labels, check_tracks
from lcorpp.values import Array


class GazeRule(ProbabilityClassifier):
    """A person is engaged if the mean visual social engagement of a window is at least a half.

    The mean serves as the probability, so that the most probable class is that of the rule; it is not
    calibrated. The training only finds which of two classes has the larger mean.

    Source: Webb, Giuliani and Lemaignan, RO-MAN 2022; the threshold of ROS4HRI's node hri_engagement.

    Attributes:
        classes_: (2,) the class names in order, set by `fit`. engaged_: index of the class of larger mean.

    Examples:
        >>> from lcorpp.learning.classifiers.gaze_rule import GazeRule
        >>> rule = GazeRule().fit([[[0.6, 0.8]], [[0.1, 0.3]]], ["engaged", "other"])
        >>> rule.predict([[[0.4, 0.5]], [[0.4, 0.7]]]).tolist()
        ['other', 'engaged']
    """

    def fit(self, X: npt.ArrayLike, y: npt.ArrayLike, sample_weight: npt.ArrayLike | None = None) -> Self:
        """Find the class of larger mean in X (cases, 1, points) and class names y (cases,).

        Raises:
            DataError: there are not two classes, or X is not one row of social engagement.
        """
        means = _compute_means(X)
        y = check_labels(y, len(means))
        weights = np.ones(len(means)) if sample_weight is None else np.asarray(sample_weight)
        self.classes_ = np.unique(y)
        if len(self.classes_) != 2:
            raise DataError(f"the rule tells two classes apart, not {len(self.classes_)}")
        of_class = [np.average(means[y == name], weights=weights[y == name]) for name in self.classes_]
        self.engaged_ = int(np.argmax(of_class))
        return self

    def predict_proba(self, X: npt.ArrayLike) -> Array:
        """(cases, 2) the mean of each window for the class of larger mean, and the rest for the other."""
        check_is_fitted(self, "engaged_")
        means = _compute_means(X)
        pair = (1 - means, means) if self.engaged_ else (means, 1 - means)
        return np.stack(pair, axis=1)

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The fitted state, for `storage`."""
        check_is_fitted(self, "engaged_")
        return {"classes": self.classes_.astype(np.str_), "engaged": np.array(float(self.engaged_))}

    def restore_arrays(self, arrays: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Restore the state that `to_arrays` returned.

        Raises:
            DataError: the arrays do not match.
        """
        self.classes_, engaged = arrays["classes"], arrays["engaged"]
        if self.classes_.shape != (2,) or engaged not in (0, 1):
            raise DataError("the rule needs two classes, and one of them that is engaged")
        self.engaged_ = int(engaged)
        return self


def _compute_means(X: npt.ArrayLike) -> Array:
    """(cases,) the mean over the points of each case (cases, 1, points); padding does not count."""
    tracks = check_tracks(X)
    if tracks.shape[1] != 1:
        raise DataError(
            f"the rule takes the feature {GAZE_RULE_FEATURES[0]} alone, given {tracks.shape[1]} rows"
        )
    means: Array = np.nanmean(tracks[:, 0], axis=1)
    return np.clip(means, 0.0, 1.0)
