"""The contract of a classifier: fit user-supplied classifiers and report violations as one-line errors.

The contract is scikit-learn's: `fit(X, y)`, `predict_proba(X)` and `classes_` on arrays (cases, channels,
time points). `SigmoidScores` wraps a classifier that has scores but no probabilities.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from scipy.special import expit, softmax
from sklearn.base import BaseEstimator, ClassifierMixin, clone
from sklearn.utils.validation import has_fit_parameter

from lcorpp.errors import DataError, LcorppError
from lcorpp.values import Array

TOLERANCE = 1e-4
"""Maximal deviation of the sum of a distribution from 1: some classifiers compute in single precision."""


class ProbabilityClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]  # has no types
    """A classifier that predicts the most probable class."""

    def predict(self, X: npt.ArrayLike) -> npt.NDArray[Any]:
        """(cases,) the most probable of `classes_`; raises as `predict_proba`."""
        best = self.predict_proba(X).argmax(axis=1)
        return np.asarray(self.classes_[best])


class SigmoidScores(ProbabilityClassifier):
    """Wrapper that turns the scores (`decision_function`) of a classifier into probabilities.

    The sigmoid of a score, or the softmax of several, keeps the order of the cases but is not calibrated;
    `calibration` does that, and both together are Platt's method.

    Args:
        classifier: e.g. a `RidgeClassifierCV` or a `LinearSVC`, or a pipeline that ends in one.

    Source: Platt, "Probabilistic outputs for support vector machines", 1999.
    """

    def __init__(self, classifier: Any) -> None:
        self.classifier = classifier

    def fit(self, X: npt.ArrayLike, y: npt.ArrayLike, sample_weight: npt.ArrayLike | None = None) -> Self:
        """Train a clone of the classifier; it needs to take `sample_weight` only if that is given."""
        weights = {} if sample_weight is None else _route_weights(self.classifier, sample_weight)
        self.classifier_ = clone(self.classifier).fit(X, y, **weights)
        self.classes_ = self.classifier_.classes_
        return self

    def predict_proba(self, X: npt.ArrayLike) -> Array:
        """(cases, K) numbers that increase with the scores, rows summing to 1, columns as `classes_`."""
        return to_probabilities(np.asarray(self.classifier_.decision_function(X), dtype=np.float64))


def to_probabilities(scores: Array) -> Array:
    """(cases, K) the sigmoid of scores (cases,), which are for the second of two classes, or a softmax."""
    if scores.ndim == 1:
        return np.stack([expit(-scores), expit(scores)], axis=1)
    return np.asarray(softmax(scores, axis=1))


def ensure_predict_proba(estimator: Any) -> Any:
    """Return the estimator if it has predict_proba, or `SigmoidScores` around it if it has only scores.

    Raises:
        DataError: it has neither, or is not a classifier that can be cloned.
    """
    if isinstance(estimator, type) or not (hasattr(estimator, "fit") and hasattr(estimator, "get_params")):
        raise DataError(
            f"{estimator!r} is no estimator; expected an object with fit, predict_proba and get_params, as"
            " scikit-learn's classifiers have"
        )
    if hasattr(estimator, "predict_proba"):
        return estimator
    if hasattr(estimator, "decision_function"):
        return SigmoidScores(estimator)
    raise DataError(
        f"{name_of(estimator)} has neither predict_proba nor decision_function; expected a classifier that"
        " gives probabilities or scores"
    )


def accepts_weights(estimator: Any) -> bool:
    """Whether `fit` takes the weights of cases; of a pipeline, that of its last step."""
    if isinstance(estimator, SigmoidScores):
        return accepts_weights(estimator.classifier)
    if steps := getattr(estimator, "steps", None):
        return accepts_weights(steps[-1][1])
    return bool(has_fit_parameter(estimator, "sample_weight"))


def _route_weights(estimator: Any, weights: npt.ArrayLike) -> dict[str, npt.ArrayLike]:
    """Return the weights as arguments of `fit`; in a pipeline every step that takes weights gets them."""
    if not accepts_weights(estimator):
        raise DataError(
            f"{name_of(estimator)} has no sample_weight in fit, so it cannot learn from weighted cases"
        )
    steps = getattr(estimator, "steps", None)
    if steps is None:
        return {"sample_weight": weights}
    return {f"{name}__sample_weight": weights for name, step in steps if accepts_weights(step)}


def fit_clone(
    estimator: Any, tracks: Array, labels: npt.ArrayLike, weights: npt.ArrayLike | None = None
) -> Any:
    """Clone `estimator` and fit the clone.

    Args:
        tracks: (cases, channels, time points). labels: (cases,) class names.
        weights: (cases,) as in `Dataset`. None, or 1 for all, does not need an estimator that takes them.

    Raises:
        DataError: cloning or fitting fails, the fitted clone has no `classes_`, or it takes no weights.
    """
    given = np.ones(1) if weights is None else np.asarray(weights, dtype=np.float64)
    routed = _route_weights(estimator, given) if (given != 1).any() else {}
    with _report_failure(estimator, "clone"):
        trained = clone(estimator)
    with _report_failure(estimator, "fit"):
        trained.fit(tracks, labels, **routed)
    classes = np.asarray(getattr(trained, "classes_", None))
    if classes.ndim != 1:
        raise DataError(f"{name_of(estimator)} has no classes_ after fit; expected a scikit-learn classifier")
    if not isinstance(trained.classes_, np.ndarray):
        trained.classes_ = classes
    return trained


def predict_proba(trained: Any, tracks: Array) -> Array:
    """(cases, K) the probabilities of a trained classifier, checked to be distributions.

    Raises:
        DataError: the classifier fails, or its result is not an array of distributions.
    """
    with _report_failure(trained, "predict_proba"):
        probabilities = np.asarray(trained.predict_proba(tracks), dtype=np.float64)
    shape = (len(tracks), len(trained.classes_))
    if probabilities.shape != shape:
        raise DataError(
            f"{name_of(trained)}: predict_proba gave shape {probabilities.shape}; expected {shape}"
        )
    valid = np.isfinite(probabilities).all(axis=1) & (probabilities >= 0).all(axis=1)
    valid &= np.abs(probabilities.sum(axis=1) - 1) <= TOLERANCE
    if not valid.all():
        case = int(np.argmin(valid))
        raise DataError(
            f"{name_of(trained)}: predict_proba gave {probabilities[case].tolist()} for case {case}"
            " (counted from 0); expected a distribution"
        )
    return probabilities


def name_of(estimator: Any) -> str:
    """The type name of an estimator; for a pipeline, that of its last step."""
    steps = getattr(estimator, "steps", None)
    if steps:
        return name_of(steps[-1][1])
    return name_of(estimator.classifier) if isinstance(estimator, SigmoidScores) else type(estimator).__name__


@contextmanager
def _report_failure(estimator: Any, method: str) -> Iterator[None]:
    """Turn an exception of the user's code into a DataError of one line."""
    try:
        yield
    except LcorppError:
        raise
    except (Exception, SystemExit) as error:
        raise DataError(
            f"{name_of(estimator)} failed in {method}: {type(error).__name__}: {error}"
        ) from error
