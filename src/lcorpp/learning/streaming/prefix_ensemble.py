"""A classifier for every age of a track: it learns from beginnings, too, and is as good as it can early."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, takewhile
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from scipy.special import softmax
from sklearn.base import BaseEstimator, ClassifierMixin, clone
from sklearn.pipeline import Pipeline
from sklearn.utils.metaestimators import available_if
from sklearn.utils.validation import check_is_fitted

from lcorpp.errors import DataError
from lcorpp.learning.classifiers.contract import fitted, predicted
from lcorpp.learning.data.dataset import check_tracks
from lcorpp.learning.features.motion import Motion, Scaling
from lcorpp.values import Array

LEAST = 1e-12
"""Probabilities below this count as this where they are mixed by their logarithms."""


@dataclass(frozen=True, eq=False)
class AgesState:
    """What is remembered of n tracks: the state of each classifier, and (n,) how many points there were."""

    states: tuple[Any, ...]
    points: npt.NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.points)

    def take(self, rows: npt.ArrayLike) -> AgesState:
        """A copy of the states of some of the tracks. rows: (k,) indices."""
        return AgesState(tuple(state.take(rows) for state in self.states), self.points[np.asarray(rows)])

    def put(self, rows: npt.ArrayLike, state: AgesState) -> None:
        """Take over the states of some of the tracks, in place. rows: (k,) where the k of `state` belong."""
        for mine, other in zip(self.states, state.states, strict=True):
            mine.put(rows, other)
        self.points[np.asarray(rows)] = state.points


def _carries(ages: ByAge) -> bool:
    return all(hasattr(ages.classifier, name) for name in ("begin", "advance"))


class ByAge(ClassifierMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn has no types
    """Several copies of a classifier, each trained on another share of the tracks from their beginning.

    What was learnt from whole tracks is of little use after a quarter of one. A track is judged by the two
    copies whose age is next to its own, mixed by the logarithms of their probabilities in proportion to how
    near they are; one that is younger or older than all of them by the nearest alone.

    Args:
        classifier: of tracks of any length; cloned for every age. If it carries a state, so does this.
        shares: the ages, as shares of the tracks in training.

    Attributes:
        classes_: (K,) the class names, after `fit`. classifiers_, lengths_: the copies, and the points of the
        tracks each was trained on.
    """

    def __init__(self, classifier: Any, *, shares: Sequence[float] = (0.25, 0.5, 0.75, 1.0)) -> None:
        self.classifier = classifier
        self.shares = shares

    def fit(self, X: npt.ArrayLike, y: npt.ArrayLike) -> Self:
        """Train every copy.

        Args:
            X: (cases, rows, points). y: (cases,) class names.

        Raises:
            DataError: X is malformed, a share is out of range or two leave the same, or the classifier fails.
        """
        tracks = check_tracks(X)
        if not len(self.shares) or not all(0 < share <= 1 for share in self.shares):
            raise DataError(f"the ages are shares in (0, 1], not {tuple(self.shares)}")
        lengths = [max(2, round(share * tracks.shape[2])) for share in self.shares]
        if any(later <= sooner for sooner, later in pairwise(lengths)):
            raise DataError(f"the ages {tuple(self.shares)} are {lengths} points; expected rising numbers")
        self.classifiers_ = [fitted(self.classifier, tracks[:, :, :length], y) for length in lengths]
        self.lengths_ = np.array(lengths, dtype=np.float64)
        self.classes_ = self.classifiers_[0].classes_
        return self

    def predict_proba(self, X: npt.ArrayLike) -> Array:
        """(cases, K) the probability of each of `classes_` for tracks (cases, rows, points) of any length.

        Raises:
            DataError: X is malformed, or the classifier fails.
        """
        check_is_fitted(self, "classifiers_")
        tracks = check_tracks(X)
        weights = self._weights(np.full(len(tracks), tracks.shape[2]))
        said = np.full((len(self.classifiers_), len(tracks), len(self.classes_)), 1.0)
        for copy in np.flatnonzero(weights.any(axis=0)):
            said[copy] = predicted(self.classifiers_[copy], tracks)
        return _mixed(said, weights)

    def predict(self, X: npt.ArrayLike) -> npt.NDArray[Any]:
        """(cases,) the most probable of `classes_`."""
        return np.asarray(self.classes_[self.predict_proba(X).argmax(axis=1)])

    @available_if(_carries)  # type: ignore[untyped-decorator]
    def begin(self, n: int = 1) -> AgesState:
        """The state before the first point of n tracks, for `advance`."""
        check_is_fitted(self, "classifiers_")
        states = tuple(classifier.begin(n) for classifier in self.classifiers_)
        return AgesState(states, np.zeros(n, dtype=np.intp))

    @available_if(_carries)  # type: ignore[untyped-decorator]
    def advance(self, state: AgesState, points: npt.ArrayLike) -> Array:
        """(n, K) the probabilities after one more point (n, rows) of n tracks; `state` is changed in place.

        All copies follow all tracks, so a point costs as many steps as there are ages.
        """
        said = np.stack(
            [
                classifier.advance(one, points)
                for classifier, one in zip(self.classifiers_, state.states, strict=True)
            ]
        )
        state.points[:] += 1
        return _mixed(said, self._weights(state.points))

    def _weights(self, points: npt.NDArray[np.intp]) -> Array:
        """(n, ages) the part each copy has in judging tracks of so many points."""
        place = np.interp(points, self.lengths_, np.arange(len(self.lengths_)))
        return np.asarray(np.maximum(0, 1 - np.abs(place[:, None] - np.arange(len(self.lengths_)))))


def at_every_age(pipeline: Pipeline, *, shares: Sequence[float] = (0.25, 0.5, 0.75, 1.0)) -> Pipeline:
    """A pipeline, not trained, that has one classifier for every age: `ByAge` around all behind the scaling.

    Raises:
        DataError: there is nothing behind `Motion` and `Scaling`.
    """
    steps = list(pipeline.steps)
    kept = list(takewhile(lambda step: isinstance(step[1], Motion | Scaling), steps))
    rest = steps[len(kept) :]
    if not rest:
        raise DataError("the pipeline has no classifier to train for every age")
    classifier = rest[0][1] if len(rest) == 1 else Pipeline(rest)
    return clone(Pipeline([*kept, (rest[-1][0], ByAge(classifier, shares=shares))]))


def _mixed(said: Array, weights: Array) -> Array:
    """(n, K) distributions said (ages, n, K), mixed by weights (n, ages)."""
    logs = np.log(np.maximum(said, LEAST))
    return np.asarray(softmax(np.einsum("na,ank->nk", weights, logs), axis=1))
