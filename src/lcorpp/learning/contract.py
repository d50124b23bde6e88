"""The contract of a classifier: fit user-supplied classifiers and report violations as one-line errors.

The contract is scikit-learn's: `fit(X, y)`, `predict_proba(X)` and `classes_` on arrays (cases, channels,
time points). `SigmoidScores` wraps a classifier that has scores but no probabilities.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from scipy.special import expit, softmax
from sklearn.base import BaseEstimator, ClassifierMixin, clone
from sklearn.utils.validation import has_fit_parameter

from lcorpp.errors import DataError, LcorppError
from lcorpp.user_code import UserFile
from lcorpp.values import Array

TOLERANCE = 1e-4
"""Maximal deviation of the sum of a distribution from 1: some classifiers compute in single precision."""


ORIGIN = "lcorpp_origin"
"""The attribute of an estimator that has its `Origin`. It is not a parameter, so it is never stored."""


@dataclass(frozen=True)
class Origin:
    """The user's function that returned an estimator, for messages.

    name: as the user writes it, e.g. FILE.py:NAME. location: of its definition, FILE.py:LINE.
    """

    name: str
    file: UserFile
    location: str

    def locate(self, estimator: Any, method: str) -> str:
        """Return the location of a method if the user's file defines it, or that of the function."""
        return self.file.locate(getattr(find_type(estimator), method, None), self.location)


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
            f"{estimator!r} is not an estimator; expected an object with fit, predict_proba and get_params,"
            " as scikit-learn's classifiers have"
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
        raise make_error(
            estimator, "fit", "has no sample_weight in fit; weighted cases need a classifier that has it"
        )
    steps = getattr(estimator, "steps", None)
    if steps is None:
        return {"sample_weight": weights}
    return {f"{name}__sample_weight": weights for name, step in steps if accepts_weights(step)}


def with_origin(estimator: Any, origin: Origin | None) -> Any:
    """Return the estimator, which keeps its origin in clones of `clone_unfitted` and in other processes."""
    if origin is not None:
        setattr(estimator, ORIGIN, origin)
    return estimator


def clone_unfitted(estimator: Any) -> Any:
    """Return an unfitted clone.

    Raises:
        DataError: cloning fails.
    """
    with report_failure(
        estimator, "clone", "an __init__ that keeps its arguments, as get_params returns them"
    ):
        return with_origin(clone(estimator), getattr(estimator, ORIGIN, None))


def fit_clone(
    estimator: Any, tracks: Array, labels: npt.ArrayLike, weights: npt.ArrayLike | None = None
) -> Any:
    """Clone `estimator` and fit the clone.

    Args:
        tracks: (cases, channels, time points). labels: (cases,) class names.
        weights: (cases,) as in `Dataset`. None, or 1 for all, does not need an estimator that takes them.

    Raises:
        DataError: cloning or fitting fails, the `classes_` of the fitted clone are not those of `labels`, or
            it takes no weights.
    """
    given = np.ones(1) if weights is None else np.asarray(weights, dtype=np.float64)
    routed = _route_weights(estimator, given) if (given != 1).any() else {}
    trained, known = clone_unfitted(estimator), np.unique(labels)
    names = ", ".join(map(str, known))
    shapes = f"fit(X, y) to accept X of {_describe_shape(tracks)} and y of the classes {names}"
    with report_failure(trained, "fit", shapes):
        trained.fit(tracks, labels, **routed)
    classes = np.asarray(getattr(trained, "classes_", None))
    if classes.ndim != 1:
        raise make_error(trained, "fit", f"has no classes_ after fit; expected an array of {names}")
    if classes.tolist() != known.tolist():
        raise make_error(trained, "fit", f"learnt the classes {classes.tolist()}; expected {known.tolist()}")
    if not isinstance(trained.classes_, np.ndarray):
        trained.classes_ = classes
    return trained


def predict_proba(trained: Any, tracks: Array) -> Array:
    """(cases, K) the probabilities of a trained classifier, checked to be distributions.

    Raises:
        DataError: the classifier fails, or its result is not an array of distributions.
    """
    shape, method = (len(tracks), len(trained.classes_)), "predict_proba"
    with report_failure(
        trained, method, f"probabilities of shape {shape} for X of {_describe_shape(tracks)}"
    ):
        probabilities = np.asarray(trained.predict_proba(tracks), dtype=np.float64)
    if probabilities.shape != shape:
        raise make_error(
            trained, method, f"gave shape {probabilities.shape} in predict_proba; expected {shape}"
        )
    valid = np.isfinite(probabilities).all(axis=1) & (probabilities >= 0).all(axis=1)
    valid &= np.abs(probabilities.sum(axis=1) - 1) <= TOLERANCE
    if not valid.all():
        case = int(np.argmin(valid))
        raise make_error(
            trained,
            method,
            f"gave {probabilities[case].tolist()} in predict_proba for case {case} (counted from 0); expected"
            f" a distribution: {shape[1]} numbers from 0 to 1 with the sum 1",
        )
    return probabilities


def _describe_shape(tracks: Array) -> str:
    padding = ", whose shorter tracks end in NaN" if np.isnan(tracks).any() else ""
    return f"shape {tracks.shape}{padding}"


def name_of(estimator: Any) -> str:
    """The type name of an estimator; for a pipeline, that of its last step."""
    return find_type(estimator).__name__


def find_type(estimator: Any) -> type:
    """Return the type of an estimator; for a pipeline, that of its last step."""
    steps = getattr(estimator, "steps", None)
    if steps:
        return find_type(steps[-1][1])
    return find_type(estimator.classifier) if isinstance(estimator, SigmoidScores) else type(estimator)


@contextmanager
def report_failure(estimator: Any, method: str, expected: str) -> Iterator[None]:
    """Turn an exception of the user's code into a DataError."""
    try:
        yield
    except LcorppError:
        raise
    except (Exception, SystemExit) as error:
        origin, what = getattr(estimator, ORIGIN, None), f"{name_of(estimator)} failed in {method}"
        if origin is None:
            message = f"{what}: {type(error).__name__}: {error}"
        else:
            what = f"the learner {origin.name}: {what}"
            message = origin.file.describe_failure(error, what, origin.locate(estimator, method))
        raise DataError(f"{message}; expected {expected}") from error


def make_error(estimator: Any, method: str, fault: str) -> DataError:
    """Return the error that a method of the user's code breaks the contract; `fault` is the predicate."""
    origin, message = getattr(estimator, ORIGIN, None), f"{name_of(estimator)} {fault}"
    if origin is None:
        return DataError(message)
    return DataError(f"{origin.locate(estimator, method)}: the learner {origin.name}: {message}")
