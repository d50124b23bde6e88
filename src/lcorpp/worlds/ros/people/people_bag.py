"""People in recordings of ROS 1 and 2, as samples."""

from __future__ import annotations

import logging
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from lcorpp.camera.bags import BagReader, open_bag
from lcorpp.errors import DataError, expected_one_of
from lcorpp.worlds.ros.connection import Message, name_type
from lcorpp.worlds.ros.fields import FaultLog
from lcorpp.worlds.ros.people.humans import PART_KIND, HumanReader, is_human_topic
from lcorpp.worlds.ros.people.laser_scan import LASER, LaserReader
from lcorpp.worlds.ros.sensor_messages import PEOPLE, Detection, PeopleReader, Sample
from lcorpp.worlds.ros.transforms import TRANSFORMS

LOG = logging.getLogger("lcorpp.robot")

NANOSECOND = 1e-9


def list_topics(path: Path) -> dict[str, str]:
    """Return the topics of a bag with the types of their messages, as ROS 1 writes them.

    Raises:
        FileError, DataError: as `open_bag`.
    """
    with open_bag(path) as reader:
        return _list_topics(reader)


def list_people_topics(path: Path) -> dict[str, str]:
    """Return the topics of a bag that may have people, with the types of their messages.

    Raises:
        FileError, DataError: as `open_bag`.
    """
    return _select_people(list_topics(path))


def read_people_bag(
    path: Path, topic: str | None = None, *, frame: str | None = None, head: str | None = None
) -> list[Sample]:
    """Return the samples of the people in a bag, in the order of the messages.

    Times are those of the headers, or of the recording where these are 0. Messages that cannot be read are
    left out with a warning. Of laser scans the robot has to stand still: people are in the scanner's frame.

    Args:
        topic: of a people tracker, a laser scanner or of frames; None takes the only one of a tracker, else
            the frames of ROS4HRI.
        frame: in which people of frames are placed, e.g. "base_link"; None takes that in which they come.
        head: the frame of the robot's head, as of `HumanReader`.

    Raises:
        FileError, DataError: as `open_bag`; there is no such topic or frame, or the frames are of no people.
    """
    try:
        return _read_samples(path, topic, frame, head)
    except _DamagedError as error:
        return _read_samples(path, topic, frame, head, fault=error)


class _DamagedError(DataError):
    """The messages of a bag end with a fault."""


def _read_samples(
    path: Path, topic: str | None, frame: str | None, head: str | None, fault: Exception | None = None
) -> list[Sample]:
    """Return the samples as `read_people_bag`. fault: of a damaged bag, of which the rest is read.

    Raises:
        _DamagedError: the bag is damaged.
    """
    with open_bag(path, fault) as reader:
        topics = _list_topics(reader)
        chosen = _choose_topic(path, _select_people(topics), topic)
        if topics[chosen] == TRANSFORMS:
            return _read_humans(path, reader, topics, frame, head)
        if frame is not None:
            raise DataError(f"{path}: the frame {frame!r} is for {TRANSFORMS}; {chosen} is {topics[chosen]}")
        place = f"{path}: {chosen}"
        people: PeopleReader | LaserReader = (
            LaserReader(place, "scan", lambda x, y: (x, y))
            if topics[chosen] == LASER
            else PeopleReader(topics[chosen], place)
        )
        found = list[tuple[float, Detection]]()
        for _, stamp, message in _iterate(reader, {chosen}, path):
            found += [(stamp, detection) for detection in people.read(message)]
    lowest = min((detection.rank for _, detection in found), default=0)  # faces before there were persons
    return [_make_sample(d, stamp) for stamp, d in found if d.rank == lowest]


def _list_topics(reader: BagReader) -> dict[str, str]:
    return {c.topic: name_type(c.msgtype, 1, "msg") for c in reader.connections}


def _select_people(topics: Mapping[str, str]) -> dict[str, str]:
    kinds = (*PEOPLE, LASER, TRANSFORMS)
    return {topic: kind for topic, kind in topics.items() if kind in kinds}


