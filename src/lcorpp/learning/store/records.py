"""Records of a store: new tracks, stored tracks, label records, and their table rows."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.store.schema import TrackSchema
from lcorpp.values import Array, Distribution, freeze, track_hash

SOURCES = ("person", "robot")
"""Sources of a label: a person who knows the class, or the robot that reported it."""

MAX_JSON_BYTES, MAX_TRAJECTORY_BYTES = 2**20, 2**26

FLOAT64 = np.dtype("<f8")

to_json = json.JSONEncoder(allow_nan=False, separators=(",", ":")).encode

BELIEF_TOLERANCE = 1e-8
"""Tolerance for a stored belief; it was checked exactly when it was written."""

Row = tuple[Any, ...]
"""A row of the table `track` or `later_label`; the last cell is its checksum."""


@dataclass(frozen=True, eq=False)
class NewTrack:
    """A track to be stored.

    trajectory: (channels, time points), as in the store's schema.
    label: its class; None if unknown, e.g. for a decision that ended without a report.
    source: the source of the label, "person" or "robot".
    belief: the robot's final belief over the classes, if it had one.
    context: the observed facts, P-log attribute -> value.
    group: the person's id. If None, identical tracks share a group.
    id: the name of the track in the store; None draws a random one.
    time: when the track was observed, with a time zone; None means now.
    extra: further data that JSON can represent; no classifier uses it.
    """

    trajectory: npt.ArrayLike
    label: str | None
    source: str = "robot"
    belief: Distribution | None = None
    context: Mapping[str, str] = field(default_factory=dict)
    group: str | None = None
    id: str | None = None
    time: datetime | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        name = "" if self.id is None else f"{self.id!r}, "
        return f"NewTrack({name}shape {np.shape(self.trajectory)}, {self.label!r} by {self.source})"


@dataclass(frozen=True, slots=True)
class LabelRecord:
    """A label of a track, with its source, time and the belief behind it; see `NewTrack`."""

    label: str | None
    source: str
    time: datetime
    belief: Distribution | None

    @property
    def confidence(self) -> float:
        """Belief in the label. Without a belief: 1 for a person's label, NaN for the robot's."""
        if self.belief is not None and self.label is not None:
            return self.belief[self.label]
        return 1.0 if self.source == "person" else float("nan")

    def __repr__(self) -> str:
        belief = f" ({self.confidence:.3f})" if self.belief is not None and self.label is not None else ""
        return f"LabelRecord({self.label!r}{belief} by {self.source}, {self.time:%Y-%m-%d %H:%M:%S%z})"


@dataclass(frozen=True, slots=True)
class StoredTrack:
    """A track in a store, without its trajectory, which stays in the file.

    record: the number of its record, from 1. points: its time points.
    label_history: all its label records, oldest first. Other fields: as in `NewTrack`.
    """

    record: int
    id: str
    group: str
    context: Mapping[str, str]
    extra: Mapping[str, Any]
    points: int
    label_history: tuple[LabelRecord, ...]

    @property
    def label_record(self) -> LabelRecord:
        """The valid label record: the newest by a person or, without one, the newest."""
        history = self.label_history
        return next((label for label in reversed(history) if label.source == "person"), history[-1])

    @property
    def label(self) -> str | None:
        return self.label_record.label

    @property
    def source(self) -> str:
        return self.label_record.source

    @property
    def belief(self) -> Distribution | None:
        return self.label_record.belief

    @property
    def time(self) -> datetime:
        """When the track was observed."""
        return self.label_history[0].time

    def __repr__(self) -> str:
        return f"StoredTrack({self.id!r}, {self.points} points, {self.label!r} by {self.source})"


def encode_track(track: NewTrack, record: int, id: str, schema: TrackSchema) -> Row:
    """Convert a track to a row of the table `track`.

    Raises:
        DataError: the track does not fit the schema, or a value cannot be stored.
    """
    trajectory = _check_trajectory(track.trajectory, schema)
    group = track_hash(trajectory) if track.group is None else track.group
    for what, name in (("id", id), ("group", group)):
        if not isinstance(name, str) or not name or not _is_unicode(name):
            raise DataError(f"the {what} of a track is text, not {name!r}")
    for name, value in track.context.items():
        if not isinstance(name, str) or not isinstance(value, str):
            raise DataError(f"the context has {name!r}: {value!r}; expected text for both")
    return with_checksum(
        record,
        id,
        group,
        *_encode_label_cells(track.label, track.source, track.belief, track.time, schema),
        _check_json(dict(track.context)),
        _check_json(dict(track.extra)),
        trajectory.shape[1],
        trajectory.astype(FLOAT64).tobytes(),
    )


def encode_label(
    record: int,
    track: int,
    label: str | None,
    source: str,
    belief: Distribution | None,
    time: datetime | None,
    schema: TrackSchema,
) -> Row:
    """Convert a later label of the track with the record number `track` to a row of `later_label`.

    Raises:
        DataError: an unknown class or source, a belief over other values, or a time without a zone.
    """
    return with_checksum(record, track, *_encode_label_cells(label, source, belief, time, schema))


def decode_track(row: Row, schema: TrackSchema) -> StoredTrack:
    """Convert a row of `track`, without its trajectory.

    Raises:
        DataError: the checksum is wrong, or a cell has a value that lcorpp does not write.
    """
    check_checksum(row)
    record, id, group, label, source, belief, time, context, extra, points, trajectory, _ = row
    if schema.points not in (None, points) or len(trajectory) != points * len(schema.channels) * 8:
        raise DataError(f"{len(trajectory)} bytes of trajectory for {points} time points")
    history = (_decode_label_cells(label, source, belief, time, schema),)
    facts = MappingProxyType(json.loads(context))
    return StoredTrack(record, id, group, facts, MappingProxyType(json.loads(extra)), points, history)


def decode_label(row: Row, schema: TrackSchema) -> tuple[int, int, LabelRecord]:
    """Convert a row of `later_label` to its record number, its track's record number and its label record.

    Raises:
        DataError: as `decode_track`.
    """
    check_checksum(row)
    record, track, label, source, belief, time, _ = row
    return record, track, _decode_label_cells(label, source, belief, time, schema)


def decode_trajectory(row: Row, schema: TrackSchema) -> Array:
    """(channels, time points) the trajectory in a row of `track`, read-only.

    Raises:
        DataError: as `decode_track`.
    """
    check_checksum(row)
    array: Array = np.frombuffer(row[-2], FLOAT64).reshape(len(schema.channels), -1)
    return array


def with_checksum(*cells: Any) -> Row:
    """Append the CRC-32 of the cells: of all but a final BLOB as JSON, then of the BLOB."""
    return (*cells, _checksum(cells))


def _checksum(cells: Row) -> int:
    blob = cells[-1] if isinstance(cells[-1], bytes) else b""
    text = to_json(cells[:-1] if blob else cells)
    return zlib.crc32(blob, zlib.crc32(text.encode()))


def check_checksum(row: Row) -> None:
    """Raise a DataError if the last cell of a row is not the checksum of the others."""
    try:
        right = _checksum(row[:-1]) == row[-1]
    except (TypeError, ValueError):  # a cell of another type
        right = False
    if not right:
        raise DataError("its checksum is wrong")


def _encode_label_cells(
    label: str | None, source: str, belief: Distribution | None, time: datetime | None, schema: TrackSchema
) -> tuple[str | None, str, str | None, str]:
    if label is not None and label not in schema.classes:
        raise DataError(f"unknown class {label!r}; {expected_one_of(schema.classes)}")
    if source not in SOURCES:
        raise DataError(f"unknown source {source!r}; {expected_one_of(SOURCES)}")
    if belief is not None and belief.values != schema.classes:
        raise DataError(
            f"a belief over {', '.join(belief.values)}; the classes here are {', '.join(schema.classes)}"
        )
    time = datetime.now(UTC) if time is None else time
    if not isinstance(time, datetime) or time.utcoffset() is None:
        raise DataError(f"the time {time!r} lacks a zone; expected a datetime such as datetime.now(UTC)")
    return (
        label,
        source,
        None if belief is None else _check_json(belief.probabilities.tolist()),
        time.isoformat(),
    )


def _decode_label_cells(
    label: str | None, source: str, belief: str | None, time: str, schema: TrackSchema
) -> LabelRecord:
    if (label is not None and label not in schema.classes) or source not in SOURCES:
        raise DataError(f"unknown class {label!r} or source {source!r}")
    when = datetime.fromisoformat(time)
    if belief is None:
        return LabelRecord(label, source, when, None)
    shares = json.loads(belief)
    if len(shares) != len(schema.classes) or abs(sum(shares) - 1) > BELIEF_TOLERANCE:
        raise DataError(f"a belief of {shares} over {len(schema.classes)} classes")
    return LabelRecord(label, source, when, Distribution.unchecked(schema.classes, freeze(shares)))


def _check_trajectory(trajectory: npt.ArrayLike, schema: TrackSchema) -> Array:
    """Return a frozen float64 copy, (channels, time points)."""
    try:
        array = freeze(trajectory)
    except (ValueError, TypeError) as error:
        raise DataError(f"a trajectory is an array of numbers: {error}") from None
    channels = ", ".join(schema.channels)
    if array.ndim != 2 or len(array) != len(schema.channels):
        raise DataError(
            f"a trajectory of shape {array.shape}; expected {len(schema.channels)} channels ({channels})"
            " of time points"
        )
    points = array.shape[1]
    if points < 2 or schema.points not in (None, points):
        wanted = "at least 2" if schema.points is None else schema.points
        raise DataError(f"a trajectory of {points} time points; expected {wanted}")
    if not np.isfinite(array).all():
        channel, point = (int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise DataError(
            f"{schema.channels[channel]} at time point {point} (counted from 0) is"
            f" {array[channel, point]}; expected a finite number"
        )
    if array.nbytes > MAX_TRAJECTORY_BYTES:
        raise DataError(f"a trajectory of {array.nbytes} bytes; at most {MAX_TRAJECTORY_BYTES} can be stored")
    return array


def _is_unicode(text: str) -> bool:
    """Whether UTF-8 can encode the text, i.e. it has no lone surrogates."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _check_json(value: Any) -> str:
    try:
        text = to_json(value)
    except (ValueError, TypeError, RecursionError) as error:
        raise DataError(f"a value that JSON cannot represent: {error}") from None
    if len(text) > MAX_JSON_BYTES:
        raise DataError(f"a value of {len(text)} bytes of JSON; at most {MAX_JSON_BYTES} can be stored")
    return text
