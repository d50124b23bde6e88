"""Tracks as they go into a store, as they are known there, and the records between."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.store.frames import MOST_FACTS, MOST_NUMBERS, Frame
from lcorpp.learning.store.layout import TrackSchema
from lcorpp.values import Array, Distribution, freeze, track_hash

SOURCES = ("person", "robot")
"""Who can say what class a track is of: a person who knows, or the robot that reported it."""

NUMBERS = np.dtype("<f8")

ROUNDING = 1e-8


@dataclass(frozen=True, eq=False)
class NewTrack:
    """One track to be stored.

    trajectory: (channels, time points) as the store's schema says.
    label: its class; None where nobody said one, e.g. a decision that ended without a report.
    source: who said so, "person" or "robot".
    belief: the robot's final belief over the target's values, where it had one.
    context: the observed facts, P-log attribute -> value.
    group: whom it is of; None makes equal tracks a group and every other track one of its own.
    id: its name in the store; None draws one.
    time: when it was seen, with a time zone; None takes the time of storing.
    extra: what else is worth keeping, as JSON can hold it; no classifier sees it.
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


@dataclass(frozen=True, slots=True)
class LabelRecord:
    """What was said of a track's class, by whom, when, and the belief behind it; see `NewTrack`."""

    label: str | None
    source: str
    time: datetime
    belief: Distribution | None

    @property
    def confidence(self) -> float:
        """The belief in the label; without a belief 1 where a person said it, NaN where the robot did."""
        if self.belief is not None and self.label is not None:
            return self.belief[self.label]
        return 1.0 if self.source == "person" else float("nan")


@dataclass(frozen=True, slots=True)
class StoredTrack:
    """A track as a store knows it; its numbers are still in the file.

    number: of its record, from 1. label_history: all its label records, in their order.
    points: time points. place: first byte of its record. The rest is as in `NewTrack`.
    """

    number: int
    id: str
    group: str
    context: Mapping[str, str]
    extra: Mapping[str, Any]
    points: int
    place: int
    label_history: tuple[LabelRecord, ...]

    @property
    def judgement(self) -> LabelRecord:
        """What holds: the newest that a person said, or else the newest."""
        return next((j for j in reversed(self.label_history) if j.source == "person"), self.label_history[-1])

    @property
    def label(self) -> str | None:
        return self.judgement.label

    @property
    def source(self) -> str:
        return self.judgement.source

    @property
    def belief(self) -> Distribution | None:
        return self.judgement.belief

    @property
    def time(self) -> datetime:
        """When the track was seen."""
        return self.label_history[0].time


def encoded(track: NewTrack, number: int, id: str, schema: TrackSchema) -> tuple[bytes, bytes]:
    """A track as the facts and the numbers of a frame.

    Raises:
        DataError: it does not fit the schema, or holds what cannot be stored.
    """
    numbers = _trajectory(track.trajectory, schema)
    group = track_hash(numbers) if track.group is None else track.group
    if not isinstance(group, str) or not group:
        raise DataError(f"the group of a track is text, not {group!r}")
    for name, value in track.context.items():
        if not isinstance(name, str) or not isinstance(value, str):
            raise DataError(f"the context has {name!r}: {value!r}; expected text for both")
    facts = {
        "number": number,
        "id": id,
        "group": group,
        **said(track.label, track.source, track.belief, track.time, schema),
        "context": dict(track.context),
        "extra": dict(track.extra),
        "points": numbers.shape[1],
    }
    return _json(facts), numbers.astype(NUMBERS).tobytes()


def encoded_judgement(number: int, id: str, facts: Mapping[str, Any]) -> bytes:
    """A judgement, made by `said`, about the track `id`, as the facts of a frame without numbers."""
    return _json({"number": number, "of": id, **facts})


def said(
    label: str | None, source: str, belief: Distribution | None, time: datetime | None, schema: TrackSchema
) -> dict[str, Any]:
    """A judgement as JSON holds it.

    Raises:
        DataError: an unknown class or source, a belief over other values, a time without a zone.
    """
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
    return {
        "label": label,
        "source": source,
        "belief": None if belief is None else belief.probabilities.tolist(),
        "time": time.isoformat(),
    }


