"""People as frames of ROS4HRI (REP 155): persons, faces, gazes and bodies, through the tree of frames.

A face or body belongs to the person whose topic /humans/persons/<person>/face_id, or body_id, named it last.
So a person may have several faces, one after the other, and a face may pass to another person.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import atan2, hypot, inf, isfinite
from typing import Any

import numpy as np

from lcorpp.errors import WorldError
from lcorpp.values import Array
from lcorpp.worlds.ros.connection import Message
from lcorpp.worlds.ros.fields import FaultLog, name_kind, read_list, read_stamp, read_text_field
from lcorpp.worlds.ros.sensor_messages import MAX_COORDINATE, Detection
from lcorpp.worlds.ros.transforms import TransformTree, read_frame, read_point, to_body_axes

PERSONS, PERSONS_KIND = "/humans/persons/tracked", "hri_msgs/IdsList"
"""Topic of the ids of the persons, and its type."""

STATIC = "/tf_static"
"""Topic of the frames that do not move."""

PART_KIND = "std_msgs/String"
"""Type of the topics that name a person's face and body."""

PARTS = ("person", "face", "gaze", "body")
"""Kinds of frames of a person, by rank: of what has no known person only the lowest rank counts."""

MAX_WAIT = 1.0
"""Seconds that a new face or body waits for its person; then its own id is the name."""

MAX_PAUSE = 0.5
"""Seconds after a sample of a person's face in which other frames of the person do not count."""

MAX_FRAMES = 1000
"""Frames of people that are known: the latest; ids change, and a robot runs for days."""

GAZE_LAG = 0.1
"""Seconds that a face waits for its gaze, by the stamps of frames of people."""

_FRAME = re.compile(rf"({'|'.join(PARTS)})_(.*\S.*)")
_PART_TOPIC = re.compile(r"/humans/persons/([^/]+)/(face|body)_id")


def name_part_topics(person: str) -> tuple[str, str]:
    """Return the topics that name the face and the body of a person."""
    return f"/humans/persons/{person}/face_id", f"/humans/persons/{person}/body_id"


def is_human_topic(topic: str, kind: str) -> bool:
    """Return whether a `HumanReader` takes the messages of a topic beside its frames."""
    is_part = kind == PART_KIND and _PART_TOPIC.fullmatch(topic) is not None
    return is_part or (topic, kind) == (PERSONS, PERSONS_KIND)


@dataclass
class _Found:
    """A frame of a person in a message.

    kind: of `PARTS`. id: the tracker's. detection: its sample. owner: the person whose it is, None if unknown
        when it came. is_current: whether it was the owner's latest face.
    """

    kind: str
    id: str
    detection: Detection
    owner: str | None = None
    is_current: bool = False

    @property
    def part(self) -> tuple[str, str]:
        """The part of a person that is named, with its id: a gaze is of the face with its id."""
        return "face" if self.kind == "gaze" else self.kind, self.id


@dataclass
class _Waiting:
    """The samples of a face or body without a known person. since: stamp of the first."""

    since: float
    found: list[_Found] = field(default_factory=list)


