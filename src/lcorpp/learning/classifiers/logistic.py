"""Logistic regression on features and their squares: fast, smooth, and stored as a few arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from sklearn.linear_model import LogisticRegression
from sklearn.utils.validation import check_is_fitted

from lcorpp.arguments import check_value
from lcorpp.errors import DataError
from lcorpp.learning.contract import ProbabilityClassifier, to_probabilities
from lcorpp.learning.data.dataset import check_labels, check_signals
from lcorpp.values import Array

CLIP = 3.0
"""Standardised features are clipped to this many standard deviations, so that no outlier dominates."""

MAX_ITERATIONS = 2000


class QuadraticLogistic(ProbabilityClassifier):
    """Scikit-learn's logistic regression on standardised, clipped features and their squares.

    The squares let a medium value indicate one class and both extremes another. There are no products of two
    features, which scikit-learn's PolynomialFeatures would add.

    Args:
        C: inverse of the regularization strength, as in scikit-learn.
        max_cases: more cases than that do not weaken the regularization; None for no limit. Cases of a new
            place, or overlapping parts of one track, are not independent draws from one distribution.
        class_weight: "balanced": equal total weight of all classes; None: equal weight of all cases.

    Attributes:
        classes_: (K,) the class names in order, set by `fit`.
        mean_, scale_: (features,) of the training data.
        weights_: (1 or K, 2 features), bias_: (1 or K,); two classes share one row.

    Examples:
        >>> from lcorpp.learning import QuadraticLogistic
        >>> speeds = [[0.0], [0.1], [0.8], [0.9], [1.7], [1.8]]
        >>> labels = 2 * ["stands or hurries"] + 2 * ["strolls"] + 2 * ["stands or hurries"]
        >>> QuadraticLogistic(C=1).fit(speeds, labels).predict([[0.05], [0.85], [2.0]]).tolist()
        ['stands or hurries', 'strolls', 'stands or hurries']
    """

    def __init__(
        self, *, C: float = 0.02, max_cases: float | None = None, class_weight: str | None = "balanced"
    ) -> None:
        self.C = C
        self.class_weight = class_weight
        self.max_cases = max_cases

    def fit(self, X: npt.ArrayLike, y: npt.ArrayLike, sample_weight: npt.ArrayLike | None = None) -> Self:
        """Train on X (cases, features) and class names y (cases,), with weights (cases,), 1 by default.

        Raises:
            DataError: `C` or `max_cases` is not above 0.
        """
        check_value(self.C, float, "C")
        check_value(self.max_cases, float | None, "max_cases")
        if not 0 < self.C < float("inf"):
            raise DataError(f"C must be a finite number above 0, not {self.C}")
        if self.max_cases is not None and not self.max_cases > 0:
            raise DataError(f"max_cases must be above 0, not {self.max_cases}")
        features = check_signals(X)
        if features.ndim != 2:
            raise DataError(f"features of shape {features.shape}; expected (cases, features)")
        y = check_labels(y, len(features))
        weights = np.ones(len(features)) if sample_weight is None else np.asarray(sample_weight)
        self.mean_: Array = np.average(features, axis=0, weights=weights)
        deviation = np.sqrt(np.average((features - self.mean_) ** 2, axis=0, weights=weights))
        self.scale_: Array = np.where(deviation > 1e-9, deviation, 1.0)
        share = 1.0 if self.max_cases is None else min(1.0, self.max_cases / weights.sum())
        model = LogisticRegression(C=self.C * share, max_iter=MAX_ITERATIONS, class_weight=self.class_weight)
        model.fit(self._add_squares(features), y, weights)
        self.classes_, self.weights_, self.bias_ = model.classes_, model.coef_, model.intercept_
        return self

    def predict_proba(self, X: npt.ArrayLike) -> Array:
        """(cases, K) the probability of each of `classes_`, rows summing to 1.

        Raises:
            DataError: X does not have the features of the training data.
        """
        check_is_fitted(self, "weights_")
        features = np.asarray(X, dtype=np.float64)
        if features.ndim != 2 or features.shape[1] != len(self.mean_):
            raise DataError(f"trained on {len(self.mean_)} features, given shape {features.shape}")
        scores = self._add_squares(features) @ self.weights_.T + self.bias_
        return to_probabilities(scores[:, 0] if len(self.classes_) == 2 else scores)

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The fitted state, for `storage`."""
        check_is_fitted(self, "weights_")
        return {
            "classes": self.classes_.astype(np.str_),
            "mean": self.mean_,
            "scale": self.scale_,
            "weights": self.weights_,
            "bias": self.bias_,
        }

    def restore_arrays(self, arrays: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Restore the state that `to_arrays` returned.

        Raises:
            DataError: the arrays do not match.
        """
        classes, *others = (arrays[name] for name in ("classes", "mean", "scale", "weights", "bias"))
        mean, scale, weights, bias = others
        n, rows = mean.size, 1 if len(classes) == 2 else len(classes)
        if (
            classes.ndim != 1
            or len(classes) < 2
            or [array.shape for array in others] != [(n,), (n,), (rows, 2 * n), (rows,)]
            or not all(np.isfinite(array).all() for array in others)
            or not (scale > 0).all()
        ):
            raise DataError("a logistic regression needs finite weights, two per feature, and scales above 0")
        self.classes_, self.mean_, self.scale_ = classes, mean, scale
        self.weights_, self.bias_ = weights, bias
        return self

    def _add_squares(self, features: Array) -> Array:
        """(cases, 2 features) standardised features and their squares."""
        z = np.clip((features - self.mean_) / self.scale_, -CLIP, CLIP)
        return np.concatenate([z, z**2 - 1], axis=1)
