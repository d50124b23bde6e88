"""Messages of people trackers, localisation and speech, as numbers and texts.

Each reader takes a message of one type as a dictionary; ROS 1 and 2 differ in the names of a stamp's fields
only. A message that lacks a field is a typed error, since then the type in the configuration is wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import atan2, isfinite, nan
from typing import Any

from lcorpp.errors import WorldError
from lcorpp.worlds.ros.connection import Message
from lcorpp.worlds.ros.pose import Pose


@dataclass(frozen=True)
class Detection:
    """A person in a message of a tracker.

    id: the tracker's. frame: of the position. time: stamp in seconds, None without one. x, y: metres.
    """

    id: str
    frame: str
    time: float | None
    x: float
    y: float

    @property
    def is_valid(self) -> bool:
        """Whether its numbers are finite and it has an id; some trackers send NaN for a person they lost."""
        return bool(self.id) and all(map(isfinite, (self.x, self.y, self.time or 0.0)))


def _read_people(message: Message) -> Iterator[Detection]:
    frame, time = _read_header(message)
    for person in message["people"]:
        yield _detect(person["name"], frame, time, person["position"])


def _read_tracked_persons(message: Message) -> Iterator[Detection]:
    frame, time = _read_header(message)
    for track in message["tracks"]:
        if not track.get("is_occluded", False):
            yield _detect(track["track_id"], frame, time, track["pose"]["pose"]["position"])


def _read_markers(message: Message) -> Iterator[Detection]:
    for marker in message["markers"]:
        if marker.get("action", 0) == 0:  # others delete markers
            yield _detect(marker["id"], *_read_header(marker), marker["pose"]["position"])


def _read_detections(message: Message) -> Iterator[Detection]:
    frame, time = _read_header(message)
    for detection in message["detections"]:
        yield _detect(detection["id"], frame, time, detection["bbox"]["center"]["position"])


def _read_transforms(message: Message) -> Iterator[Detection]:
    for transform in message["transforms"]:
        name = transform["child_frame_id"]
        if name.startswith("person_"):  # ROS4HRI, REP 155
            id_ = name.removeprefix("person_")
            yield _detect(id_, *_read_header(transform), transform["transform"]["translation"])


PEOPLE: Mapping[str, Callable[[Message], Iterator[Detection]]] = {
    "people_msgs/People": _read_people,
    "spencer_tracking_msgs/TrackedPersons": _read_tracked_persons,
    "visualization_msgs/MarkerArray": _read_markers,
    "vision_msgs/Detection3DArray": _read_detections,
    "tf2_msgs/TFMessage": _read_transforms,
}
"""Type of a tracker's messages -> their reader."""

POSES: Mapping[str, tuple[str, ...]] = {
    "nav_msgs/Odometry": ("pose", "pose"),
    "geometry_msgs/PoseWithCovarianceStamped": ("pose", "pose"),
    "geometry_msgs/PoseStamped": ("pose",),
}
"""Type of the messages of a localisation -> the fields that lead to the pose."""

TEXTS: Mapping[str, str] = {
    "std_msgs/String": "data",
    "hri_msgs/LiveSpeech": "final",
}
"""Type of a speech recogniser's messages -> the field of the text."""


def read_people(kind: str, message: Message) -> list[Detection]:
    """Return the people in a tracker's message.

    Args:
        kind: a key of `PEOPLE`.

    People without an id, or whose numbers are not finite, are left out.

    Raises:
        WorldError: the message is of another type.
    """
    try:
        return [person for person in PEOPLE[kind](message) if person.is_valid]
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise WorldError(f"a message that is no {kind}: {type(error).__name__}: {error}") from None


def read_pose(kind: str, message: Message) -> Pose:
    """Return the pose in a message of the localisation.

    Args:
        kind: a key of `POSES`.

    Raises:
        WorldError: the message is of another type.
    """
    try:
        pose: Any = message
        for field in POSES[kind]:
            pose = pose[field]
        position, q = pose["position"], pose["orientation"]
        sine = 2 * (q["w"] * q["z"] + q["x"] * q["y"])
        cosine = 1 - 2 * (q["y"] ** 2 + q["z"] ** 2)
        return Pose(float(position["x"]), float(position["y"]), atan2(sine, cosine))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise WorldError(f"a message that is no {kind}: {type(error).__name__}: {error}") from None


def read_text(kind: str, message: Message) -> str:
    """Return the text in a speech recogniser's message.

    Args:
        kind: a key of `TEXTS`.

    Raises:
        WorldError: the message is of another type.
    """
    text = message.get(TEXTS[kind])
    if not isinstance(text, str):
        raise WorldError(f"a message that is no {kind}: it has no text {TEXTS[kind]!r}")
    return text


def read_stamp(stamp: Message) -> float | None:
    """Return the seconds of a stamp of ROS 1 or 2; None for an empty one."""
    seconds, part = ("secs", "nsecs") if "secs" in stamp else ("sec", "nanosec")
    time = float(stamp[seconds]) + 1e-9 * float(stamp[part])
    return time or None


def _read_header(message: Message) -> tuple[str, float | None]:
    header = message["header"]
    return str(header["frame_id"]).lstrip("/"), read_stamp(header["stamp"])


def _detect(id_: object, frame: str, time: float | None, position: Message) -> Detection:
    x, y = (nan if position[name] is None else float(position[name]) for name in ("x", "y"))
    return Detection(str(id_), frame, time, x, y)  # None: rosbridge has no NaN