class HumanReader:
    """Read people from the frames of a robot, and their gaze where there is a face.

    Of each person the face counts; the person's own frame, or the body, where there is no face. A face whose
    gaze is a frame of its own is a sample once the gaze has come. Faces of unknown persons are people by
    their own ids, unless there are frames of persons.

    The columns of a detection with a face: z (m), facing and tilt (rad), in its frame; gaze_angle,
    robot_angle (rad) and face_distance (m), relative to the robot's head.

    Args:
        place: the topic or file that warnings name.
        targets: frames in which people are placed, the first one that is connected; without any of them
            positions are in the frame of the message.
        head: the frame of the robot's head or camera, ahead of which it looks; None takes that in which a
            face comes.
        waits: whether new faces and bodies wait for their persons from the first message; otherwise from the
            first message about persons.
    """

    def __init__(
        self, place: str, *, targets: Sequence[str] = (), head: str | None = None, waits: bool = False
    ) -> None:
        self.tree, self._faults = TransformTree(place), FaultLog(place)
        self._targets, self._head = tuple(t.lstrip("/") for t in targets), head and head.lstrip("/")
        self._person_of = dict[tuple[str, str], str]()  # kind and id of a part -> person
        self._part_of = dict[tuple[str, str], str]()  # kind and person -> id of the latest part
        self._pending = dict[str, tuple[_Found, str]]()  # face -> its sample and its frame
        self._waiting, self._named = dict[tuple[str, str], _Waiting](), set[tuple[str, str]]()
        self._waits, self._rank = waits, inf  # the lowest rank of what has no known person
        self._last = dict[tuple[str, str], tuple[float | None, ...]]()
        self._faced = dict[str, float]()  # person -> stamp of the last sample of the face
        self.persons = set[str]()  # who are tracked now

    def read_human(self, topic: str, message: Message) -> list[Detection]:
        """Take a message of a topic about persons; return the samples that have waited for it."""
        try:
            part = _PART_TOPIC.fullmatch(topic)
            if part is None:
                self._waits, self.persons = True, {str(name) for name in read_list(message, "ids")}
                return []
            return self._assign(part[1], part[2], read_text_field(message, "data"))
        except WorldError as fault:
            self._faults.warn(f"a message of {topic} is left out: {fault}")
            return []

    def read(self, message: Message, recorded: float | None = None) -> list[Detection]:
        """Return the people in a message with frames; what cannot be read is left out, with warnings.

        Args:
            recorded: seconds, the time of frames without a stamp.
        """
        try:
            items = read_list(message, "transforms")
        except WorldError:
            self.tree.add(message)  # which warns
            return []
        people = list[Any]()
        for item in items:  # people are placed in the frames of this message, and gazes follow their faces
            if self._is_person(item):
                people.append(item)
            else:
                self.tree.add_transform(item)
        people.sort(key=lambda item: item["child_frame_id"].lstrip("/").startswith("gaze_"))
        found = [one for item in people for one in self._find(item, recorded)]
        return [ready for one in found for ready in self._release(one)]

    def _is_person(self, item: Any) -> bool:
        try:
            return _FRAME.fullmatch(read_frame(item, "child_frame_id")) is not None
        except WorldError:
            return False

    def flush(self) -> list[Detection]:
        """Return the samples that wait for a gaze or for a person, at the end of all messages."""
        ready = [one for face in list(self._pending) for one in self._release(self._pending.pop(face)[0])]
        for key, waiting in list(self._waiting.items()):
            del self._waiting[key]
            self._named.add(key)
            ready += [one for found in waiting.found for one in self._choose(found)]
        return ready

    def _assign(self, person: str, kind: str, part: str) -> list[Detection]:
        self._waits = True
        self.persons.add(person)
        if not part:  # the person has none now
            return []
        self._person_of[kind, part] = person
        self._part_of[kind, person] = part
        waiting = self._waiting.pop((kind, part), None)
        found = [] if waiting is None else waiting.found
        return [one for each in found for one in self._choose(self._claim(each))]

    def _claim(self, found: _Found) -> _Found:
        """Return a frame with the person whose it is now."""
        owner = found.id if found.kind == "person" else self._person_of.get(found.part)
        is_current = found.kind == "face" and self._part_of.get(("face", owner or "")) == found.id
        return replace(found, owner=owner, is_current=is_current)

    def _find(self, item: Any, recorded: float | None) -> Iterator[_Found]:
        """Yield the frames of people that are complete with a transform."""
        try:
            child, parent = read_frame(item, "child_frame_id"), read_frame(item, "header", "frame_id")
            matched = _FRAME.fullmatch(child)
            assert matched is not None
            kind, id = matched.groups()
            time = read_stamp(item, "header", "stamp")
            if child == parent or (kind == "gaze" and _FRAME.fullmatch(parent)):
                self.tree.add_transform(item)
                pending = self._pending.pop(id, None) if kind == "gaze" and child != parent else None
                if pending is not None:
                    yield self._turn(*pending, child)
                return
            found = self._locate(kind, id, parent, item, recorded if time is None else time)
        except WorldError as fault:
            self._faults.warn(f"a person is left out: {fault}", name_kind(str(fault)))
            return
        if found is None:
            return
        found = self._claim(found)
        yield from self._end_waits(found.detection.time)
        if kind != "face":
            yield found
            return
        before = self._pending.pop(id, None)
        if before is not None:
            yield before[0]
        self._pending[id] = found, self._head or parent

    def _end_waits(self, now: float | None) -> Iterator[_Found]:
        """Yield the faces whose gaze has not come in time."""
        for id, (face, _) in list(self._pending.items()):
            if now is not None and abs(now - (face.detection.time or 0.0)) > GAZE_LAG:
                del self._pending[id]
                yield face

    def _locate(self, kind: str, id: str, parent: str, item: Any, time: float | None) -> _Found | None:
        """Return a frame of a person with its place, and of a face its direction; None if it is twice."""
        child = f"{kind}_{id}"
        point = read_point(item, "transform", "translation")
        if not isfinite(time or 0.0) or self._is_twice(kind, id, time, point):
            return None
        self.tree.add_transform(item)
        frame = next((t for t in self._targets if self.tree.find(parent, t) is not None), parent)
        to_frame = self.tree.find(parent, frame)
        assert to_frame is not None
        x, y, z = to_body_axes(to_frame.place(point), frame).tolist()
        if max(abs(x), abs(y), abs(z)) > MAX_COORDINATE:
            raise WorldError(f"{child!r} is more than {MAX_COORDINATE:g} m away")
        rank = PARTS.index(kind)
        found = _Found(kind, id, Detection(id, frame, time, x, y, rank, columns={"z": z}))
        if kind in ("person", "body"):
            return found
        return self._turn(found, self._head or parent, child)

    def _turn(self, found: _Found, head: str, direction_frame: str) -> _Found:
        """Return a face with its direction: the x axis of a face, or the z axis of a gaze."""
        at_face = self.tree.find(f"{found.kind}_{found.id}", head)
        own = self.tree.find(direction_frame, head)
        in_frame = self.tree.find(direction_frame, found.detection.frame)
        if at_face is None or own is None or in_frame is None:
            reason = (
                f"no gaze of {direction_frame!r}: it is not connected to {head!r}, or its rotation is invalid"
            )
            self._faults.warn(reason, f"no gaze {head}")
            return found
        axis = np.array([0.0, 0.0, 1.0] if direction_frame.startswith("gaze_") else [1.0, 0.0, 0.0])
        position = to_body_axes(at_face.translation, head)
        columns = measure_gaze(position, to_body_axes(own.rotation @ axis, head))
        ahead, left, up = to_body_axes(in_frame.rotation @ axis, found.detection.frame).tolist()
        columns |= {"z": found.detection.columns["z"], "facing": atan2(left, ahead)}
        columns["tilt"] = atan2(up, hypot(ahead, left))
        return replace(found, detection=replace(found.detection, columns=columns))

    def _is_twice(self, kind: str, id: str, time: float | None, point: Array) -> bool:
        """Return whether a frame comes again with its last stamp; at another place it is a fault."""
        last, now = self._last.get((kind, id)), (time, *point.tolist())
        if last is not None and time is not None and last[0] == time:
            if last != now:
                self._faults.warn(f"the id {id!r} is twice at one time; the first one counts", "twice")
            return True
        self._last.pop((kind, id), None)  # so that the dictionary is in the order of time
        if len(self._last) >= MAX_FRAMES:
            self._forget(*next(iter(self._last)))
        self._last[kind, id] = now
        return False

    def _forget(self, kind: str, id: str) -> None:
        """Forget a frame of a person."""
        key = kind, id
        self.tree.forget(f"{kind}_{id}")
        for known in (self._last, self._person_of, self._waiting):
            known.pop(key, None)
        self._named.discard(key)
        self._pending.pop(id, None)

    def _release(self, found: _Found) -> list[Detection]:
        """Return the samples that are ready with a frame of a person: it may wait for its person."""
        key, time = found.part, found.detection.time
        if found.owner is not None or key in self._named or time is None or not self._waits:
            return self._choose(found)
        if key in self._person_of:  # named since it came
            return self._choose(self._claim(found))
        waiting = self._waiting.setdefault(key, _Waiting(time))
        waiting.found.append(found)
        if abs(time - waiting.since) < MAX_WAIT:
            return []
        del self._waiting[key]
        self._named.add(key)
        return [one for each in waiting.found for one in self._choose(each)]

    def _choose(self, found: _Found) -> list[Detection]:
        """Return the sample of a frame, by its person's name; none if another frame of the person counts."""
        detection, person = found.detection, found.owner
        if person is None:
            self._rank = min(self._rank, detection.rank)
            return [detection] if detection.rank == self._rank else []
        if found.kind == "person":
            self._rank = 0
        time, faced = detection.time or 0.0, self._faced.get(person, -inf)
        if not found.is_current and abs(time - faced) <= MAX_PAUSE:
            return []
        if found.kind == "face":
            self._faced[person] = time
        return [replace(detection, id=person, rank=0)]


def measure_gaze(position: Array, direction: Array) -> dict[str, float]:
    """Return gaze_angle, robot_angle (radians) and face_distance (metres) of a face.

    Args:
        position: (3,) of the face in the frame of the robot's head, metres ahead, to the left and up.
        direction: (3,) in which the face or gaze points, in the same frame.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.worlds.ros.people.humans import measure_gaze
        >>> measure_gaze(np.array([2.0, 0.0, 0.0]), np.array([-1.0, 0.0, 0.0]))
        {'gaze_angle': 0.0, 'robot_angle': 0.0, 'face_distance': 2.0}
    """
    return {
        "gaze_angle": _compute_angle(direction, -position),
        "robot_angle": _compute_angle(np.array([1.0, 0.0, 0.0]), position),
        "face_distance": float(np.linalg.norm(position)),
    }


def _compute_angle(a: Array, b: Array) -> float:
    """Return the angle between two vectors in radians, exact also near 0 and pi."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return atan2(hypot(y * w - z * v, z * u - x * w, x * v - y * u), x * u + y * v + z * w)
