"""What a recording holds: how many, how long, how fast, how evenly sampled, and what is there twice."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lcorpp.errors import DataError
from lcorpp.learning.data.tracks import Recording, Track
from lcorpp.values import Array

NEAR = 0.01
"""Metres: two tracks that are never farther apart are near-identical. A tracker's noise alone is several
times that, so that even one walk, tracked twice, does not come so near."""

SHAPE = 16
"""Points at which two tracks are compared."""


@dataclass(frozen=True)
class Quantiles:
    """How a number is spread over tracks or samples: its extremes, quartiles and 95 % quantile."""

    min: float
    quarter: float
    median: float
    three_quarters: float
    high: float
    max: float

    @classmethod
    def of(cls, values: Array) -> Quantiles:
        return cls(*np.quantile(values, [0, 0.25, 0.5, 0.75, 0.95, 1]).tolist())


@dataclass(frozen=True)
class ClassSummary:
    """The tracks of one class, None being those without a label.

    tracks, groups, samples: how many. duration: seconds of a track. speed: m/s, of every track its way by
        its time.
    """

    name: str | None
    tracks: int
    groups: int
    samples: int
    duration: Quantiles
    speed: Quantiles


@dataclass(frozen=True)
class Description:
    """What `describe` finds.

    classes: in the order of their names; channels: what every track tells besides its times.
    interval: seconds between samples, over all samples; jitter: the mean over the tracks of the deviation of
        their intervals, divided by the mean interval.
    fastest: the highest speed between two samples, m/s, and the id of its track.
    identical, near: pairs of ids of tracks that are the same, or nowhere farther apart than `NEAR`, as they
        lie and in a time counted from each one's beginning.
    reused: groups that have several tracks -> how many.
    """

    classes: tuple[ClassSummary, ...]
    channels: tuple[str, ...]
    interval: Quantiles
    jitter: float
    fastest: tuple[float, str]
    identical: tuple[tuple[str, str], ...]
    near: tuple[tuple[str, str], ...]
    reused: dict[str, int]

    @property
    def tracks(self) -> int:
        """How many tracks there are."""
        return sum(part.tracks for part in self.classes)


def describe(recording: Recording) -> Description:
    """Count, measure and compare all tracks.

    Raises:
        DataError: there are none.
    """
    tracks = recording.tracks
    if not tracks:
        raise DataError(f"{recording.source or 'the recording'}: there are no tracks to describe")
    names = sorted(set(recording.labels), key=lambda name: (name is None, name))
    steps = [np.diff(track.times) for track in tracks]
    peaks = [float(track.speeds.max()) for track in tracks]
    peak = int(np.argmax(peaks))
    identical, near = _twice(tracks)
    sizes: dict[str, int] = {}
    for track in tracks:
        sizes[track.group] = sizes.get(track.group, 0) + 1
    common = [name for name in tracks[0].columns if all(name in track.columns for track in tracks)]
    return Description(
        tuple(_class(name, [t for t in tracks if t.label == name]) for name in names),
        tuple(common),
        Quantiles.of(np.concatenate(steps)),
        float(np.mean([step.std() / step.mean() for step in steps])),
        (peaks[peak], tracks[peak].id),
        identical,
        near,
        {group: count for group, count in sizes.items() if count > 1},
    )


def _class(name: str | None, tracks: Sequence[Track]) -> ClassSummary:
    return ClassSummary(
        name,
        len(tracks),
        len({track.group for track in tracks}),
        sum(len(track) for track in tracks),
        Quantiles.of(np.array([track.duration for track in tracks])),
        Quantiles.of(np.array([_speed(track) for track in tracks])),
    )


def _speed(track: Track) -> float:
    """Metres per second, by steps of at least .3 s: a tracker's noise would add a way of its own."""
    steps = max(1, round(track.duration / 0.4))
    at = np.linspace(track.times[0], track.times[-1], steps + 1)
    x, y = (np.interp(at, track.times, track.columns[name]) for name in ("x", "y"))
    return float(np.hypot(np.diff(x), np.diff(y)).sum() / track.duration)


def _twice(tracks: Sequence[Track]) -> tuple[tuple[tuple[str, str], ...], tuple[tuple[str, str], ...]]:
    """Pairs that are the same sample by sample, and others that are nearly so."""
    shapes = np.stack([_shape(track) for track in tracks])
    ends = shapes[:, [0, 1, -2, -1]]
    pairs = cKDTree(ends).query_pairs(NEAR * np.sqrt(2), p=2, output_type="ndarray")
    apart = (shapes[pairs[:, 0]] - shapes[pairs[:, 1]]).reshape(len(pairs), SHAPE, 2)
    close = np.hypot(apart[..., 0], apart[..., 1]).max(axis=1, initial=0) <= NEAR
    found: tuple[list[tuple[str, str]], list[tuple[str, str]]] = ([], [])
    for first, second in sorted(map(tuple, pairs[close].tolist())):
        one, other = tracks[first], tracks[second]
        if abs(one.duration - other.duration) <= 0.01 * one.duration:
            found[not _same(one, other)].append((one.id, other.id))
    return tuple(found[0]), tuple(found[1])


def _shape(track: Track) -> Array:
    """(2 * SHAPE,) x and y at points evenly spread over the track, in turn."""
    at = np.linspace(track.times[0], track.times[-1], SHAPE)
    points = [np.interp(at, track.times, track.columns[name]) for name in ("x", "y")]
    return np.stack(points, axis=1).reshape(-1)


def _same(one: Track, other: Track) -> bool:
    return len(one) == len(other) and bool(np.array_equal(one.place, other.place))


def join_pairs(pairs: Iterable[tuple[str, str]], limit: int = 5) -> str:
    """Some pairs of ids in words."""
    shown = [f"{one} and {other}" for one, other in pairs]
    more = f", ... ({len(shown)} pairs)" if len(shown) > limit else ""
    return ", ".join(shown[:limit]) + more
