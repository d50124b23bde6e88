"""From raw tracks to what a classifier may see of them: motion, not place.

Both steps are scikit-learn transformers on arrays (cases, channels, time points), so they stand in a
Pipeline and whatever they estimate is estimated from training data alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from sklearn.base import BaseEstimator, TransformerMixin

from lcorpp.errors import DataError
from lcorpp.learning.dataset import checked_tracks
from lcorpp.values import Array

PLACE = 2
"""The first channels are x and y: they are taken relative to the first point, others stay as they are."""


class Motion(TransformerMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn has no types
    """Positions relative to where the track begins, at `points` times evenly spread over it.

    Where a track lies in the room often gives its label away (see `leaks`); how it moves does not. Tracks
    of any length come out with the same number of points, by linear interpolation from first to last.

    Args:
        points: time points that come out; 30 as in the paper.
    """

    def __init__(self, *, points: int = 30) -> None:
        self.points = points

    def fit(self, X: npt.ArrayLike, y: object = None) -> Self:
        """Remember the number of channels of X (cases, channels, time points), metres, x and y first.

        Raises:
            DataError: X is not of that kind, or `points` is below 2.
        """
        if self.points < 2:
            raise DataError(f"motion needs at least 2 points, not {self.points}")
        self.channels_ = checked_tracks(X).shape[1]
        return self

    def transform(self, X: npt.ArrayLike) -> Array:
        """(cases, channels, points) the motion of X.

        Raises:
            DataError: X is not of shape (cases, channels, time points), not finite, or has other channels.
        """
        tracks = _with_channels(X, self.channels_)
        at = np.linspace(0, tracks.shape[2] - 1, self.points)
        before = np.minimum(at.astype(np.intp), tracks.shape[2] - 2)
        share = at - before
        motion: Array = tracks[:, :, before] * (1 - share) + tracks[:, :, before + 1] * share
        motion[:, :PLACE] -= tracks[:, :PLACE, :1]
        return motion

    def to_arrays(self) -> dict[str, Array]:
        """What was fitted, for `storage`."""
        return {"channels": np.array(float(self.channels_))}

    def from_arrays(self, arrays: Mapping[str, Array]) -> Self:
        """Take over what `to_arrays` gave."""
        self.channels_ = int(arrays["channels"])
        return self


class Scaling(TransformerMixin, BaseEstimator):  # type: ignore[misc]
    """Every channel brought to mean 0 and deviation 1 over all cases and times of the training data.

    Millimetres or tens of metres would saturate the gates of an LSTM.
    """

    def fit(self, X: npt.ArrayLike, y: object = None) -> Self:
        """Estimate mean and deviation of each channel of X (cases, channels, time points)."""
        tracks = checked_tracks(X)
        self.mean_: Array = tracks.mean(axis=(0, 2))
        deviation = tracks.std(axis=(0, 2))
        self.scale_: Array = np.where(deviation > 0, deviation, 1.0)  # a constant channel becomes 0
        return self

    def transform(self, X: npt.ArrayLike) -> Array:
        """X (cases, channels, time points) on the scale of the training data.

        Raises:
            DataError: X is not of that shape, not finite, or has other channels.
        """
        tracks = _with_channels(X, len(self.mean_))
        return np.asarray((tracks - self.mean_[:, None]) / self.scale_[:, None], dtype=np.float64)

    def to_arrays(self) -> dict[str, Array]:
        """What was fitted, for `storage`."""
        return {"mean": self.mean_, "scale": self.scale_}

    def from_arrays(self, arrays: Mapping[str, Array]) -> Self:
        """Take over what `to_arrays` gave.

        Raises:
            DataError: the arrays do not belong together.
        """
        self.mean_, self.scale_ = arrays["mean"], arrays["scale"]
        if (
            self.mean_.ndim != 1
            or self.mean_.shape != self.scale_.shape
            or not np.all(self.scale_ > 0)
            or not np.all(np.isfinite([self.mean_, self.scale_]))
        ):
            raise DataError("a scaling needs one finite mean and one positive deviation for each channel")
        return self


def _with_channels(X: Any, channels: int) -> Array:
    tracks = checked_tracks(X)
    if tracks.shape[1] != channels:
        raise DataError(f"trained on tracks of {channels} channels, given {tracks.shape[1]}")
    return tracks
