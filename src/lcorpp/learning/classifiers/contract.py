"""Training of anybody's classifier: what fails or does not keep the contract is told in one sentence.

The contract is scikit-learn's: `fit(X, y)`, `predict_proba(X)` and `classes_` on arrays (cases, channels,
time points). A classifier that scores without probabilities is given some.
"""

from __future__ import annotations

from typing import Any, Self

import numpy as np
import numpy.typing as npt
from scipy.special import expit, softmax
from sklearn.base import BaseEstimator, ClassifierMixin, clone

from lcorpp.errors import DataError, LcorppError
from lcorpp.values import Array

TOLERANCE = 1e-4
"""How far the sum of a distribution may be from 1: some classifiers compute with single precision."""


class Scored(ClassifierMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn has no types
    """A classifier with scores (`decision_function`) but no probabilities, which are made of them.

    The sigmoid of a score, or the softmax of several, keeps the order of the cases but is not yet calibrated:
    `calibration` does that, and both together are Platt's method.

    Args:
        classifier: e.g. a `RidgeClassifierCV` or a `LinearSVC`, or a pipeline that ends in one.

    Source: Platt, "Probabilistic outputs for support vector machines", 1999.
    """

    def __init__(self, classifier: Any) -> None:
        self.classifier = classifier

    def fit(self, X: npt.ArrayLike, y: npt.ArrayLike) -> Self:
        """Train a clone of the classifier."""
        self.classifier_ = clone(self.classifier).fit(X, y)
        self.classes_ = self.classifier_.classes_
        return self

    def predict_proba(self, X: npt.ArrayLike) -> Array:
        """(cases, K) numbers that rise with the scores, rows summing to 1, columns as `classes_`."""
        scores = np.asarray(self.classifier_.decision_function(X), dtype=np.float64)
        if scores.ndim == 1:
            return np.stack([expit(-scores), expit(scores)], axis=1)
        return np.asarray(softmax(scores, axis=1))

    def predict(self, X: npt.ArrayLike) -> npt.NDArray[Any]:
        """(cases,) the most probable of `classes_`."""
        return np.asarray(self.classes_[self.predict_proba(X).argmax(axis=1)])


def with_probabilities(estimator: Any) -> Any:
    """The classifier itself where it gives probabilities, `Scored` around one that has only scores.

    Raises:
        DataError: it has neither, or is no classifier that can be cloned.
    """
    for method in ("fit", "get_params"):
        if isinstance(estimator, type) or not hasattr(estimator, method):
            raise DataError(
                f"{estimator!r} is no estimator; expected an object with fit, predict_proba and get_params,"
                " as scikit-learn's classifiers have"
            )
    if hasattr(estimator, "predict_proba"):
        return estimator
    if hasattr(estimator, "decision_function"):
        return Scored(estimator)
    raise DataError(
        f"{name_of(estimator)} has neither predict_proba nor decision_function; expected a classifier that"
        " says how sure it is"
    )


def fitted(estimator: Any, tracks: Array, labels: npt.ArrayLike) -> Any:
    """A clone of `estimator`, trained.

    Args:
        tracks: (cases, channels, time points). labels: (cases,) class names.

    Raises:
        DataError: it fails, or tells no classes apart.
    """
    try:
        trained = clone(estimator)
    except (TypeError, RuntimeError) as error:  # a constructor that scikit-learn cannot repeat
        raise _blamed(estimator, "clone", error) from error
    try:
        trained.fit(tracks, labels)
    except LcorppError:
        raise
    except (Exception, SystemExit) as error:
        raise _blamed(estimator, "fit", error) from error
    classes = np.asarray(getattr(trained, "classes_", None))
    if classes.ndim != 1:
        raise DataError(f"{name_of(estimator)} has no classes_ after fit; expected a scikit-learn classifier")
    if not isinstance(trained.classes_, np.ndarray):
        trained.classes_ = classes
    return trained


def predicted(trained: Any, tracks: Array) -> Array:
    """(cases, K) the probabilities that a trained classifier gives, known to be distributions.

    Raises:
        DataError: it fails, or what it gives are none.
    """
    try:
        given = np.asarray(trained.predict_proba(tracks), dtype=np.float64)
    except LcorppError:
        raise
    except (Exception, SystemExit) as error:
        raise _blamed(trained, "predict_proba", error) from error
    shape = (len(tracks), len(trained.classes_))
    if given.shape != shape:
        raise DataError(f"{name_of(trained)}: predict_proba gave shape {given.shape}; expected {shape}")
    right = np.isfinite(given).all(axis=1) & (given >= 0).all(axis=1)
    right &= np.abs(given.sum(axis=1) - 1) <= TOLERANCE
    if not right.all():
        case = int(np.argmin(right))
        raise DataError(
            f"{name_of(trained)}: predict_proba gave {given[case].tolist()} for case {case} (counted from 0);"
            " expected a distribution"
        )
    return given


def name_of(estimator: Any) -> str:
    """What an estimator is called: its type, of a pipeline that of its last step."""
    steps = getattr(estimator, "steps", None)
    if steps:
        return name_of(steps[-1][1])
    return name_of(estimator.classifier) if isinstance(estimator, Scored) else type(estimator).__name__


def _blamed(estimator: Any, doing: str, error: BaseException) -> DataError:
    return DataError(f"{name_of(estimator)} failed in {doing}: {type(error).__name__}: {error}")