def _choose_topic(path: Path, topics: Mapping[str, str], topic: str | None) -> str:
    """Return the topic with people.

    Raises:
        DataError: there is no such topic, or several.
    """
    if topic is None:
        trackers = [name for name, kind in topics.items() if kind not in (TRANSFORMS, LASER)]
        frames = [name for name, kind in topics.items() if kind == TRANSFORMS]
        if len(trackers) > 1 or not (trackers or frames):
            expected = expected_one_of(sorted(topics)) if topics else "expected a topic of a people tracker"
            raise DataError(f"{path}: has {len(trackers)} topics with people; {expected}")
        return (trackers or frames)[0]
    if topic not in topics:
        raise DataError(f"{path}: has no people in {topic!r}; {expected_one_of(sorted(topics))}")
    return topic


def _read_humans(
    path: Path, reader: BagReader, topics: Mapping[str, str], frame: str | None, head: str | None
) -> list[Sample]:
    """Return the samples of the people whose frames are in a bag."""
    frames = {topic for topic, kind in topics.items() if kind == TRANSFORMS}
    about = {topic for topic, kind in topics.items() if is_human_topic(topic, kind)}
    knows_persons = any(topics[topic] == PART_KIND for topic in about)
    target = frame and frame.lstrip("/")
    humans = HumanReader(str(path), targets=[target] if target else [], head=head, waits=knows_persons)
    found = list[Detection]()
    for topic, stamp, message in _iterate(reader, frames | about, path):
        found += humans.read(message, stamp) if topic in frames else humans.read_human(topic, message)
    found += humans.flush()
    if not found:
        raise DataError(
            f"{path}: has no people: no frame person_<id>, face_<id>, gaze_<id> or body_<id> of ROS4HRI in"
            f" {', '.join(sorted(frames))}"
        )
    lowest = min(detection.rank for detection in found)
    found = [each for each in found if each.rank == lowest]  # faces before there were persons
    return [_make_sample(detection, 0.0) for detection in _select_frame(path, found, target)]


def _select_frame(path: Path, found: list[Detection], target: str | None) -> list[Detection]:
    """Return the detections in a frame; without one those in the frame in which a person is most often.

    Raises:
        DataError: there are none.
    """
    counts = defaultdict[str, Counter[str]](Counter)
    for detection in found:
        counts[detection.id][detection.frame] += 1
    frame_of = {id: target or own.most_common(1)[0][0] for id, own in counts.items()}
    placed = [detection for detection in found if detection.frame == frame_of[detection.id]]
    if not placed:
        raise DataError(f"{path}: no person's frame is connected to {target!r}; found {found[0].frame!r}")
    if len(placed) < len(found):
        where = (
            f"are not connected to {target!r}" if target else "are in another frame than most of the person's"
        )
        LOG.warning("%s: %d of %d samples %s: left out", path, len(found) - len(placed), len(found), where)
    return placed


def _iterate(reader: BagReader, topics: set[str], path: Path) -> Iterator[tuple[str, float, Message]]:
    """Yield topic, seconds of the recording and message of some topics of a bag.

    A message that cannot be read is left out with a warning.

    Raises:
        _DamagedError: the bag ends with a fault.
    """
    chosen = [connection for connection in reader.connections if connection.topic in topics]
    faults, iterator = FaultLog(str(path)), iter(reader.messages(chosen))
    while True:
        try:
            connection, stamp, data = next(iterator)
        except StopIteration:
            return
        except Exception as error:
            reason = f"{type(error).__name__}: {error}"
            raise _DamagedError(f"{path}: cannot be read as a bag: {reason}") from error
        try:
            message = _make_message(reader.deserialize(data, connection.msgtype))
        except Exception as error:
            fault = f"a message of {connection.topic} is left out: {type(error).__name__}: {error}"
            faults.warn(fault, connection.topic)
            continue
        yield connection.topic, stamp * NANOSECOND, message


def _make_sample(detection: Detection, recorded: float) -> Sample:
    return Sample(detection.time or recorded, detection.id, detection.x, detection.y, detection.columns)


def _make_message(found: object) -> Message:
    """Return a message as a dictionary, its arrays of numbers as lists."""
    names = found.__dataclass_fields__  # type: ignore[attr-defined]
    return {name: _convert(getattr(found, name)) for name in names}


def _convert(value: Any) -> Any:
    """Return a field of a message: a number or text, an array as a list, or messages as dictionaries."""
    if isinstance(value, list):
        return [_convert(item) for item in value]
    if hasattr(value, "__dataclass_fields__"):
        return _make_message(value)
    return value.tolist() if hasattr(value, "tolist") else value
