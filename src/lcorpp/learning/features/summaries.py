"""A track as some fifty numbers: how fast, how steadily, how straight, and how that changed on the way."""

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
from lcorpp.values import Array

PARTS = 4
"""Parts of the track, of equal time, that are told one by one."""

STILL = 0.1
"""m/s below which a direction is noise, so that it counts as kept."""


class Summaries(TransformerMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn has no types
    """What a person did on the way, in numbers that a classifier without memory can use.

    It stands behind `Motion`, whose first two rows have to be x and y. From these are made speed (m/s), its
    change (m/s²), turning (radians from point to point), the two components of velocity and the distance
    from the first point; other rows are taken as they are. Of each: the mean in each of four parts of the
    track, the deviation, the extremes and the last value. Then the length of the way, the part of it that
    was made good, and the share of time standing still.

    Args:
        rate: points per second of the tracks that come in.

    Attributes:
        rows_: how many rows come in, after `fit`.
    """

    def __init__(self, *, rate: float = 3.0) -> None:
        self.rate = rate

    def fit(self, X: npt.ArrayLike, y: object = None) -> Self:
        """Check that X (cases, rows, points) begins with x and y; nothing is learnt.

        Raises:
            DataError: it has fewer rows than two, or is no array of finite tracks.
        """
        tracks = check_tracks(X)
        if tracks.shape[1] < 2:
            raise DataError(f"summaries need x and y, and the tracks have {tracks.shape[1]} channels")
        self.rows_ = int(tracks.shape[1])
        return self

    def transform(self, X: npt.ArrayLike) -> Array:
        """(cases, features) the summaries of X.

        Raises:
            DataError: X is not of the kind it was fitted to.
        """
        check_is_fitted(self, "rows_")
        tracks = check_tracks(X)
        if tracks.shape[1] != self.rows_:
            raise DataError(f"fitted to tracks of {self.rows_} channels, given {tracks.shape[1]}")
        steps = np.diff(tracks[:, :2], axis=2) * self.rate
        speed = np.hypot(steps[:, 0], steps[:, 1])
        turning = _turning(steps, speed)
        distance = np.hypot(tracks[:, 0], tracks[:, 1])
        told = [
            speed,
            np.diff(speed, axis=1, prepend=speed[:, :1]) * self.rate,
            turning,
            np.abs(turning),
            steps[:, 0],
            np.abs(steps[:, 0]),
            steps[:, 1],
            distance,
            *(tracks[:, row] for row in range(2, self.rows_)),
        ]
        way = speed.sum(axis=1) / self.rate
        whole = [way, distance[:, -1] / np.maximum(way, STILL), (speed < 2 * STILL).mean(axis=1)]
        return np.concatenate([*(_statistics(values) for values in told), np.stack(whole, axis=1)], axis=1)

    def to_arrays(self) -> dict[str, Array]:
        """What was fitted, for `storage`."""
        return {"rows": np.array(float(self.rows_))}

    def from_arrays(self, arrays: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Take over what `to_arrays` gave."""
        self.rows_ = int(arrays["rows"])
        return self


def _turning(steps: Array, speed: Array) -> Array:
    """(cases, points - 1) the change of direction at each step (cases, 2, points - 1), 0 where one stands."""
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    change = np.diff(heading, axis=1, prepend=heading[:, :1])
    change = (change + np.pi) % (2 * np.pi) - np.pi
    moving = np.minimum(speed, np.concatenate([speed[:, :1], speed[:, :-1]], axis=1)) > STILL
    return np.where(moving, change, 0.0)


def _statistics(values: Array) -> Array:
    """(cases, PARTS + 4) means in parts of the time, deviation, extremes and end, of (cases, points)."""
    points = values.shape[1]
    ends = np.linspace(0, points, PARTS + 1).round().astype(int)
    parts = [
        values[:, min(first, points - 1) : max(last, first + 1)].mean(axis=1)
        for first, last in pairwise(ends.tolist())
    ]
    others = [values.std(axis=1), values.min(axis=1), values.max(axis=1), values[:, -1]]
    return np.stack([*parts, *others], axis=1)
