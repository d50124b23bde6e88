"""The schema and the records of a store: new tracks, stored tracks, label records, and their table rows."""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_value
from lcorpp.errors import DataError, expected_one_of
from lcorpp.notebook import join_some
from lcorpp.values import CHANNELS, Array, Dataset, Distribution, freeze, strip_padding, track_hash

SOURCES = ("person", "robot")
"""Sources of a label: a person who knows the class, or the robot that reported it."""

MAX_POINTS, MAX_JSON_BYTES, MAX_TRAJECTORY_BYTES = 2**20, 2**20, 2**26
"""Limits of a track: time points, bytes of its context or extra data as JSON, bytes of its trajectory."""

FEATURES = 1
"""Time points of a table of features; a series has at least two."""

FLOAT64 = np.dtype("<f8")

to_json = json.JSONEncoder(allow_nan=False, separators=(",", ":")).encode

Row = tuple[Any, ...]
"""A row of a table; the last cell is its checksum."""


@dataclass(frozen=True)
class TrackSchema:
    """Channels, interval, classes and length of all tracks in a store.

    channels: names of the rows of a trajectory, those in `values.CHANNELS` in m, m/s and rad; or the names of
        features.
    interval: seconds between two time points; features have none, and ignore it.
    classes: the possible labels, i.e. the values that a sense classifies, in their order.
    points: time points per track; None if the length varies; 1 for features.

    Raises:
        DataError: a name is empty or repeated, or a number is out of range.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import TrackSchema
        >>> data = Dataset([[[0.0, 1.0], [0.0, 0.5]]], ["interested"], interval=0.1)
        >>> schema = TrackSchema.from_dataset(data, ["interested", "not_interested"])
        >>> print(schema)
        2 time points of x, y every 0.1 s
    """

    channels: tuple[str, ...]
    interval: float
    classes: tuple[str, ...]
    points: int | None = None

    def __post_init__(self) -> None:
        for what, names in (("channels", self.channels), ("classes", self.classes)):
            object.__setattr__(self, what, _check_names(what, names))
        if not isinstance(self.interval, int | float) or not 0 < self.interval < math.inf:
            raise DataError(f"the interval is {self.interval!r} s; expected a finite number above 0")
        object.__setattr__(self, "interval", float(self.interval))
        if self.points is not None and not (isinstance(self.points, int) and 1 <= self.points <= MAX_POINTS):
            raise DataError(f"tracks of {self.points!r} time points; expected 1 to {MAX_POINTS}, or None")

    @classmethod
    def from_dataset(cls, dataset: Dataset, classes: Sequence[str]) -> TrackSchema:
        """Return the schema of the tracks, of any length if theirs differ, or features in `dataset`."""
        points = FEATURES if dataset.kind == "table" else dataset.trajectories.shape[2]
        is_equal = not len(dataset) or dataset.lengths.min() == points
        return cls(dataset.channels, dataset.interval, tuple(classes), points if is_equal else None)

    @property
    def is_table(self) -> bool:
        """Whether the signals are features, (features,), instead of channels over time."""
        return self.points == FEATURES

    @property
    def is_motion(self) -> bool:
        """Whether all channels are those of motion."""
        return not self.is_table and set(self.channels) <= set(CHANNELS)

    @property
    def unit(self) -> str:
        """The plural noun of the cases, as in `Dataset.unit`."""
        return "tracks" if self.is_motion else "cases"

    def __str__(self) -> str:
        if self.is_table:
            return f"features {join_some(self.channels)}"
        points = f"{self.points} time points of " if self.points else ""
        return f"{points}{join_some(self.channels)} every {self.interval:g} s"

    def check_equal(self, other: TrackSchema, where: str) -> None:
        """Check that tracks of the schema `other` fit a store of this schema.

        Args:
            where: the name of the store, for the message.

        Raises:
            DataError: the schemas differ; the message names the first difference.
        """
        for what, here, there in (
            ("channels", join_some(self.channels), join_some(other.channels)),
            ("interval", f"{self.interval:g} s", f"{other.interval:g} s"),
            ("classes", ", ".join(self.classes), ", ".join(other.classes)),
            ("time points of a track", self.points or "any number", other.points or "any number"),
        ):
            if here != there:
                raise DataError(f"{where}: its {what}: {here}; the tracks to be stored have: {there}")


