"""Describe a recording: counts, durations, speeds, sampling and duplicates."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lcorpp.errors import DataError
from lcorpp.learning.data.tracks import Recording, Track
from lcorpp.values import Array

NEAR_DISTANCE = 0.01
"""Maximum distance in metres between near-identical tracks: copies that were rounded or resampled.

A tracker's noise is several times larger, so that one walk, tracked twice, does not count.
"""

SHAPE_POINTS = 16
"""Number of points at which two tracks are compared."""

SPEED_STEP = 0.4
"""Seconds per step of a mean speed; shorter steps measure the tracker's noise."""

Pair = tuple[str, str]


@dataclass(frozen=True)
class Quantiles:
    """Quantiles of a number over tracks or samples."""

    min: float
    q25: float
    median: float
    q75: float
    q95: float
    max: float

    @classmethod
    def of(cls, values: Array) -> Quantiles:
        return cls(*np.quantile(values, [0, 0.25, 0.5, 0.75, 0.95, 1]).tolist())


@dataclass(frozen=True)
class ClassSummary:
    """Summary of the tracks of one class; None is the class of unlabelled tracks.

    tracks, groups, samples: counts. duration: seconds per track. speed: mean speed per track, m/s.
    """

    name: str | None
    tracks: int
    groups: int
    samples: int
    duration: Quantiles
    speed: Quantiles


@dataclass(frozen=True)
class Description:
    """Description of a recording.

    classes: in the order of their names. channels: the columns that every track has.
    interval: seconds between samples, over all samples. jitter: standard deviation of a track's intervals
        divided by their mean, averaged over the tracks.
    fastest: the highest speed between two samples, m/s, and the id of its track.
    identical, near: pairs of ids of tracks with the same positions, and of tracks that are within
        `NEAR_DISTANCE` of each other at equal shares of their durations.
    reused: group -> number of its tracks, for groups with several.
    """

    classes: tuple[ClassSummary, ...]
    channels: tuple[str, ...]
    interval: Quantiles
    jitter: float
    fastest: tuple[float, str]
    identical: tuple[Pair, ...]
    near: tuple[Pair, ...]
    reused: dict[str, int]

    @property
    def tracks(self) -> int:
        """Number of tracks."""
        return sum(part.tracks for part in self.classes)


def describe(recording: Recording) -> Description:
    """Describe a recording.

    Raises:
        DataError: it has no tracks.
    """
    tracks = recording.tracks
    if not tracks:
        raise DataError(f"{recording.source or 'the recording'}: there are no tracks to describe")
    steps = [np.diff(track.times) for track in tracks]
    fastest = max(tracks, key=lambda track: float(track.speeds.max()))
    identical, near = _find_duplicates(tracks)
    groups = Counter(track.group for track in tracks)
    common = [name for name in tracks[0].columns if all(name in track.columns for track in tracks)]
    return Description(
        tuple(_summarize_class(name, members) for name, members in recording.by_class().items()),
        tuple(common),
        Quantiles.of(np.concatenate(steps)),
        float(np.mean([step.std() / step.mean() for step in steps])),
        (float(fastest.speeds.max()), fastest.id),
        identical,
        near,
        {group: count for group, count in groups.items() if count > 1},
    )


def _summarize_class(name: str | None, tracks: Sequence[Track]) -> ClassSummary:
    return ClassSummary(
        name,
        len(tracks),
        len({track.group for track in tracks}),
        sum(len(track) for track in tracks),
        Quantiles.of(np.array([track.duration for track in tracks])),
        Quantiles.of(np.array([_compute_mean_speed(track) for track in tracks])),
    )


def _compute_mean_speed(track: Track) -> float:
    """Return the mean speed in m/s over steps of about `SPEED_STEP` seconds."""
    steps = max(1, round(track.duration / SPEED_STEP))
    at = np.linspace(track.times[0], track.times[-1], steps + 1)
    x, y = (np.interp(at, track.times, track.columns[name]) for name in ("x", "y"))
    return float(np.hypot(np.diff(x), np.diff(y)).sum() / track.duration)


def _find_duplicates(tracks: Sequence[Track]) -> tuple[tuple[Pair, ...], tuple[Pair, ...]]:
    """Return the pairs of identical tracks and the pairs of near-identical ones.

    Only pairs whose first and last points are close, and whose durations differ by at most 1 %, are compared.
    """
    shapes = np.stack([_sample_shape(track) for track in tracks])
    ends = shapes[:, [0, -1]].reshape(len(tracks), 4)  # two distances, so sqrt(2) in four dimensions
    pairs = cKDTree(ends).query_pairs(NEAR_DISTANCE * np.sqrt(2), p=2, output_type="ndarray")
    apart = shapes[pairs[:, 0]] - shapes[pairs[:, 1]]
    close = np.hypot(apart[..., 0], apart[..., 1]).max(axis=1, initial=0) <= NEAR_DISTANCE
    identical, near = list[Pair](), list[Pair]()
    for first, second in sorted(map(tuple, pairs[close].tolist())):
        one, other = tracks[first], tracks[second]
        if abs(one.duration - other.duration) <= 0.01 * one.duration:
            same = np.array_equal(one.positions, other.positions)
            (identical if same else near).append((one.id, other.id))
    return tuple(identical), tuple(near)


def _sample_shape(track: Track) -> Array:
    """(SHAPE_POINTS, 2) x and y at evenly spaced times."""
    at = np.linspace(track.times[0], track.times[-1], SHAPE_POINTS)
    return np.stack([np.interp(at, track.times, track.columns[name]) for name in ("x", "y")], axis=1)


def join_pairs(pairs: Iterable[Pair], limit: int = 5) -> str:
    """Join the first pairs of ids to a phrase."""
    shown = [f"{one} and {other}" for one, other in pairs]
    more = f", ... ({len(shown)} pairs)" if len(shown) > limit else ""
    return ", ".join(shown[:limit]) + more
