"""Messages of people trackers, localisation and speech, as numbers and texts.

The messages are dictionaries; ROS 1 and 2 differ in the names of a stamp's fields only. A message, or a
person in it, that lacks a field or has one of another type is left out with a warning.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from math import atan2, hypot, inf, isfinite
from types import MappingProxyType
from typing import Any, NamedTuple

from lcorpp.errors import WorldError
from lcorpp.worlds.ros.connection import Message
from lcorpp.worlds.ros.fields import (
    FaultLog,
    read_field,
    read_id,
    read_list,
    read_number,
    read_stamp,
    read_text_field,
)
from lcorpp.worlds.ros.pose import Pose

MAX_COORDINATE = 1e8
"""Maximum of a position in metres: UTM coordinates reach 1e7, what is larger is not a place on earth."""

SAME_PLACE = 0.3
"""Metres within which markers of different namespaces are of one person."""

ARROW, BODIES = 0, (1, 2, 3, 10)
"""Types of visualization_msgs/Marker that show a person: arrow; cube, sphere, cylinder and mesh."""

CLASSES = ("person", "people", "pedestrian", "human")
"""Classes of detections that are people, in lower case."""


class Sample(NamedTuple):
    """A sample of a person's track. time: seconds. x, y: metres. columns: further ones, name -> number."""

    time: float
    person: str
    x: float
    y: float
    columns: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True)
class Detection:
    """A person in a message of a tracker.

    id: the tracker's. frame: of the position. time: stamp in seconds, None without one. x, y: metres; in an
        optical frame of a camera (REP 103), whose z axis is ahead, x is ahead and y to the left.
    columns: further columns of a track, name -> number.
    rank: of what was detected; if there are several ranks, only the lowest counts.
    group: parts of different groups at one place are one person.
    kind: the class of what was detected, in lower case; empty if the tracker gives none.
    """

    id: str
    frame: str
    time: float | None
    x: float
    y: float
    rank: int = field(default=0, compare=False)
    group: str = field(default="", compare=False)
    kind: str = field(default="", compare=False)
    columns: Mapping[str, float] = field(default_factory=dict, compare=False)

    @property
    def is_valid(self) -> bool:
        """Whether it has a place and a finite time; some trackers send NaN for a person they lost."""
        return _is_place(self.x, self.y) and isfinite(self.time or 0.0)

    def is_part_of(self, other: Detection) -> bool:
        """Return whether it is a part of another group of the same person."""
        return (
            self.group != other.group
            and self.frame == other.frame
            and hypot(self.x - other.x, self.y - other.y) <= SAME_PLACE
        )


def _is_place(x: float, y: float) -> bool:
    return abs(x) <= MAX_COORDINATE and abs(y) <= MAX_COORDINATE  # False for NaN


def _read_person(person: Any, message: Message) -> Detection | None:
    return _detect(read_field(person, "name"), message, read_field(person, "position"))


def _read_track(track: Any, message: Message) -> Detection | None:
    position, id_ = read_field(track, "pose", "pose", "position"), read_field(track, "track_id")
    return None if track.get("is_occluded") else _detect(id_, message, position)


def _read_marker(marker: Any, message: Message) -> Detection | None:
    kind, action = (marker.get(name, 0) for name in ("type", "action"))
    if type(kind) is not int or type(action) is not int:
        raise WorldError("type and action of a marker are not integers")
    is_arrow = kind == ARROW and not marker.get("points")  # by two points: a velocity, the pose is not used
    if action != 0 or not (is_arrow or kind in BODIES):  # other actions delete markers
        return None
    id_, group = read_field(marker, "id"), str(marker.get("ns"))
    return _detect(id_, marker, read_field(marker, "pose", "position"), rank=int(is_arrow), group=group)


def _read_measurement(measured: Any, message: Message) -> Detection | None:
    id_ = next((measured[name] for name in ("object_id", "name") if measured.get(name)), None)
    own = measured if read_text_field(measured, "header", "frame_id") else message
    return _detect(id_, own, read_field(measured, "pos"))


