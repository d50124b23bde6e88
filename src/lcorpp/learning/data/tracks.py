"""Recordings: tracks of unequal length, and the repairs made while they were read."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from lcorpp.arguments import check_arguments, check_fields
from lcorpp.errors import DataError, expected_one_of
from lcorpp.notebook import html_table
from lcorpp.values import CHANNELS, GAZE_CHANNELS, Array, freeze, wrap_angle

COLUMNS = ("x", "y", "z", "velocity", "heading", "facing", "tilt", *GAZE_CHANNELS)
"""Columns of a track: the channels of a `Dataset`; z, the height of the head (m); and tilt, the angle of the
face above the horizon (rad)."""

ANGLES = ("heading", "facing")
"""Columns that are directions in the plane, in radians; they turn with the frame."""

OTHER_ANGLES = ("tilt", "gaze_angle", "robot_angle")
"""Columns that are other angles, in radians, in [-pi / 2, pi / 2] or [0, pi]."""

CLOCK_TOLERANCE = 1e-6
"""Seconds that may be missing in the duration of a track: rounding of the clock."""

MAX_NUMBER = 1e9
"""Maximum size of a coordinate or speed in any unit; squares of larger numbers lose precision."""


class Repair(NamedTuple):
    r"""A fault that was repaired on request.

    reason: the name of the repair, from `repairs.REPAIRS`. file, line: the place of the fault, from line 1.
    track: the id of the track as in the file, empty if none. rows: number of rows changed.
    done: the fault and the action, as a phrase.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.learning import read_recording
        >>> _ = Path("people.csv").write_text("track,time,x,y\n7,0,4,1\n7,1,nan,1\n7,2,3,1\n")
        >>> repair = read_recording("people.csv", repair="all").repairs[0]
        >>> repair.reason, repair.line, repair.done
        ('nonfinite', 3, 'the x is missing or NaN; expected a finite number: left out')
    """

    reason: str
    file: str
    line: int
    track: str
    rows: int
    done: str


JUMP_TOLERANCE = 0.1
"""Seconds added to the time between two samples before their speed is compared with the maximum: trackers are
noisy and correct themselves."""


@dataclass(frozen=True, eq=False, repr=False)
class Track:
    """The sampled motion of one person.

    id: unique in its recording.
    times: (samples,) seconds, increasing, from any origin.
    columns: name from `COLUMNS` -> (samples,); x and y are required; metres, metres per second, radians.
    label: its class; None if unknown.
    group: the person's id if known; by default the track's id.

    Raises:
        DataError: an unknown or missing column, another shape, a number that is not finite, or fewer than
            two samples.

    Examples:
        >>> from lcorpp.learning import Track
        >>> track = Track("7", [0.0, 1.0, 2.0], {"x": [0.0, 3.0, 3.0], "y": [0.0, 4.0, 4.0]}, "interested")
        >>> track.duration, track.speeds.tolist()
        (2.0, [5.0, 0.0])
    """

    id: str
    times: Array
    columns: Mapping[str, Array]
    label: str | None = None
    group: str = ""

    def __post_init__(self) -> None:
        check_fields(self)
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
            if not (np.abs(columns[name]) <= MAX_NUMBER).all():
                raise DataError(f"{where}: {name} is not finite, or above {MAX_NUMBER:g}")
        if not {"x", "y"} <= set(columns):
            raise DataError(f"{where}: it has no column x or y")
        if len(self.times) < 2:
            raise DataError(f"{where}: {len(self.times)} samples show no motion; at least 2 are needed")
        if not np.isfinite(self.times).all() or np.diff(self.times).min() <= 0:
            raise DataError(f"{where}: its times are not finite and rising")

    def __len__(self) -> int:
        return len(self.times)

    def __repr__(self) -> str:
        columns = ", ".join(self.columns)
        counts = f"{len(self)} samples of {columns} in {self.duration:.1f} s"
        return f"Track({self.id!r}, {self.label!r}: {counts})"

    @property
    def duration(self) -> float:
        """Seconds from the first sample to the last."""
        return float(self.times[-1] - self.times[0])

    @property
    def positions(self) -> Array:
        """(2, samples) x and y in metres."""
        return np.stack([self.columns["x"], self.columns["y"]])

    @property
    def speeds(self) -> Array:
        """(samples - 1,) metres per second from each sample to the next."""
        step = np.diff(self.positions, axis=1)
        speeds: Array = np.hypot(step[0], step[1]) / np.diff(self.times)
        return speeds

    def last(self, seconds: float) -> Track:
        """Return the last seconds of the track, two samples at least.

        Raises:
            DataError: the seconds are not a number above 0.
        """
        if not seconds > 0:
            raise DataError(
                f"the last {seconds:g} seconds are not part of a track; expected a number above 0"
            )
        first = int(np.searchsorted(self.times, self.times[-1] - seconds - CLOCK_TOLERANCE))
        first = min(first, len(self) - 2)
        columns = {name: values[first:] for name, values in self.columns.items()}
        return replace(self, times=self.times[first:], columns=columns)

    def between(self, start: float, end: float) -> Track | None:
        """Return the part from one time to another, in seconds; None if it has less than two samples."""
        first, last = np.searchsorted(self.times, [start, np.nextafter(end, np.inf)]).tolist()
        if last - first < 2:
            return None
        columns = {name: values[first:last] for name, values in self.columns.items()}
        return replace(self, times=self.times[first:last], columns=columns)

    def in_robot_frame(self, x: float, y: float, angle: float) -> Track:
        """Transform positions and angles to the frame of a robot at (x, y), m, that faces `angle`, rad.

        Raises:
            DataError: the pose is not finite.
        """
        if not np.isfinite((x, y, angle)).all():
            raise DataError(f"the robot's pose is {x:g} {y:g} {angle:g}; expected finite numbers")
        cosine, sine = np.cos(angle), np.sin(angle)
        dx, dy = self.columns["x"] - x, self.columns["y"] - y
        moved = {"x": cosine * dx + sine * dy, "y": cosine * dy - sine * dx}
        turned = {name: wrap_angle(self.columns[name] - angle) for name in ANGLES if name in self.columns}
        return replace(self, columns={**self.columns, **moved, **turned})


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """Tracks of unequal length, as they were read.

    tracks: with unique ids. source: where they come from, for people to read.
    notes: warnings for the user. repairs: the repairs made, in the order of the faults.

    Raises:
        DataError: two tracks have the same id.

    Examples:
        >>> from lcorpp.learning import Recording, Track
        >>> recording = Recording([Track("7", [0.0, 1.0], {"x": [5.0, 4.0], "y": [2.0, 2.0]})])
        >>> from_robot = recording.in_robot_frame(4.0, 0.0, 0.0)  # the robot's pose: x, y and heading
        >>> from_robot.tracks[0].positions.tolist()
        [[1.0, 0.0], [2.0, 2.0]]
    """

    tracks: tuple[Track, ...]
    source: str = ""
    notes: tuple[str, ...] = ()
    repairs: tuple[Repair, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self)
        names = [track.id for track in self.tracks]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise DataError(f"two tracks have the id {twice!r}; expected every id once")

    def __len__(self) -> int:
        return len(self.tracks)

    def __repr__(self) -> str:
        counts = [f"{len(tracks)} {label or 'without a label'}" for label, tracks in self.by_class().items()]
        repairs = f"; {len(self.repairs)} repairs" if self.repairs else ""
        return f"Recording({self.source!r}, {len(self)} tracks: {', '.join(counts) or 'none'}{repairs})"

    def _repr_html_(self) -> str:
        rows = [
            (label or "(no label)", str(len(tracks)), f"{np.median([t.duration for t in tracks]):.1f}")
            for label, tracks in self.by_class().items()
        ]
        return html_table(("class", "tracks", "median seconds"), rows, caption=repr(self), limit=20)

    def by_class(self) -> dict[str | None, list[Track]]:
        """Return label -> its tracks, in the order of the labels; unlabelled tracks are last."""
        classes: dict[str | None, list[Track]] = {
            label: [] for label in sorted(set(self.labels), key=lambda label: (label is None, label))
        }
        for track in self.tracks:
            classes[track.label].append(track)
        return classes

    @property
    def labels(self) -> tuple[str | None, ...]:
        """(tracks,) the classes of the tracks."""
        return tuple(track.label for track in self.tracks)

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels of a `Dataset` that every track has, in the order of `CHANNELS`."""
        return tuple(name for name in CHANNELS if all(name in track.columns for track in self.tracks))

    def last(self, seconds: float) -> Recording:
        """Return the last seconds of every track; see `Track.last`."""
        return replace(self, tracks=tuple(track.last(seconds) for track in self.tracks))

    def in_robot_frame(self, x: float, y: float, angle: float) -> Recording:
        """Transform all tracks to the frame of a robot; see `Track.in_robot_frame`."""
        return replace(self, tracks=tuple(track.in_robot_frame(x, y, angle) for track in self.tracks))


@check_arguments
def count_repairs(repairs: Collection[Repair]) -> dict[str, tuple[int, int]]:
    r"""Count repairs: reason -> (rows changed, places).

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.learning import count_repairs, read_recording
        >>> _ = Path("people.csv").write_text("track,time,x,y\n7,0,4,1\n7,1,nan,1\n7,2,nan,1\n7,3,3,1\n")
        >>> count_repairs(read_recording("people.csv", repair="all").repairs)
        {'nonfinite': (2, 2)}
    """
    counts: dict[str, tuple[int, int]] = {}
    for repair in repairs:
        rows, places = counts.get(repair.reason, (0, 0))
        counts[repair.reason] = rows + repair.rows, places + 1
    return counts


def note_repairs(repairs: Collection[Repair]) -> tuple[str, ...]:
    """Return a note that counts the repairs, if there are any, with the first conversion of units."""
    if not repairs:
        return ()
    counts = [
        f"{reason} {rows} rows in {places} places"
        for reason, (rows, places) in count_repairs(repairs).items()
    ]
    units = next((f" (units: {repair.done})" for repair in repairs if repair.reason == "units"), "")
    return (f"repaired: {', '.join(counts)}{units}",)
