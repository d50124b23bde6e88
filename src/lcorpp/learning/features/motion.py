"""Motion preprocessing: raw tracks -> motion features at a fixed rate (`Motion`), standardized.

`Motion` and `ChannelStandardizer` are scikit-learn transformers on arrays (cases, channels, time points) for
use in a Pipeline, so that everything they estimate is estimated from training data only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.utils.validation import check_is_fitted

from lcorpp.arguments import check_value, to_numbers
from lcorpp.errors import DataError
from lcorpp.learning.data.dataset import check_tracks
from lcorpp.learning.features.motion_features import (
    ANGLES,
    Pose,
    TrackHistory,
    TrackPoints,
    check_features,
    compute_features,
    list_feature_rows,
)
from lcorpp.learning.features.rate import RATE, check_rate
from lcorpp.learning.features.resampling import (
    SAME_TIME,
    compute_interpolation_weights,
    interpolate,
    resample,
)
from lcorpp.values import Array, measure_lengths


class Motion(TransformerMixin, BaseEstimator):  # type: ignore[misc]  # scikit-learn has no types
    """Motion features of tracks at a fixed rate, in the robot's frame and relative to the first point.

    The place of a track often leaks its label (see `leakage`); its motion does not. Point j of the result
    uses no sample later than the first one at or after j / rate seconds, so a prefix of a track gives a
    prefix of the result, number for number. 304 samples .033 seconds apart become 30 points at 3 per second:
    as many as the paper's network reads, over ten seconds.

    The features, each of one or two numbers:

    - x, y: displacement from the first point, metres ahead of the robot and to its left;
    - velocity: speed in m/s, not a vector (the channel's name in the data); without such an input, distance
      from the previous point over time, 0 at the first;
    - heading: cosine and sine of the direction of motion, anticlockwise from the robot's heading; without
      such an input, the direction from the previous point. (0, 0) if there is no motion;
    - facing: the same for the direction of the body or head, which has to be an input;
    - acceleration: change of speed, m/s²;
    - turn_rate: change of heading, radians per second anticlockwise; 0 while standing;
    - ahead, left: displacement from the first point in the person's own frame, whose axis points from the
      first point to the first one half a metre away from it (until then, to the person);
    - facing_ahead: cosine and sine of facing relative to heading: (1, 0) if the person looks ahead;
    - approach: cosine and sine of heading relative to the direction to the robot: (1, 0) if the person walks
      straight to it;
    - attention: the same for facing: (1, 0) if the person looks at the robot;
    - distance: metres from the robot; distance_rate: its change, m/s;
    - bearing: cosine and sine of the direction from the robot to the person; bearing_rate: its change,
      radians per second anticlockwise;
    - gaze_angle: angle between the face and the direction to the robot, radians; gaze_rate: its change,
      radians per second; looks: 1 if the angle is at most 20 degrees, else 0, so that its mean over time is
      the share of the time in which the person looks at the robot;
    - mutual_gaze: how much person and robot look at each other, from 0 to 1; social_engagement: the same over
      the distance in metres, at most 1 (Webb and others, 2022, see `features.gaze`);
    - face_distance: metres between the face and the robot's head; face_distance_rate: its change, m/s.

    The features of gaze need the inputs that trackers of faces measure, which are relative to the robot's
    head wherever it is. approach to bearing_rate depend on the place of a track: on data that leaks its label
    by place a classifier learns the leak. x, y, heading and facing depend on the direction in which the robot
    stands.
    The others depend on the person alone, so a classifier that was trained at one place works at another.

    Args:
        rate: points per second of the result.
        interval: seconds between two time points of the input tracks.
        features: the features, in the order of the result.
        inputs: the channels of the input tracks: among x and y (m), velocity (m/s), heading and facing
            (radians, anticlockwise from the x axis), gaze_angle and robot_angle (radians), face_distance (m).
        robot: the robot's pose in the frame of the tracks: x, y (m) and heading (radians).

    Attributes:
        rows_: the names of the rows of the result, such as heading_cos, set by `fit`.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.learning import Motion
        >>> walk = np.outer([1.2, 0.0], np.arange(31) / 30)  # x and y of a second's walk ahead at 1.2 m/s
        >>> motion = Motion(rate=2, interval=1 / 30, features=["x", "velocity"])
        >>> motion.fit_transform([walk]).round(3).tolist()
        [[[0.0, 0.6, 1.2], [0.0, 1.2, 1.2]]]
    """

    def __init__(
        self,
        *,
        rate: float = RATE,
        interval: float = 0.033,
        features: Sequence[str] = ("x", "y"),
        inputs: Sequence[str] = ("x", "y"),
        robot: Pose = (0.0, 0.0, 0.0),
    ) -> None:
        self.rate = rate
        self.interval = interval
        self.features = features
        self.inputs = inputs
        self.robot = robot

    def fit(self, X: npt.ArrayLike, y: object = None) -> Self:
        """Check the parameters and X (cases, inputs, time points); nothing is estimated.

        Raises:
            DataError: X does not match `inputs`, or a parameter is out of range or does not match another.
        """
        self._check_parameters()
        tracks = check_tracks(X)
        if tracks.shape[1] != len(self.inputs):
            raise DataError(
                f"the inputs are {', '.join(self.inputs)}, but the tracks have {tracks.shape[1]} channels"
            )
        self._check_durations(tracks)
        self.rows_ = list_feature_rows(self.features)
        return self

    def transform(self, X: npt.ArrayLike) -> Array:
        """(cases, len(rows_), points) the motion features of X (cases, inputs, samples).

        A shorter track has fewer points, the same as alone, and is padded with NaN like X.

        Raises:
            DataError: X is not of shape (cases, inputs, samples), not finite, or a track has fewer than two
                points.
        """
        check_is_fitted(self, "rows_")
        tracks = check_tracks(X, len(self.inputs))
        self._check_durations(tracks)
        elapsed = np.arange(tracks.shape[2], dtype=np.float64) * self.interval
        weights = compute_interpolation_weights(elapsed, self.rate)
        return self.transform_points(interpolate(tracks, weights, self.angles))

    def transform_stamped(self, times: npt.ArrayLike, values: npt.ArrayLike) -> Array:
        """(1, len(rows_), points) the motion features of one track with a time stamp for each sample.

        `StreamingClassifier` computes the same points for such a track, and `transform` for samples that are
        `interval` apart.

        Args:
            times: (samples,) seconds, increasing. values: (inputs, samples).

        Raises:
            DataError: as `resample`, or the number of channels does not match `inputs`.
        """
        check_is_fitted(self, "rows_")
        track = np.asarray(values, dtype=np.float64)
        if len(track) != len(self.inputs):
            raise DataError(
                f"the inputs are {', '.join(self.inputs)}, but the track has {len(track)} channels"
            )
        return self.transform_points(resample(times, track, self.rate, angles=self.angles)[None])

    def transform_points(self, points: Array) -> Array:
        """(cases, rows, points) the features of whole tracks (cases, inputs, points) at the fixed rate."""
        return self.compute_features(points, TrackHistory.of_tracks(points, self.inputs))

    def compute_features(self, points: Array, history: TrackHistory) -> Array:
        """(..., rows, points) the features of points (..., inputs, points) at the fixed rate."""
        track_points = TrackPoints(points, history, self.inputs, self.robot, self.rate)
        return compute_features(self.features, track_points)

    @property
    def angles(self) -> tuple[int, ...]:
        """The indices of the inputs that are angles."""
        return tuple(index for index, name in enumerate(self.inputs) if name in ANGLES)

    def to_arrays(self) -> dict[str, npt.NDArray[Any]]:
        """The fitted state, for `storage`."""
        return {"rows": np.array(self.rows_)}

    def restore_arrays(self, arrays: Mapping[str, npt.NDArray[Any]]) -> Self:
        """Restore the state that `to_arrays` returned.

        Raises:
            DataError: the rows do not match the parameters.
        """
        self._check_parameters()
        self.rows_ = list_feature_rows(self.features)
        if arrays["rows"].tolist() != list(self.rows_):
            raise DataError(f"the features give {', '.join(self.rows_)}, not {arrays['rows'].tolist()}")
        return self

    def _check_parameters(self) -> None:
        check_rate(self.rate)
        check_value(self.interval, float, "the interval")
        if not 0 < self.interval < float("inf"):
            raise DataError(f"the interval is {self.interval} s; expected a finite number above 0")
        check_features(self.features, self.inputs)
        pose = to_numbers(self.robot, "the robot's pose")
        if pose.shape != (3,) or not np.isfinite(pose).all():
            raise DataError(f"the robot's pose is {self.robot}; expected x, y and heading, finite")

    def _check_durations(self, tracks: Array) -> None:
        """Raise a DataError if a track has fewer than two points at the fixed rate."""
        lengths = measure_lengths(tracks)
        samples, case = int(lengths.min()), int(lengths.argmin())
        duration = (samples - 1) * self.interval
        if duration < 1 / self.rate - SAME_TIME:
            raise DataError(
                f"case {case} (counted from 0): {samples} time points {self.interval:g} s apart last"
                f" {duration:.3g} s; motion at {self.rate:g} points per second needs more than"
                f" {1 / self.rate:.3g} s"
            )


class ChannelStandardizer(TransformerMixin, BaseEstimator):  # type: ignore[misc]
    """Standardize each channel to mean 0 and standard deviation 1 over all training cases and times.

    Unscaled millimetres, or tens of metres, would saturate the gates of an LSTM.

    Examples:
        >>> from lcorpp.learning import ChannelStandardizer
        >>> tracks = [[[1000.0, 3000.0]], [[5000.0, 7000.0]]]  # millimetres: (cases, channels, time points)
        >>> ChannelStandardizer().fit_transform(tracks).round(3).tolist()
        [[[-1.342, -0.447]], [[0.447, 1.342]]]
    """

    def fit(self, X: npt.ArrayLike, y: object = None) -> Self:
        """Estimate mean and standard deviation of each channel of X (cases, channels, time points).

        The padding of shorter tracks does not count.
        """
        tracks = check_tracks(X)
        self.mean_: Array = np.nanmean(tracks, axis=(0, 2))
        deviation = np.nanstd(tracks, axis=(0, 2))
        # a constant channel becomes 0; its deviation may be a rounding error
        self.scale_: Array = np.where(deviation > 1e-12 * np.abs(self.mean_), deviation, 1.0)
        return self

    def transform(self, X: npt.ArrayLike) -> Array:
        """X (cases, channels, time points), standardized.

        Raises:
            DataError: X does not have that shape, is not finite, or has other channels than the training
                data.
        """
        return self.standardize(check_tracks(X, len(self.mean_)))

    def standardize(self, tracks: Array) -> Array:
        """`tracks` (..., channels, time points), standardized; the input is not checked."""
        return np.asarray((tracks - self.mean_[:, None]) / self.scale_[:, None], dtype=np.float64)

    def to_arrays(self) -> dict[str, Array]:
        """The fitted state, for `storage`."""
        return {"mean": self.mean_, "scale": self.scale_}

    def restore_arrays(self, arrays: Mapping[str, Array]) -> Self:
        """Restore the state that `to_arrays` returned.

        Raises:
            DataError: the arrays do not match.
        """
        mean, scale = self.mean_, self.scale_ = arrays["mean"], arrays["scale"]
        is_valid = mean.ndim == 1 and mean.shape == scale.shape and np.isfinite([mean, scale]).all()
        if not is_valid or not (scale > 0).all():
            raise DataError(
                "standardization needs a finite mean and a positive standard deviation per channel"
            )
        return self
