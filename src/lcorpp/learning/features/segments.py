"""Segment statistics: a long series as a short one, with the statistics of each segment as channels."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from lcorpp.learning.data.dataset import check_tracks
from lcorpp.values import Array, measure_lengths


class SegmentStatistics(TransformerMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn has no types
    """Divide series into segments of equal duration, for networks that learn little from hundreds of points.

    A segment has four rows for each channel: mean, standard deviation, minimum and maximum. Series that are
    short enough stay as they are. A prefix of whole segments gives a prefix of the result.

    Args:
        points: the largest number of segments of a training series.

    Attributes:
        width_: the time points of a segment, set by `fit`; the last of a series may have fewer.
    """

    def __init__(self, *, points: int = 30) -> None:
        self.points = points

    def fit(self, X: npt.ArrayLike, y: object = None) -> Self:
        """Choose the width of the segments for X (cases, channels, time points).

        Raises:
            DataError: X is malformed.
        """
        longest = int(measure_lengths(check_tracks(X)).max())
        self.width_ = -(-longest // self.points)
        return self

    def transform(self, X: npt.ArrayLike) -> Array:
        """(cases, 4 channels, segments) the statistics of X, or X itself if its points are the segments.

        Raises:
            DataError: X is malformed.
        """
        check_is_fitted(self, "width_")
        tracks, width = check_tracks(X), self.width_
        if width == 1:
            return tracks
        longest = int(measure_lengths(tracks).max())
        segments = -(-longest // width)
        padding = [(0, 0), (0, 0), (0, segments * width - longest)]
        padded = np.pad(tracks[:, :, :longest], padding, constant_values=np.nan)
        parts = padded.reshape(*tracks.shape[:2], segments, width)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # the segments after the end of a track are NaN
            rows = [reduce(parts, axis=3) for reduce in (np.nanmean, np.nanstd, np.nanmin, np.nanmax)]
        return np.concatenate(rows, axis=1)

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The fitted state, for `storage`."""
        check_is_fitted(self, "width_")
        return {"width": np.array(self.width_)}

    def restore_arrays(self, arrays: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Restore the state that `to_arrays` returned."""
        self.width_ = int(arrays["width"])
        return self