@dataclass(frozen=True, eq=False)
class NewTrack:
    """A track to be stored.

    trajectory: (channels, time points) or (features,), as in the store's schema. Padding is removed. None if
        the sense perceived nothing of the person; such a track has no label, and nothing is learnt from it.
    label: its class; None if unknown, e.g. for a decision that ended without a report.
    source: the source of the label, "person" or "robot".
    belief: the robot's final belief over the classes, if it had one.
    context: the observed facts, P-log attribute -> value.
    group: the person's id. If None, identical tracks share a group.
    id: the name of the track in the store; None draws a random one.
    time: when the track was observed, with a time zone; None means now.
    extra: further data that JSON can represent; no classifier uses it.

    Examples:
        >>> from lcorpp.learning import NewTrack, Store, TrackSchema
        >>> track = NewTrack([[0.0, 0.1, 0.3], [0.0, 0.0, 0.0]], "interested", context={"time": "morning"})
        >>> with Store("new.tracks", TrackSchema(["x", "y"], 0.1, ["interested"])) as store:
        ...     _ = store.append(track)
        ...     print(store.snapshot().tracks[0].context)
        {'time': 'morning'}
    """

    trajectory: npt.ArrayLike | None
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
        shape = "no signal" if self.trajectory is None else f"shape {np.shape(self.trajectory)}"
        return f"NewTrack({name}{shape}, {self.label!r} by {self.source})"


@dataclass(frozen=True, slots=True)
class LabelRecord:
    """A label of a track, with its source, time and the belief behind it; see `NewTrack`.

    Examples:
        >>> from lcorpp.learning import NewTrack, Store, TrackSchema
        >>> with Store("labels.tracks", TrackSchema(["x", "y"], 0.1, ["no", "yes"])) as store:
        ...     id = store.append(NewTrack([[0.0, 0.1], [0.0, 0.0]], "no"))  # the robot's report
        ...     store.relabel(id, "yes")  # a person corrects it
        ...     track = store.snapshot().tracks[0]
        >>> [(record.source, record.label) for record in track.label_history]
        [('robot', 'no'), ('person', 'yes')]
    """

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

    record: the number of its record, from 1. points: its time points, 1 of features, 0 without a signal.
    label_history: all its label records, oldest first. Other fields: as in `NewTrack`.

    Examples:
        >>> from lcorpp.learning import NewTrack, Store, TrackSchema
        >>> with Store("stored.tracks", TrackSchema(["x", "y"], 0.1, ["no", "yes"])) as store:
        ...     _ = store.append(NewTrack([[0.0, 0.1, 0.3], [0.0, 0.0, 0.0]], "no", id="7"))
        ...     track = store.snapshot().tracks[0]
        >>> track.id, track.points, track.label, track.source
        ('7', 3, 'no', 'robot')
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
    """Convert a track to a row of the table `track`; a DataError means that it does not fit the schema."""
    check_value(track.label, str | None, "the label of a track")
    check_value(track.source, str, "the source of a label")
    check_value(track.belief, Distribution | None, "the belief in a label")
    check_value(track.context, Mapping[Any, Any], "the context of a track")
    check_value(track.extra, Mapping[Any, Any], "what else is known of a track")
    if track.trajectory is None:
        if track.label is not None:
            raise DataError(f"a track without a signal is labelled {track.label!r}; expected no label")
        trajectory: Array = np.empty((len(schema.channels), 0))
    else:
        trajectory = _check_trajectory(track.trajectory, schema)
    group = track_hash(trajectory) if track.group is None else track.group
    for what, name in (("id", id), ("group", group)):
        if not isinstance(name, str) or not name or name.encode(errors="ignore").decode() != name:
            raise DataError(f"the {what} of a track is text, not {name!r}")
    for name, value in track.context.items():
        if not isinstance(name, str) or not isinstance(value, str):
            raise DataError(f"the context has {name!r}: {value!r}; expected text for both")
    facts = _encode_json(dict(track.context)), _encode_json(dict(track.extra))
    label = encode_label(track.label, track.source, track.belief, track.time, schema)
    return with_checksum(record, id, group, *facts, *label, trajectory.astype(FLOAT64).tobytes())