def _read_legs(person: Any, message: Message) -> Detection | None:
    return _detect(read_field(person, "id"), message, read_field(person, "pose", "position"))


def _is_drawn(item: Any) -> bool:
    return isinstance(item, Mapping) and "type" in item and item.get("action") == 0


def _read_detection(detection: Any, message: Message) -> Detection | None:
    position = read_field(detection, "bbox", "center", "position")
    id_ = read_id(detection.get("id"))
    if id_ is None and detection.get("is_tracking", True):  # Foxy and Galactic
        id_ = read_id(detection.get("tracking_id"))
    return replace(_detect(id_, message, position), kind=_read_class(detection))


def _read_class(detection: Mapping[str, Any]) -> str:
    """Return the most probable class of a detection, in lower case; empty if there is none."""
    best, chosen = -inf, ""
    for result in read_list(detection, "results") if detection.get("results") is not None else ():
        hypothesis = result.get("hypothesis", result) if isinstance(result, Mapping) else None
        if not isinstance(hypothesis, Mapping):
            raise WorldError("a result has no hypothesis")
        names = (name for name in ("class_id", "id") if name in hypothesis)  # before Galactic: id
        kind = read_id(read_field(hypothesis, next(names, "class_id")))
        score = read_number(hypothesis, "score") if "score" in hypothesis else 0.0
        if kind is not None and (score > best or not chosen):
            best, chosen = score if isfinite(score) else -inf, kind.strip().lower()
    return chosen


@dataclass(frozen=True)
class PeopleFormat:
    """A type of trackers' messages. items: the field with the people. read: reads one of them."""

    items: str
    read: Callable[[Any, Message], Detection | None]


PEOPLE: Mapping[str, PeopleFormat] = {
    "people_msgs/People": PeopleFormat("people", _read_person),
    "spencer_tracking_msgs/TrackedPersons": PeopleFormat("tracks", _read_track),
    "visualization_msgs/MarkerArray": PeopleFormat("markers", _read_marker),
    "vision_msgs/Detection3DArray": PeopleFormat("detections", _read_detection),
    "people_msgs/PositionMeasurementArray": PeopleFormat("people", _read_measurement),
    "leg_tracker/PersonArray": PeopleFormat("people", _read_legs),
}
"""Type of a tracker's messages -> how they are read."""


class PeopleReader:
    """Read the messages of one tracker.

    A person is once in a message: of detections with one id, the first counts. Parts of a person, such as
    markers of several namespaces at one place, count once.

    Args:
        kind: a key of `PEOPLE`. place: the topic or file that warnings name; by default the type.
        classes: of detections that are people, in lower case; others are left out.
    """

    def __init__(self, kind: str, place: str | None = None, *, classes: Collection[str] = CLASSES) -> None:
        self._classes = frozenset(classes)
        self._kind, self._format = kind, PEOPLE[kind]
        self._faults = FaultLog(place or kind)
        self._rank: float = inf  # the lowest so far

    def read(self, message: Message) -> list[Detection]:
        """Return the people in a message; what cannot be read is left out, each kind with one warning."""
        try:
            items = read_list(message, self._format.items)
        except WorldError as fault:
            self._faults.warn(f"a message that is not {self._kind} is left out: {fault}")
            return []
        found = [detection for item in items if (detection := self._read(item, message)) is not None]
        if not found and self._rank == inf and any(map(_is_drawn, items)):
            self._faults.warn("no marker shows a person; expected a cube, sphere, cylinder, mesh or arrow")
        self._rank = min([self._rank, *(detection.rank for detection in found)])
        return self._choose(detection for detection in found if detection.rank == self._rank)

    def _read(self, item: Any, message: Message) -> Detection | None:
        """Return the person in a part of a message; None if there is none."""
        try:
            if not isinstance(item, Mapping):
                raise WorldError(f"it is a {type(item).__name__}; expected a message")
            found = self._format.read(item, message)
        except WorldError as fault:
            self._faults.warn(f"a part of {self._format.items!r} is left out: {fault}")
            return None
        if found is not None and found.kind and found.kind not in self._classes:
            people = ", ".join(sorted(self._classes))
            self._faults.warn(
                f"detections of the class {found.kind!r} are left out; the classes of people are {people}"
                " (robot.toml: [people] classes)"
            )
            return None
        return found if found is not None and found.is_valid else None

    def _choose(self, detections: Iterable[Detection]) -> list[Detection]:
        """Return one detection for each person."""
        chosen = dict[str, Detection]()
        for new in detections:
            old = chosen.get(new.id)
            if old is None:
                if not any(new.is_part_of(other) for other in chosen.values()):
                    chosen[new.id] = new
            elif new.group == old.group:
                self._faults.warn(f"the id {new.id!r} is twice in one message; the first one counts", "twice")
        return list(chosen.values())


