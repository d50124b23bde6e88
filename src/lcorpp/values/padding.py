"""Signals of many people in one array, in which missing ones are NaN.

After its end a track is NaN; of a person whom the sense did not perceive all numbers are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError
from lcorpp.values.arrays import Array, Flags

Lengths = npt.NDArray[np.int64]
"""(cases,) numbers of time points."""


def measure_lengths(tracks: Array) -> Lengths:
    """Return (cases,) the lengths of tracks (cases, channels, time points): time points before the padding.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.values import measure_lengths
        >>> measure_lengths(np.array([[[1.0, 2.0, 3.0]], [[1.0, 2.0, np.nan]]])).tolist()
        [3, 2]
    """
    points = tracks.shape[2]
    lengths = np.full(len(tracks), points, dtype=np.int64)
    padded = np.flatnonzero(np.isnan(tracks[:, :, -1:]).all(axis=(1, 2)))
    if len(padded):
        is_known = ~np.isnan(tracks[padded]).all(axis=1)
        lengths[padded] = (is_known * np.arange(1, points + 1)).max(axis=1, initial=0)
    return lengths


def strip_padding(track: Array) -> Array:
    """Return a track (channels, time points) without its padding; any other array as it is.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.values import strip_padding
        >>> strip_padding(np.array([[0.0, 0.5, np.nan], [2.0, 2.0, np.nan]])).tolist()
        [[0.0, 0.5], [2.0, 2.0]]
    """
    if track.ndim != 2 or not track.size or not np.isnan(track[0, -1]):
        return track
    return track[:, : int(measure_lengths(track[None])[0])]


def find_perceived(signals: Array) -> Flags:
    """Return (cases,) whether the sense perceived each case: whether any of its numbers is not NaN.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.values import find_perceived
        >>> find_perceived(np.array([[0.5, 1.0], [np.nan, np.nan]])).tolist()
        [True, False]
    """
    return np.asarray(~np.isnan(signals).all(axis=tuple(range(1, signals.ndim))))


def count_window(seconds: float, interval: float) -> int:
    """Return the number of time points in a window of some seconds, at least two.

    Args:
        interval: seconds between two time points.

    Raises:
        DataError: an argument is not a finite number above 0.

    Examples:
        >>> from lcorpp.values import count_window
        >>> count_window(seconds=3, interval=0.5)  # both ends count
        7
    """
    for name, value in (("window", seconds), ("interval", interval)):
        if not 0 < value < float("inf"):
            raise DataError(f"the {name} is {value} s; expected a finite number above 0")
    return max(2, round(seconds / interval) + 1)


def cut_tracks(tracks: Array, part: slice) -> Array:
    """Return a part of each of the tracks (cases, channels, time points), padded where it is shorter.

    Args:
        part: of the time points of each track, e.g. slice(-90, None), the last 90.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.values import cut_tracks
        >>> cut_tracks(np.arange(10.0).reshape(1, 2, 5), slice(-2, None)).tolist()
        [[[3.0, 4.0], [8.0, 9.0]]]
    """
    return stack_signals([strip_padding(track)[:, part] for track in tracks]) if len(tracks) else tracks


def stack_signals(signals: Sequence[Array]) -> Array:
    """Stack signals: tracks (channels, time points) of any length, padded, or features (features,).

    The signals, at least one, have the same channels or features.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.values import stack_signals
        >>> stack_signals([np.zeros((2, 3)), np.zeros((2, 5))]).shape
        (2, 2, 5)
    """
    if signals[0].ndim == 1:
        return np.stack(signals)
    points = max(track.shape[1] for track in signals)
    padded = np.full((len(signals), len(signals[0]), points), np.nan)
    for row, track in zip(padded, signals, strict=True):
        row[:, : track.shape[1]] = track
    return padded
