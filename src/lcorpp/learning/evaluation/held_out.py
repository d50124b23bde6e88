"""Predictions for cases of the training data by classifiers that were trained without their people."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.learning.contract import predict_proba
from lcorpp.values import Array


class HeldOutPredictor:
    """A fitted classifier that predicts each of its training cases as cross-validation did.

    So a label of a recorded person is as good as one of a new person, although the people are so few that all
    of them are training data. Error rates, threshold and calibration are still those of the same predictions.

    Args:
        estimator: fitted to all cases. cases: (cases, channels, time points) its training data.
        probabilities: (cases, K) of the cross-validation, columns as `estimator.classes_`.
    """

    def __init__(self, estimator: Any, cases: Array, probabilities: Array) -> None:
        self.estimator, self.classes_ = estimator, estimator.classes_
        self._probabilities = {_find_key(case): own for case, own in zip(cases, probabilities, strict=True)}

    def predict_proba(self, X: npt.ArrayLike) -> Array:
        """(n, K) the probabilities of (n, channels, time points); of new cases those of the estimator."""
        signals = np.asarray(X, dtype=np.float64)
        known = [self._probabilities.get(_find_key(signal)) for signal in signals]
        new = [row for row, own in enumerate(known) if own is None]
        found = np.empty((len(signals), len(self.classes_)))
        if new:
            found[new] = predict_proba(self.estimator, signals[new])
        for row, own in enumerate(known):
            if own is not None:
                found[row] = own
        return found


def _find_key(case: Array) -> bytes:
    """Return the numbers of a case without its padding, by which it is found."""
    points = ~np.isnan(case).all(axis=0)
    return np.ascontiguousarray(case[:, points] if case.ndim == 2 else case).tobytes()
