"""Summary features: a track as numbers about its speed, turning, straightness and their change."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from lcorpp.errors import DataError
from lcorpp.learning.data.dataset import check_tracks
from lcorpp.learning.features.motion_features import MIN_SPEED
from lcorpp.values import Array, measure_lengths, wrap_angle

SEGMENTS = 4
"""Segments of equal duration, each with its own mean."""

STANDING_SPEED = 2 * MIN_SPEED
"""m/s; below this speed the person counts as standing still."""


class SummaryFeatures(TransformerMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn has no types
    """Statistics of a track for classifiers that take a fixed number of features.

    This step follows `Motion`, whose first two rows have to be x and y. It derives speed (m/s), acceleration
    (m/s²), turning and its size (radians per point), the components of velocity and the distance from the
    first point; other rows are used as they are. For each of them it gives the mean in each of four segments
    of the track, standard deviation, minimum, maximum and last value. Three more features are the path
    length, the straightness (distance from start to end over path length) and the fraction of time standing
    still.

    Args:
        rate: points per second of the tracks; None if they are not motion: then all rows are used as they
            are, and there are no further features.

    Attributes:
        rows_: number of rows of the tracks, set by `fit`.

    Examples:
        >>> from lcorpp.learning import SummaryFeatures
        >>> there_and_back = [[0.0, 1.0, 2.0, 1.0], [0.0, 0.0, 0.0, 0.0]]  # x and y in metres
        >>> features = SummaryFeatures(rate=1).fit_transform([there_and_back])
        >>> features[0, -3:].round(3).tolist()  # path length, straightness, fraction of time standing still
        [3.0, 0.333, 0.0]
    """

    def __init__(self, *, rate: float | None = 3.0) -> None:
        self.rate = rate

    def fit(self, X: npt.ArrayLike, y: object = None) -> Self:
        """Check X (cases, rows, points); nothing is estimated.

        Raises:
            DataError: X has fewer than two rows, or is not an array of finite tracks.
        """
        tracks = check_tracks(X)
        if self.rate is not None and tracks.shape[1] < 2:
            raise DataError(f"summary features need x and y; the tracks have {tracks.shape[1]} channels")
        self.rows_ = int(tracks.shape[1])
        return self

    def transform(self, X: npt.ArrayLike) -> Array:
        """(cases, features) the summary features of X; those of a padded track are those of its points.

        Raises:
            DataError: X does not have the rows that `fit` saw.
        """
        check_is_fitted(self, "rows_")
        tracks = check_tracks(X)
        if tracks.shape[1] != self.rows_:
            raise DataError(f"fitted to tracks of {self.rows_} channels, given {tracks.shape[1]}")
        lengths = measure_lengths(tracks)
        if lengths.min() == tracks.shape[2]:
            return self._summarize(tracks)
        groups = [np.flatnonzero(lengths == length) for length in np.unique(lengths)]
        parts = [self._summarize(tracks[rows, :, : lengths[rows[0]]]) for rows in groups]
        return np.concatenate(parts)[np.argsort(np.concatenate(groups))]

    def _summarize(self, tracks: Array) -> Array:
        """(cases, features) the summary features of tracks of equal length (cases, rows, points)."""
        rows = np.moveaxis(tracks, 1, 0)
        if self.rate is None:
            return np.concatenate([_compute_statistics(values) for values in rows], axis=1)
        velocity = np.diff(tracks[:, :2], axis=2) * self.rate
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        turning = _compute_turning(velocity, speed)
        distance = np.hypot(tracks[:, 0], tracks[:, 1])
        series = [
            speed,
            np.diff(speed, axis=1, prepend=speed[:, :1]) * self.rate,
            turning,
            np.abs(turning),
            velocity[:, 0],
            np.abs(velocity[:, 0]),
            velocity[:, 1],
            distance,
            *rows[2:],
        ]
        length = speed.sum(axis=1) / self.rate
        straightness = distance[:, -1] / np.maximum(length, MIN_SPEED)
        standing = (speed < STANDING_SPEED).mean(axis=1)
        whole = np.stack([length, straightness, standing], axis=1)
        return np.concatenate([*(_compute_statistics(values) for values in series), whole], axis=1)

    def to_arrays(self) -> dict[str, Array]:
        """The fitted state, for `storage`."""
        return {"rows": np.array(float(self.rows_))}

    def restore_arrays(self, arrays: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Restore the state that `to_arrays` returned."""
        self.rows_ = int(arrays["rows"])
        return self


def _compute_turning(velocity: Array, speed: Array) -> Array:
    """(cases, points - 1) change of direction of velocity (cases, 2, points - 1); 0 while standing."""
    heading = np.arctan2(velocity[:, 1], velocity[:, 0])
    change = wrap_angle(np.diff(heading, axis=1, prepend=heading[:, :1]))
    moving = np.minimum(speed, np.concatenate([speed[:, :1], speed[:, :-1]], axis=1)) > MIN_SPEED
    return np.where(moving, change, 0.0)


def _compute_statistics(values: Array) -> Array:
    """(cases, SEGMENTS + 4) segment means, deviation, minimum, maximum and last value of each row."""
    points = values.shape[1]
    ends = np.linspace(0, points, SEGMENTS + 1).round().astype(int)
    means = [
        values[:, min(first, points - 1) : max(last, first + 1)].mean(axis=1)
        for first, last in pairwise(ends.tolist())
    ]
    others = [values.std(axis=1), values.min(axis=1), values.max(axis=1), values[:, -1]]
    return np.stack([*means, *others], axis=1)