POSES: Mapping[str, tuple[str, ...]] = {
    "nav_msgs/Odometry": ("pose", "pose"),
    "geometry_msgs/PoseWithCovarianceStamped": ("pose", "pose"),
    "geometry_msgs/PoseStamped": ("pose",),
}
"""Type of the messages of a localisation -> the fields that lead to the pose."""

MIN_QUATERNION = 0.1
"""Minimum length of a quaternion, which is 1 but for rounding; of zeros it is not a heading."""

TEXTS: Mapping[str, str] = {
    "std_msgs/String": "data",
    "hri_msgs/LiveSpeech": "final",
}
"""Type of a speech recogniser's messages -> the field of the text."""


def read_people(kind: str, message: Message) -> list[Detection]:
    """Return the people in one message of a tracker, see `PeopleReader`.

    Args:
        kind: a key of `PEOPLE`.
    """
    return PeopleReader(kind).read(message)


def _detect(id_: object, message: Message, position: Any, *, rank: int = 0, group: str = "") -> Detection:
    """Return a detection. message: the one with the header. position: its fields are x, y and z.

    Raises:
        WorldError: there is no id or no header, or a field is missing.
    """
    name = read_id(id_)
    if name is None:
        raise WorldError("it has no id")
    frame = read_text_field(message, "header", "frame_id").lstrip("/")
    if not frame:
        raise WorldError("it has no frame")
    time = read_stamp(message, "header", "stamp")
    if frame.endswith(("_optical_frame", "_optical")):
        x, y = read_number(position, "z"), -read_number(position, "x")
    else:
        x, y = read_number(position, "x"), read_number(position, "y")
    return Detection(name, frame, time, x, y, rank, group)


def read_pose(kind: str, message: Message) -> Pose | None:
    """Return the pose in a message of the localisation; None if numbers are not finite or all 0.

    Args:
        kind: a key of `POSES`.

    Raises:
        WorldError: the message is of another type.
    """
    try:
        pose = read_field(message, *POSES[kind])
        x, y = (read_number(pose, "position", name) for name in ("x", "y"))
        qx, qy, qz, qw = (read_number(pose, "orientation", name) for name in ("x", "y", "z", "w"))
    except WorldError as fault:
        raise WorldError(f"a message that is not {kind}: {fault}") from None
    size = hypot(qx, qy, qz, qw)  # 0 without a heading
    if not (_is_place(x, y) and isfinite(size) and size >= MIN_QUATERNION):
        return None
    return Pose(x, y, atan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz))


def read_speed(message: Message) -> float | None:
    """Return the speed in a nav_msgs/Odometry, m/s plus rad/s, 0 at standstill; None without a velocity."""
    try:
        parts = [
            [read_number(message, "twist", "twist", part, name) for name in ("x", "y", "z")]
            for part in ("linear", "angular")
        ]
    except WorldError:
        return None
    speed = sum(hypot(*part) for part in parts)
    return speed if isfinite(speed) else None


def read_text(kind: str, message: Message) -> str:
    """Return the text in a speech recogniser's message.

    Args:
        kind: a key of `TEXTS`.

    Raises:
        WorldError: the message is of another type.
    """
    try:
        return read_text_field(message, TEXTS[kind])
    except WorldError as fault:
        raise WorldError(f"a message that is not {kind}: {fault}") from None
