"""What is read from recordings: tracks of any length, and what was mended on the way."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError, expected_one_of
from lcorpp.values import CHANNELS, Array, freeze

COLUMNS = ("x", "y", "z", "velocity", "heading", "facing")
"""What a track may tell at each time: the channels of a `Dataset`, and z, the height of the head (m)."""

ANGLES = ("heading", "facing")
"""The columns that are angles, in radians."""


class Repair(NamedTuple):
    """One thing that was repaired because it was asked for.

    reason: the name of the repair, one of `repair.REPAIRS`. file, line: where it began, counted from 1.
    track: the id of the track as it is written, empty where there is none. rows: how many rows it changed.
    done: what was wrong and what was done about it.
    """

    reason: str
    file: str
    line: int
    track: str
    rows: int
    done: str


LARGEST = 1e9
"""Numbers beyond, in any unit, are no place and no speed; their squares would no longer tell people apart."""


@dataclass(frozen=True, eq=False)
class Track:
    """The motion of one person as it was sampled.

    id: its name, unlike that of any other track of a recording.
    times: (samples,) seconds, rising, of any origin.
    columns: name among `COLUMNS` -> (samples,); x and y are there; metres, metres per second, radians.
    label: its class, None where it is not known.
    group: who it is, as far as is known; the id unless given.
    """

    id: str
    times: Array
    columns: Mapping[str, Array]
    label: str | None = None
    group: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "times", freeze(self.times))
        columns = {name: freeze(values) for name, values in self.columns.items()}
        object.__setattr__(self, "columns", MappingProxyType(columns))
        object.__setattr__(self, "group", self.group or self.id)
        where, samples = f"track {self.id!r}", self.times.shape
        for name in columns:
            if name not in COLUMNS:
                raise DataError(f"{where}: unknown column {name!r}; {expected_one_of(COLUMNS)}")
            if columns[name].shape != samples or len(samples) != 1:
                raise DataError(f"{where}: {name} of shape {columns[name].shape}, times of shape {samples}")
            if not (np.abs(columns[name]) <= LARGEST).all():
                raise DataError(f"{where}: {name} is not finite, or above {LARGEST:g}")
        if not {"x", "y"} <= set(columns):
            raise DataError(f"{where}: it has no column x or y")
        if len(self.times) < 2:
            raise DataError(f"{where}: {len(self.times)} samples show no motion; at least 2 are needed")
        if not np.isfinite(self.times).all() or np.diff(self.times).min() <= 0:
            raise DataError(f"{where}: its times are not finite and rising")

    def __len__(self) -> int:
        return len(self.times)

    @property
    def duration(self) -> float:
        """Seconds from the first sample to the last."""
        return float(self.times[-1] - self.times[0])

    @property
    def place(self) -> Array:
        """(2, samples) x and y in metres."""
        return np.stack([self.columns["x"], self.columns["y"]])

    @property
    def speeds(self) -> Array:
        """(samples - 1,) metres per second from each sample to the next."""
        step = np.diff(self.place, axis=1)
        speeds: Array = np.hypot(step[0], step[1]) / np.diff(self.times)
        return speeds

    def in_robot_frame(self, x: float, y: float, angle: float) -> Track:
        """The same motion in the frame of a robot at (x, y), metres, that faces `angle`, radians."""
        cosine, sine = np.cos(angle), np.sin(angle)
        dx, dy = self.columns["x"] - x, self.columns["y"] - y
        moved = {"x": cosine * dx + sine * dy, "y": cosine * dy - sine * dx}
        turned = {name: wrap_angle(self.columns[name] - angle) for name in ANGLES if name in self.columns}
        return replace(self, columns={**self.columns, **moved, **turned})


def wrap_angle(angle: npt.ArrayLike) -> Array:
    """Angles of any size as the same ones in (-pi, pi]."""
    turned: Array = np.pi - (np.pi - np.asarray(angle, dtype=np.float64)) % (2 * np.pi)
    return turned


@dataclass(frozen=True, eq=False)
class Recording:
    """Tracks of unequal length, as they were read.

    tracks: with ids that differ. source: where they come from, for people to read.
    notes: what their user has to know. repairs: what was repaired, in the order it was found.
    """

    tracks: tuple[Track, ...]
    source: str = ""
    notes: tuple[str, ...] = ()
    repairs: tuple[Repair, ...] = ()

    def __post_init__(self) -> None:
        names = [track.id for track in self.tracks]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise DataError(f"two tracks have the id {twice!r}; expected every id once")

    def __len__(self) -> int:
        return len(self.tracks)

    @property
    def labels(self) -> tuple[str | None, ...]:
        """(tracks,) their classes."""
        return tuple(track.label for track in self.tracks)

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels of a `Dataset` that every track has, in the order of `CHANNELS`."""
        return tuple(name for name in CHANNELS if all(name in track.columns for track in self.tracks))

    def in_robot_frame(self, x: float, y: float, angle: float) -> Recording:
        """All tracks in the frame of a robot; see `Track.in_robot_frame`."""
        return replace(self, tracks=tuple(track.in_robot_frame(x, y, angle) for track in self.tracks))


def count_repairs(repairs: Iterable[Repair]) -> dict[str, tuple[int, int]]:
    """For each reason how many rows were changed, and in how many places."""
    counts: dict[str, tuple[int, int]] = {}
    for repair in repairs:
        rows, places = counts.get(repair.reason, (0, 0))
        counts[repair.reason] = rows + repair.rows, places + 1
    return counts