def decoded(frame: Frame, schema: TrackSchema) -> tuple[int, str, LabelRecord, StoredTrack | None]:
    """The record in a frame: its number, the track it is about, what is said of it, and a new track.

    Raises:
        DataError: the frame is whole, but its content is none that this program writes.
    """
    try:
        facts = json.loads(frame.facts.decode())
        number, judgement = facts["number"], _judgement(facts, schema)
        if type(number) is not int or number < 1:
            raise DataError(f"its number is {number!r}; expected 1 or more")
        if "of" in facts:
            return number, _text(facts["of"]), judgement, None
        points = facts["points"]
        if type(points) is not int or points < 2 or schema.points not in (None, points):
            raise DataError(f"its {points!r} time points are not what the head says")
        if len(frame.numbers) != points * len(schema.channels) * NUMBERS.itemsize:
            raise DataError(f"{len(frame.numbers)} bytes of numbers for {points} time points")
        stored = StoredTrack(
            number,
            _text(facts["id"]),
            _text(facts["group"]),
            MappingProxyType({_text(name): _text(value) for name, value in facts["context"].items()}),
            MappingProxyType(dict(facts["extra"])),
            points,
            frame.start,
            (judgement,),
        )
    except DataError:
        raise
    except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
        raise DataError(f"its facts are none of a track: {error}") from None
    return number, stored.id, judgement, stored


def trajectory(frame: Frame, schema: TrackSchema) -> Array:
    """(channels, time points) the numbers of a frame whose content is known to fit the schema."""
    return np.frombuffer(frame.numbers, NUMBERS).reshape(len(schema.channels), -1)


def _trajectory(given: npt.ArrayLike, schema: TrackSchema) -> Array:
    """A frozen float64 copy, (channels, time points)."""
    try:
        numbers = freeze(given)
    except (ValueError, TypeError) as error:
        raise DataError(f"a trajectory is an array of numbers: {error}") from None
    channels = ", ".join(schema.channels)
    if numbers.ndim != 2 or len(numbers) != len(schema.channels):
        raise DataError(
            f"a trajectory of shape {numbers.shape}; expected {len(schema.channels)} channels ({channels})"
            " of time points"
        )
    points = numbers.shape[1]
    if points < 2 or schema.points not in (None, points):
        wanted = "at least 2" if schema.points is None else schema.points
        raise DataError(f"a trajectory of {points} time points; expected {wanted}")
    if not np.isfinite(numbers).all():
        channel, point = (int(i) for i in np.argwhere(~np.isfinite(numbers))[0])
        raise DataError(
            f"{schema.channels[channel]} at time point {point} (counted from 0) is"
            f" {numbers[channel, point]}; expected a finite number"
        )
    if numbers.nbytes > MOST_NUMBERS:
        raise DataError(f"a trajectory of {numbers.nbytes} bytes; at most {MOST_NUMBERS} can be stored")
    return numbers


def _json(facts: Mapping[str, Any]) -> bytes:
    try:
        text = json.dumps(facts, allow_nan=False, separators=(",", ":")).encode()
    except (ValueError, TypeError, RecursionError) as error:
        raise DataError(f"a track with what JSON cannot hold: {error}") from None
    if len(text) > MOST_FACTS:
        raise DataError(f"the facts of a track are {len(text)} bytes; at most {MOST_FACTS} can be stored")
    return text


def _judgement(facts: Mapping[str, Any], schema: TrackSchema) -> LabelRecord:
    label, source, belief = facts["label"], facts["source"], facts["belief"]
    if (label is not None and label not in schema.classes) or source not in SOURCES:
        raise DataError(f"class {label!r} said by {source!r}, which the head does not know")
    time = datetime.fromisoformat(facts["time"])
    if time.tzinfo is None:
        raise DataError(f"the time {facts['time']} lacks a zone")
    return LabelRecord(label, source, time, None if belief is None else _belief(belief, schema))


def _belief(shares: Any, schema: TrackSchema) -> Distribution:
    """What was checked exactly when it was stored is checked more loosely, and quickly, when it is read."""
    if not isinstance(shares, list) or len(shares) != len(schema.classes):
        raise DataError(f"a belief of {shares!r} over {len(schema.classes)} classes")
    if not all(0 <= share < 1 + ROUNDING for share in shares) or abs(sum(shares) - 1) > ROUNDING:
        raise DataError(f"a belief of {shares}, which is no distribution")
    return Distribution.unchecked(schema.classes, freeze(shares))


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise DataError(f"{value!r} where text is expected")
    return value