def encode_label(
    label: str | None, source: str, belief: Distribution | None, time: datetime | None, schema: TrackSchema
) -> Row:
    """Convert a label to the cells label, source, belief and time of a row, or raise a DataError."""
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
    shares = None if belief is None else _encode_json(belief.probabilities.tolist())
    return label, source, shares, time.isoformat()


def decode_track(row: Row, schema: TrackSchema) -> StoredTrack:
    """Convert an intact row of `track`, without its trajectory."""
    record, id, group, context, extra, *label, trajectory, _ = row
    facts = MappingProxyType(json.loads(context)), MappingProxyType(json.loads(extra))
    points = len(trajectory) // (FLOAT64.itemsize * len(schema.channels))
    return StoredTrack(record, id, group, *facts, points, (decode_label(label, schema),))


def decode_label(cells: Sequence[Any], schema: TrackSchema) -> LabelRecord:
    """Convert the cells label, source, belief and time of an intact row."""
    label, source, shares, time = cells
    belief = None if shares is None else Distribution.unchecked(schema.classes, freeze(json.loads(shares)))
    return LabelRecord(label, source, datetime.fromisoformat(time), belief)


def with_checksum(*cells: Any) -> Row:
    """Append the CRC-32 of the cells: of all but a final BLOB as JSON, then of the BLOB."""
    has_blob = isinstance(cells[-1], bytes)
    blob, text = (cells[-1], to_json(cells[:-1])) if has_blob else (b"", to_json(cells))
    return (*cells, zlib.crc32(blob, zlib.crc32(text.encode())))


def is_intact(row: Row) -> bool:
    """Whether the last cell of a row is the checksum of the others."""
    try:
        return with_checksum(*row[:-1]) == row
    except (TypeError, ValueError):  # a cell of another type
        return False


def _check_trajectory(trajectory: npt.ArrayLike, schema: TrackSchema) -> Array:
    """Return a frozen float64 copy, (channels, time points) without padding or (features,)."""
    try:
        array = strip_padding(freeze(trajectory))
    except (ValueError, TypeError) as error:
        raise DataError(f"a trajectory is an array of numbers: {error}") from None
    names, ndim = join_some(schema.channels), 1 if schema.is_table else 2
    if array.ndim != ndim or len(array) != len(schema.channels):
        expected = f"features ({names})" if schema.is_table else f"channels ({names}) of time points"
        raise DataError(f"a trajectory of shape {array.shape}; expected {len(schema.channels)} {expected}")
    points = FEATURES if schema.is_table else array.shape[1]
    if schema.points not in (None, points) or (points < 2 and not schema.is_table):
        wanted = "at least 2" if schema.points is None else schema.points
        raise DataError(f"a trajectory of {points} time points; expected {wanted}")
    if not np.isfinite(array).all():
        channel, *point = (int(i) for i in np.argwhere(~np.isfinite(array))[0])
        at = "" if schema.is_table else f" at time point {point[0]} (counted from 0)"
        raise DataError(
            f"{schema.channels[channel]}{at} is {array[(channel, *point)]}; expected a finite number"
        )
    if array.nbytes > MAX_TRAJECTORY_BYTES:
        raise DataError(f"a trajectory of {array.nbytes} bytes; at most {MAX_TRAJECTORY_BYTES} can be stored")
    return array


def _encode_json(value: Any) -> str:
    try:
        text = to_json(value)
    except (ValueError, TypeError, RecursionError) as error:
        raise DataError(f"a value that JSON cannot represent: {error}") from None
    if len(text) > MAX_JSON_BYTES:
        raise DataError(f"a value of {len(text)} bytes of JSON; at most {MAX_JSON_BYTES} can be stored")
    return text


def _check_names(what: str, names: Sequence[str]) -> tuple[str, ...]:
    if isinstance(names, str) or not isinstance(names, Sequence) or not names:
        raise DataError(f"the {what} of a store are a sequence of names, not {names!r}")
    for name in names:
        if not isinstance(name, str) or not name:
            raise DataError(f"{name!r} is not a name for one of the {what}; expected text")
    if len(set(names)) < len(names):
        raise DataError(f"the {what} are {', '.join(names)}; expected every name once")
    return tuple(names)
