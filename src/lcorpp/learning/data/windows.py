"""Resample tracks to a data set of a fixed interval: the last seconds of each, or windows of them all."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.data.tracks import ANGLES, CLOCK_TOLERANCE, Recording, Track, note_repairs
from lcorpp.values import CHANNELS, Array, Dataset, stack_signals, wrap_angle

INTERVAL, POINTS = 0.033, 304
"""The paper's values: 304 points at 30 Hz, ten seconds."""

MIN_SECONDS = 1.0
"""Shorter tracks are left out."""

MAX_PAUSE = 1.0
"""Seconds without a sample that a window may contain; streams forget what is before a longer pause, too."""

End = Literal["last", "first"]


@check_arguments
def to_dataset(
    recording: Recording,
    *,
    interval: float = INTERVAL,
    points: int = POINTS,
    channels: Sequence[str] | None = None,
    end: End = "last",
    min_seconds: float = MIN_SECONDS,
    step: float | None = None,
) -> Dataset:
    """Cut all tracks to at most the same duration and resample them every `interval` seconds.

    Tracks that are shorter than (points - 1) * interval by half an interval or more have fewer points, see
    `Dataset`; the notes count them. Values are interpolated linearly, angles along the shorter arc.

    Args:
        recording: tracks with labels.
        interval: seconds between two time points. points: time points per case, at most.
        channels: the channels to use, including x and y; None uses those that every track has.
        end: whether to use the last or the first seconds of each track.
        min_seconds: tracks that are shorter than this by an interval or more, and shorter than all points,
            are left out; also those of a single point.
        step: seconds between the windows of a track, from its end or beginning on; a window with a pause
            longer than `MAX_PAUSE` is left out, and tracks that are shorter than a window are used as without
            steps. None takes one window of each track.

    Returns:
        Cases in the order of the tracks, and of the time in each.

    Raises:
        DataError: an argument is out of range, a track lacks its label or a channel, or all are left out.

    Examples:
        >>> from lcorpp.learning import Recording, Track, to_dataset
        >>> track = Track("7", [0.0, 4.0], {"x": [0.0, 4.0], "y": [1.0, 1.0]}, "interested")
        >>> to_dataset(Recording([track]), interval=0.5, points=3).trajectories.tolist()  # the last second
        [[[3.0, 3.5, 4.0], [1.0, 1.0, 1.0]]]
    """
    if points < 2:
        raise DataError(f"a data set needs at least 2 time points, not {points}")
    if not 0 < interval < float("inf"):
        raise DataError(f"the interval is {interval} s; expected a finite number above 0")
    if not 0 <= min_seconds < float("inf"):
        raise DataError(f"the shortest track lasts {min_seconds} s; expected a finite number from 0")
    if step is not None and not 0 < step < float("inf"):
        raise DataError(f"the step is {step} s; expected a finite number above 0")
    if end not in ("last", "first"):
        raise DataError(f"unknown end {end!r}; {expected_one_of(('last', 'first'))}")
    if not recording.tracks:
        raise DataError(f"{recording.source or 'the recording'}: there are no tracks")
    names = recording.channels if channels is None else tuple(channels)
    if not names:
        raise DataError(f"the channels are empty; {expected_one_of(recording.channels)}")
    for track in recording.tracks:
        _check_track(track, names)
    window = (points - 1) * interval
    shortest = max(min(min_seconds, window), interval)
    least = count_points(shortest, interval, points)
    kept = [track for track in recording.tracks if count_points(track.duration, interval, points) >= least]
    if not kept:
        longest = max(track.duration for track in recording.tracks)
        raise DataError(
            f"{recording.source or 'the recording'}: every track is shorter than {shortest:g} s; the longest"
            f" lasts {longest:.3f} s"
        )
    shifts = [_list_shifts(track, window, interval, step, end) for track in kept]
    parts = [(track, shift) for track, own in zip(kept, shifts, strict=True) for shift in own]
    if not parts:
        raise DataError(
            f"{recording.source or 'the recording'}: every window has a pause above {MAX_PAUSE:g} s"
        )
    used = [track for track, _ in parts]
    cases = [extract_window(track, names, interval, points, end, shift) for track, shift in parts]
    whole = [track for track, case in zip(used, cases, strict=True) if case.shape[1] == points]
    unit = "tracks" if step is None else "windows"
    notes = [
        f"{len(longer) - len(fewer)} of {total} are shorter than {seconds:g} s and {what}:"
        f" {_count_classes(longer, fewer)}"
        for longer, fewer, seconds, total, what in (
            (recording.tracks, kept, shortest, f"{len(recording)} tracks", "left out"),
            (used, whole, window, f"{len(recording) if step is None else len(used)} {unit}", "used whole"),
        )
        if len(longer) > len(fewer)
    ]
    return Dataset(
        stack_signals(cases),
        tuple(str(track.label) for track in used),
        tuple(track.group for track in used),
        recording.source,
        (*recording.notes, *notes, *note_repairs(recording.repairs)),
        interval,
        names,
    )


def _list_shifts(
    track: Track, window: float, interval: float, step: float | None, end: End
) -> Sequence[float]:
    """Return the seconds by which the windows of a track lie before its last time, or after its first."""
    free = track.duration - window
    if step is None or free < -interval / 2:
        return [0.0]
    shifts = np.arange(int(max(free, 0.0) / step + CLOCK_TOLERANCE) + 1) * step
    starts = track.times[0] + shifts if end == "first" else track.times[-1] - window - shifts[::-1]
    pauses = np.flatnonzero(np.diff(track.times) > MAX_PAUSE)
    before, after = track.times[pauses, None], track.times[pauses + 1, None]
    inside = (after > starts + CLOCK_TOLERANCE) & (before < starts + window - CLOCK_TOLERANCE)
    kept: list[float] = (starts[~inside.any(axis=0)] - track.times[0]).tolist()
    return kept if end == "first" else [track.duration - window - start for start in kept]


def extract_window(
    track: Track, channels: Sequence[str], interval: float, points: int, end: End, shift: float = 0.0
) -> Array:
    """(channels, points) a window of one track; fewer points of a shorter one, see `count_points`.

    Outside its times the first or last value is repeated.

    Args:
        shift: seconds from the first time, or to the last one.
    """
    steps = np.arange(count_points(track.duration, interval, points)) * interval
    at = track.times[0] + shift + steps if end == "first" else track.times[-1] - shift - steps[::-1]
    return np.stack(
        [
            wrap_angle(np.interp(at, track.times, np.unwrap(track.columns[name])))
            if name in ANGLES
            else np.interp(at, track.times, track.columns[name])
            for name in channels
        ]
    )


def count_points(duration: float, interval: float, points: int) -> int:
    """Return the number of points of a track: all, if less than half an interval is missing for the last."""
    if duration > (points - 1) * interval - interval / 2:
        return points
    return 1 + int((duration + CLOCK_TOLERANCE) / interval)


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


def _count_classes(tracks: Iterable[Track], others: Iterable[Track]) -> str:
    """Return the classes of the tracks that are not among the others, with their numbers, as a phrase."""
    counts = Counter(str(track.label) for track in tracks) - Counter(str(track.label) for track in others)
    return ", ".join(f"{count} {name}" for name, count in sorted(counts.items()))
