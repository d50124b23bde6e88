"""Resampling of a track to a fixed rate by linear interpolation, without looking ahead.

Point j of the result is the track j / rate seconds after its first sample: the first sample at or after that
time, or the linear interpolation between that sample and its predecessor. A point is known as soon as that
sample arrives, and a prefix of a track gives a prefix of its points, so a classifier trained on whole tracks
can classify running ones.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError
from lcorpp.learning.features.rate import check_rate
from lcorpp.values import Array, wrap_angle

SAME_TIME = 1e-6
"""Seconds; times that differ by less are treated as equal. Times since 1970 have a floating-point resolution
of 2e-7."""

MAX_POINTS = 10_000_000
"""The maximal number of points of a track: milliseconds taken for seconds would need too much memory."""

InterpolationWeights = tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Array]
"""(points,) each: index of the sample before, index of the sample after, and weight of the sample after."""


@check_arguments
def resample(
    times: npt.ArrayLike, samples: npt.ArrayLike, rate: float, *, angles: Sequence[int] = ()
) -> Array:
    """Resample one track to `rate` points per second, starting at its first sample.

    Args:
        times: (samples,) seconds, increasing, of any origin; gaps of any length are interpolated linearly.
        samples: (channels, samples).
        rate: points per second.
        angles: indices of the channels that are angles in radians; they are interpolated the shorter way
            round.

    Returns:
        (channels, points); angles may leave [-pi, pi].

    Raises:
        DataError: `rate` is out of range, shapes do not match, a number is not finite, times do not increase,
            or the track has more than `MAX_POINTS` points.

    Examples:
        >>> from lcorpp.learning import resample
        >>> resample([10.0, 10.5, 12.0], [[0.0, 1.0, 4.0]], rate=2).tolist()  # x at three times
        [[0.0, 1.0, 2.0, 3.0, 4.0]]
    """
    check_rate(rate)
    stamps = np.asarray(times, dtype=np.float64)
    track = np.asarray(samples, dtype=np.float64)
    if stamps.ndim != 1 or not len(stamps) or track.ndim != 2 or track.shape[1] != len(stamps):
        raise DataError(
            f"expected times (samples,) and samples (channels, samples), not {stamps.shape} and {track.shape}"
        )
    for name, bad in (("its time", ~np.isfinite(stamps)), ("it", ~np.isfinite(track).all(axis=0))):
        if bad.any():
            raise DataError(f"sample {int(bad.argmax())} (counted from 0): {name} is not finite")
    steps = np.diff(stamps)
    if len(steps) and steps.min() <= 0:
        late = int((steps <= 0).argmax()) + 1
        raise DataError(
            f"sample {late} (counted from 0) has time {stamps[late]:g} s, its predecessor"
            f" {stamps[late - 1]:g} s; expected increasing times"
        )
    elapsed = stamps - stamps[0]
    if elapsed[-1] * rate >= MAX_POINTS:
        raise DataError(f"the track lasts {elapsed[-1]:g} s; expected less than {MAX_POINTS / rate:g} s")
    return interpolate(track, compute_interpolation_weights(elapsed, rate), angles)


def compute_interpolation_weights(elapsed: Array, rate: float) -> InterpolationWeights:
    """Compute the weights that interpolate samples at times `elapsed` (samples,) to a fixed rate.

    elapsed: seconds since the first sample. rate: points per second.
    """
    at = np.arange(int(elapsed[-1] * rate) + 2) / rate
    after = np.searchsorted(elapsed, at - SAME_TIME)
    known = after < len(elapsed)
    at, after = at[known], after[known]
    before = np.maximum(after - 1, 0)
    span = np.where(after > before, elapsed[after] - elapsed[before], 1.0)
    weight = np.where(elapsed[after] <= at, 1.0, (at - elapsed[before]) / span)
    return before, after, weight


def interpolate(tracks: Array, weights: InterpolationWeights, angles: Sequence[int] = ()) -> Array:
    """(..., channels, points) the `tracks` (..., channels, samples), interpolated."""
    before, after, weight = weights
    points: Array = tracks[..., before] * (1 - weight) + tracks[..., after] * weight
    for channel in angles:
        start, end = tracks[..., channel, before], tracks[..., channel, after]
        points[..., channel, :] = start + wrap_angle(end - start) * weight
    return points
