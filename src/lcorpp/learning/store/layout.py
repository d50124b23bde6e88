"""What all tracks of a store have in common, and the head of the file that says it."""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.store.frames import MARKER
from lcorpp.values import CHANNELS, Dataset

MAGIC, VERSION = b"lcorpp tracks ", 1
LONGEST_HEAD = 2**20
"""Bytes in which both copies of a head end."""

MOST_POINTS = 2**20


@dataclass(frozen=True)
class TrackSchema:
    """What every track of a store must have.

    channels: what each row of a trajectory is, names among `values.CHANNELS`: m, m/s, rad.
    interval: seconds between two time points.
    classes: the labels there may be, the values of the robot's target, in their order.
    points: how many time points a track has; None where that may differ from track to track.
    """

    channels: tuple[str, ...]
    interval: float
    classes: tuple[str, ...]
    points: int | None = None

    def __post_init__(self) -> None:
        for what, names in (("channels", self.channels), ("classes", self.classes)):
            object.__setattr__(self, what, _names(what, names))
        for name in self.channels:
            if name not in CHANNELS:
                raise DataError(f"unknown channel {name!r}; {expected_one_of(CHANNELS)}")
        if not isinstance(self.interval, int | float) or not 0 < self.interval < math.inf:
            raise DataError(f"the interval is {self.interval!r} s; expected a finite number above 0")
        object.__setattr__(self, "interval", float(self.interval))
        if self.points is not None and not (isinstance(self.points, int) and 2 <= self.points <= MOST_POINTS):
            raise DataError(f"tracks of {self.points!r} time points; expected 2 to {MOST_POINTS}, or None")

    @classmethod
    def of(cls, dataset: Dataset, classes: Sequence[str]) -> TrackSchema:
        """The schema of tracks like those of `dataset`, labelled with `classes`."""
        return cls(dataset.channels, dataset.interval, tuple(classes), dataset.trajectories.shape[2])

    def check_same(self, other: TrackSchema, where: str) -> None:
        """Return if a store with this schema, called `where`, takes tracks of `other`.

        Raises:
            DataError: it does not; the first difference is told.
        """
        for what, here, there in (
            ("channels", ", ".join(self.channels), ", ".join(other.channels)),
            ("interval", f"{self.interval:g} s", f"{other.interval:g} s"),
            ("classes", ", ".join(self.classes), ", ".join(other.classes)),
            ("time points of a track", self.points or "any number", other.points or "any number"),
        ):
            if here != there:
                raise DataError(f"{where}: its {what}: {here}; the tracks to be stored have: {there}")


@dataclass(frozen=True)
class Head:
    """The beginning of a store's file: its schema, and the marker of its frames.

    length: bytes up to the first frame.
    whole: whether both copies are undamaged; one is enough.
    """

    schema: TrackSchema
    marker: bytes
    length: int
    whole: bool = True


def head_bytes(schema: TrackSchema, marker: bytes) -> bytes:
    """Two equal lines of text: a damaged byte in one of them loses nothing.

    Raises:
        DataError: the names are too long for a head.
    """
    content = {
        "channels": schema.channels,
        "interval": schema.interval,
        "classes": schema.classes,
        "points": schema.points,
        "marker": marker.hex(),
    }
    rest = b"%d %s" % (VERSION, json.dumps(content).encode())
    line = MAGIC + b"%08x " % zlib.crc32(rest) + rest + b"\n"
    if 2 * len(line) > LONGEST_HEAD:
        raise DataError(f"the names of channels and classes make a head of {2 * len(line)} bytes; too long")
    return 2 * line


def parse_head(content: bytes) -> Head | None:
    """The head at the beginning of `content`, from whichever of its copies is whole; None without one.

    Raises:
        DataError: it is of another version than this one reads.
    """
    at = content.find(MAGIC, 0, LONGEST_HEAD)
    while at >= 0:
        end = content.find(b"\n", at) + 1
        found = _line(content[at:end]) if end else None
        if found is not None and at == 0:
            whole = content[end : 2 * end] == content[:end]
            return Head(*found, 2 * end, whole)
        if found is not None:
            return Head(*found, end, False)
        at = content.find(MAGIC, at + 1, LONGEST_HEAD)
    return None


def begun_head(content: bytes) -> bool:
    """Whether a file of this content may be all that was written of a head when its writer came to its end.

    A file system may leave zeros where it had made room and nothing was written yet.
    """
    line = content.rstrip(b"\0")
    return b"\n" not in line and (MAGIC.startswith(line) or line.startswith(MAGIC))


def _line(line: bytes) -> tuple[TrackSchema, bytes] | None:
    checksum, _, rest = line[len(MAGIC) : -1].partition(b" ")
    if checksum != b"%08x" % zlib.crc32(rest):
        return None
    version, _, text = rest.partition(b" ")
    if version != b"%d" % VERSION:
        raise DataError(
            f"its version is {version.decode('ascii', 'replace')}; this lcorpp reads version {VERSION}"
        )
    try:
        content = json.loads(text)
        schema = TrackSchema(content["channels"], content["interval"], content["classes"], content["points"])
        marker = bytes.fromhex(content["marker"])
    except (ValueError, LookupError, TypeError, RecursionError):
        return None
    return (schema, marker) if len(marker) == MARKER else None


def _names(what: str, names: Sequence[str]) -> tuple[str, ...]:
    if isinstance(names, str) or not isinstance(names, Sequence) or not names:
        raise DataError(f"the {what} of a store are a sequence of names, not {names!r}")
    for name in names:
        if not isinstance(name, str) or not name:
            raise DataError(f"{name!r} is no name for one of the {what}; expected text")
    if len(set(names)) < len(names):
        raise DataError(f"the {what} are {', '.join(names)}; expected every name once")
    return tuple(names)
