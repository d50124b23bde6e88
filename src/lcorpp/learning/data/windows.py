"""Resample tracks of unequal length to a rectangular data set: equal duration, fixed interval."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Literal

import numpy as np

from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.data.tracks import ANGLES, Recording, Track, wrap_angle
from lcorpp.values import CHANNELS, Array, Dataset

INTERVAL, POINTS = 0.033, 304
"""The paper's values: 304 points at 30 Hz, ten seconds."""

End = Literal["last", "first"]


def to_dataset(
    recording: Recording,
    *,
    interval: float = INTERVAL,
    points: int = POINTS,
    channels: Sequence[str] | None = None,
    end: End = "last",
) -> Dataset:
    """Cut all tracks to the same duration and resample them every `interval` seconds.

    Tracks that are shorter than (points - 1) * interval by more than half an interval are left out; the notes
    count them. Values are interpolated linearly, angles along the shorter arc.

    Args:
        recording: tracks with labels.
        interval: seconds between two time points. points: time points per case.
        channels: the channels to use, including x and y; None uses those that every track has.
        end: whether to use the last or the first seconds of each track.

    Returns:
        Cases in the order of the tracks.

    Raises:
        DataError: an argument is out of range, a track lacks its label or a channel, or all are too short.
    """
    if points < 2:
        raise DataError(f"a data set needs at least 2 time points, not {points}")
    if not 0 < interval < float("inf"):
        raise DataError(f"the interval is {interval} s; expected a finite number above 0")
    if end not in ("last", "first"):
        raise DataError(f"unknown end {end!r}; {expected_one_of(('last', 'first'))}")
    if not recording.tracks:
        raise DataError(f"{recording.source or 'the recording'}: there are no tracks")
    names = recording.channels if channels is None else tuple(channels)
    for track in recording.tracks:
        _check_track(track, names)
    needed = (points - 1) * interval
    kept = [track for track in recording.tracks if track.duration > needed - interval / 2]
    if not kept:
        longest = max(track.duration for track in recording.tracks)
        raise DataError(
            f"{recording.source or 'the recording'}: every track is shorter than {needed:g} s"
            f" ({points} points, {interval:g} s apart); the longest lasts {longest:.3f} s"
        )
    notes = recording.notes
    if len(kept) < len(recording):
        notes = (*notes, _describe_short_tracks(recording, kept, needed))
    return Dataset(
        np.stack([extract_window(track, names, interval, points, end) for track in kept]),
        tuple(str(track.label) for track in kept),
        tuple(track.group for track in kept),
        recording.source,
        notes,
        interval,
        names,
    )


def extract_window(track: Track, channels: Sequence[str], interval: float, points: int, end: End) -> Array:
    """(channels, points) a window of one track; outside its times the first or last value is repeated."""
    steps = np.arange(points) * interval
    at = track.times[0] + steps if end == "first" else track.times[-1] - steps[::-1]
    return np.stack(
        [
            wrap_angle(np.interp(at, track.times, np.unwrap(track.columns[name])))
            if name in ANGLES
            else np.interp(at, track.times, track.columns[name])
            for name in channels
        ]
    )


def _check_track(track: Track, channels: Sequence[str]) -> None:
    if track.label is None:
        raise DataError(
            f"track {track.id!r} has no label; a data set to learn from needs one for every track"
        )
    for name in channels:
        if name not in CHANNELS:
            raise DataError(f"unknown channel {name!r}; {expected_one_of(CHANNELS)}")
        if name not in track.columns:
            raise DataError(f"track {track.id!r} has no {name}; {expected_one_of(list(track.columns))}")


def _describe_short_tracks(recording: Recording, kept: list[Track], needed: float) -> str:
    """Return a note that counts the short tracks of each class."""
    short = Counter(map(str, recording.labels)) - Counter(str(track.label) for track in kept)
    counts = ", ".join(f"{count} {name}" for name, count in sorted(short.items()))
    return f"{short.total()} of {len(recording)} tracks are shorter than {needed:g} s and left out: {counts}"
