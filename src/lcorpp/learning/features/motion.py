"""From raw tracks to what a classifier may see of them: motion, not place.

Both steps are scikit-learn transformers on arrays (cases, channels, time points), so they stand in a
Pipeline and whatever they estimate is estimated from training data alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from lcorpp.errors import DataError
from lcorpp.learning.data.dataset import check_tracks
from lcorpp.learning.features.channels import ANGLES, Points, Pose, check_channels, rows_of, told
from lcorpp.learning.features.resampling import Places, between, check_rate, places, regular
from lcorpp.values import Array


class Motion(TransformerMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn has no types
    """Tracks at a fixed rate, as the robot sees them, relative to where they begin.

    Where a track lies in the room often gives its label away (see `leaks`); how it moves does not. Point j of
    the result is what was known of the person j / rate seconds after the first sample: nothing looks ahead,
    so that the beginning of a track gives the beginning of its result, number for number. 304 points .033
    seconds apart become 30 at 3 a second, as in the paper.

    The channels, each made of one number or of two:

    - x, y: the way from the first point, metres ahead of the robot and to its left;
    - velocity: the speed, m/s; without such an input, over the way from the point before, 0 at the first;
    - heading: cosine and sine of the direction of motion, anticlockwise from where the robot looks; without
      such an input, of the way from the point before. (0, 0) where there is no motion;
    - facing: the same of the direction in which the body or head is turned, which has to be an input;
    - approach: cosine and sine of heading relative to the direction to the robot: (1, 0) comes straight on;
    - attention: the same of facing: (1, 0) looks at the robot;
    - distance: metres from the robot;
    - bearing: cosine and sine of the direction in which the robot sees the person.

    The last four say where somebody is, not only how they move: they tell more of intention, and on data that
    leaks its label by place they learn the leak. The others are the same wherever the track lies.

    Args:
        rate: points per second that come out.
        interval: seconds between two time points of the tracks that come in.
        channels: what comes out, in this order.
        inputs: what the channels of the tracks are: among x and y (m), velocity (m/s), heading and facing
            (radians, anticlockwise from the x axis).
        robot: where the robot stands in the frame of the tracks: x, y (m), and where it looks (radians).

    Attributes:
        rows_: the names of the channels of the result, such as heading_cos, after `fit`.
    """

    def __init__(
        self,
        *,
        rate: float = 3.0,
        interval: float = 0.033,
        channels: Sequence[str] = ("x", "y"),
        inputs: Sequence[str] = ("x", "y"),
        robot: Pose = (0.0, 0.0, 0.0),
    ) -> None:
        self.rate = rate
        self.interval = interval
        self.channels = channels
        self.inputs = inputs
        self.robot = robot

    def fit(self, X: npt.ArrayLike, y: object = None) -> Self:
        """Check the parameters and that X (cases, inputs, time points) is of their kind; nothing is learnt.

        Raises:
            DataError: X is not of that kind, or a parameter is out of range or does not fit another.
        """
        self._check()
        tracks = check_tracks(X)
        if tracks.shape[1] != len(self.inputs):
            raise DataError(
                f"the inputs are {', '.join(self.inputs)}, but the tracks have {tracks.shape[1]} channels"
            )
        self._places(tracks.shape[2])
        self.rows_ = rows_of(self.channels)
        return self

    def transform(self, X: npt.ArrayLike) -> Array:
        """(cases, len(rows_), points) the motion of X.

        Raises:
            DataError: X is not of shape (cases, inputs, samples), not finite, or shows less than two points.
        """
        check_is_fitted(self, "rows_")
        tracks = _with_channels(X, len(self.inputs))
        return self.of_points(between(tracks, self._places(tracks.shape[2]), self.angles))

    def transform_stamped(self, times: npt.ArrayLike, samples: npt.ArrayLike) -> Array:
        """(1, len(rows_), points) the motion of one track whose samples have their own times.

        It is what `streaming` gives the classifier of such a track, and what `transform` gives of one whose
        samples are `interval` apart.

        Args:
            times: (samples,) seconds, increasing. samples: (inputs, samples).

        Raises:
            DataError: as of `resampling.regular`, or there are other inputs.
        """
        check_is_fitted(self, "rows_")
        track = np.asarray(samples, dtype=np.float64)
        if len(track) != len(self.inputs):
            raise DataError(
                f"the inputs are {', '.join(self.inputs)}, but the track has {len(track)} channels"
            )
        return self.of_points(regular(times, track, self.rate, angles=self.angles)[None])

    def of_points(self, now: Array) -> Array:
        """(cases, rows, points) the motion of whole tracks (cases, inputs, points) at the fixed rate."""
        before = np.concatenate([now[..., :1], now[..., :-1]], axis=2)
        return self.told(now, before, now[..., :1])

    def told(self, now: Array, before: Array, first: Array) -> Array:
        """(..., rows, points) what the channels tell of points (..., inputs, points) at the fixed rate.

        Args:
            now: the points. before: the one before each, itself for a first one. first: that of each track.
        """
        points = Points(now, before, first, inputs=self.inputs, robot=self.robot, rate=self.rate)
        return told(self.channels, points)

    @property
    def angles(self) -> tuple[int, ...]:
        """Which of the inputs are angles, by their places."""
        return tuple(index for index, name in enumerate(self.inputs) if name in ANGLES)

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """What was fitted, for `storage`."""
        return {"rows": np.array(self.rows_)}

    def from_arrays(self, arrays: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Take over what `to_arrays` gave.

        Raises:
            DataError: the parameters are not those with which it was fitted.
        """
        self._check()
        self.rows_ = rows_of(self.channels)
        if arrays["rows"].tolist() != list(self.rows_):
            raise DataError(f"the channels give {', '.join(self.rows_)}, not {arrays['rows'].tolist()}")
        return self

    def _check(self) -> None:
        check_rate(self.rate)
        if not 0 < self.interval < float("inf"):
            raise DataError(f"the interval is {self.interval} s; expected a finite number above 0")
        check_channels(self.channels, self.inputs)
        if len(self.robot) != 3 or not np.isfinite(np.asarray(self.robot, dtype=np.float64)).all():
            raise DataError(f"the robot's pose is {self.robot}; expected x, y and heading, finite")

    def _places(self, samples: int) -> Places:
        where = places(np.arange(samples, dtype=np.float64) * self.interval, self.rate)
        if len(where[0]) < 2:
            raise DataError(
                f"{samples} time points {self.interval:g} s apart last {(samples - 1) * self.interval:.3g} s;"
                f" motion at {self.rate:g} points per second begins after {1 / self.rate:.3g} s"
            )
        return where


class Scaling(TransformerMixin, BaseEstimator):  # type: ignore[misc]
    """Every channel brought to mean 0 and deviation 1 over all cases and times of the training data.

    Millimetres or tens of metres would saturate the gates of an LSTM.
    """

    def fit(self, X: npt.ArrayLike, y: object = None) -> Self:
        """Estimate mean and deviation of each channel of X (cases, channels, time points)."""
        tracks = check_tracks(X)
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
        return self.scaled(tracks)

    def scaled(self, tracks: Array) -> Array:
        """`tracks` (..., channels, time points) on the scale of the training data, as they are."""
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
    tracks = check_tracks(X)
    if tracks.shape[1] != channels:
        raise DataError(f"trained on tracks of {channels} channels, given {tracks.shape[1]}")
    return tracks
