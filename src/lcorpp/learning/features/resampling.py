"""A track at a fixed rate, whatever the times at which it was sampled; never a look ahead.

Point j of the result is the track j / rate seconds after its first sample: the first sample that is as late
as that, or a point on the line from the sample before it. So it is known as soon as that sample is there, and
the beginning of a track gives the beginning of its points: what is learnt from whole tracks can be asked
about running ones.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError
from lcorpp.values import Array

SIMULTANEOUS = 1e-6
"""Seconds between two times that are held to be the same; times since 1970 are known to 2e-7."""

HIGHEST = 1000.0
"""The highest rate, points per second."""

LONGEST = 10_000_000
"""The most points of a track: milliseconds taken for seconds might ask for more than memory holds."""

Places = tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Array]
"""(points,) each: the sample before, the sample after, and the share of the way between them."""


def regular(
    times: npt.ArrayLike, samples: npt.ArrayLike, rate: float, *, angles: Sequence[int] = ()
) -> Array:
    """The points of one track at `rate` a second, beginning with its first sample.

    Args:
        times: (samples,) seconds, increasing, of any origin; gaps of any length are bridged by a line.
        samples: (channels, samples).
        rate: points per second.
        angles: the channels that are angles in radians: between two of them the shorter way is gone.

    Returns:
        (channels, points); angles may leave [-pi, pi].

    Raises:
        DataError: `rate` is out of range, shapes do not fit, or a number is not finite, times do not
            increase, or the track is longer than `LONGEST`.
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
    step = np.diff(stamps)
    if len(step) and step.min() <= 0:
        late = int((step <= 0).argmax()) + 1
        raise DataError(
            f"sample {late} (counted from 0) is of time {stamps[late]:g} s, the one before of"
            f" {stamps[late - 1]:g} s; expected increasing times"
        )
    elapsed = stamps - stamps[0]
    if elapsed[-1] * rate >= LONGEST:
        raise DataError(f"the track lasts {elapsed[-1]:g} s; expected less than {LONGEST / rate:g} s")
    return between(track, places(elapsed, rate), angles)


def places(elapsed: Array, rate: float) -> Places:
    """Where the points lie among samples taken `elapsed` (samples,) seconds after the first, increasing."""
    at = np.arange(int(elapsed[-1] * rate) + 2) / rate
    after = np.searchsorted(elapsed, at - SIMULTANEOUS)
    known = after < len(elapsed)
    at, after = at[known], after[known]
    before = np.maximum(after - 1, 0)
    span = np.where(after > before, elapsed[after] - elapsed[before], 1.0)
    share = np.where(elapsed[after] <= at, 1.0, (at - elapsed[before]) / span)
    return before, after, share


def between(tracks: Array, where: Places, angles: Sequence[int] = ()) -> Array:
    """(..., channels, points) the `tracks` (..., channels, samples) at the given places."""
    before, after, share = where
    points: Array = tracks[..., before] * (1 - share) + tracks[..., after] * share
    for channel in angles:
        start, end = tracks[..., channel, before], tracks[..., channel, after]
        points[..., channel, :] = start + turn(start, end) * share
    return points


def turn(start: Array, end: Array) -> Array:
    """The shorter way from one angle to another, in [-pi, pi)."""
    return (end - start + np.pi) % (2 * np.pi) - np.pi


def check_rate(rate: float) -> None:
    """Raise DataError unless `rate` is one to resample at."""
    if not 0 < rate <= HIGHEST:
        raise DataError(f"a rate of {rate} points per second; expected one above 0 and up to {HIGHEST:g}")
