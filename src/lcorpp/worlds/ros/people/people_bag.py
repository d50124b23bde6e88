"""People in recordings of ROS 1 and 2, as samples."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from lcorpp.camera.bags import open_bag
from lcorpp.errors import DataError, expected_one_of
from lcorpp.worlds.ros.connection import Message, name_type
from lcorpp.worlds.ros.people.laser_scan import LASER, LaserReader
from lcorpp.worlds.ros.perception import Sample
from lcorpp.worlds.ros.sensor_messages import PEOPLE, TRANSFORMS, Detection, PeopleReader

NANOSECOND = 1e-9


def list_topics(path: Path) -> dict[str, str]:
    """Return the topics of a bag with the types of their messages, as ROS 1 writes them.

    Raises:
        FileError, DataError: as `open_bag`.
    """
    with open_bag(path) as reader:
        return {c.topic: name_type(c.msgtype, 1, "msg") for c in reader.connections}


def list_people_topics(path: Path) -> dict[str, str]:
    """Return the topics of a bag that may have people, with the types of their messages: `PEOPLE`, `LASER`.

    Raises:
        FileError, DataError: as `open_bag`.
    """
    return {topic: kind for topic, kind in list_topics(path).items() if kind in PEOPLE or kind == LASER}


def read_people_bag(path: Path, topic: str | None = None) -> list[Sample]:
    """Return the samples (seconds, person, x, y) of a bag, in the order of the messages and in their frame.

    Times are those of the headers, or of the recording where these are 0. Messages that cannot be read are
    left out with a warning. Of laser scans the robot has to stand still: people are in the scanner's frame.

    Args:
        topic: of a people tracker or a laser scanner; None takes the only one of a tracker that is not of
            `TRANSFORMS`, which nearly every bag has.

    Raises:
        FileError, DataError: as `open_bag`; or there is no such topic.
    """
    topics = list_people_topics(path)
    if topic is None:
        trackers = [name for name, kind in topics.items() if kind not in (TRANSFORMS, LASER)]
        if len(trackers) != 1:
            expected = expected_one_of(sorted(topics)) if topics else "expected a topic of a people tracker"
            raise DataError(f"{path}: has {len(trackers)} topics with people; {expected}")
        topic = trackers[0]
    if topic not in topics:
        raise DataError(f"{path}: has no people in {topic!r}; {expected_one_of(sorted(topics))}")
    place = f"{path}: {topic}"
    people: PeopleReader | LaserReader = (
        LaserReader(place, "scan", lambda x, y: (x, y))
        if topics[topic] == LASER
        else PeopleReader(topics[topic], place)
    )
    found = list[tuple[float, Detection]]()
    with open_bag(path) as reader:
        chosen = [c for c in reader.connections if c.topic == topic]
        for connection, stamp, data in reader.messages(chosen):
            message = _make_message(reader.deserialize(data, connection.msgtype))
            found += [(stamp * NANOSECOND, detection) for detection in people.read(message)]
    lowest = min((detection.rank for _, detection in found), default=0)  # faces before there were persons
    return [(d.time or recorded, d.id, d.x, d.y) for recorded, d in found if d.rank == lowest]


def _make_message(found: object) -> Message:
    """Return a message as a dictionary, its arrays of numbers as lists."""
    fields = asdict(found)  # type: ignore[call-overload]
    return {name: own.tolist() if hasattr(own, "tolist") else own for name, own in fields.items()}
