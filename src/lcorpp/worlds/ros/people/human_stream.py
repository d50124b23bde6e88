"""People of ROS4HRI on a running robot: the topics that a `HumanReader` needs beside the frames."""

from __future__ import annotations

from collections.abc import Sequence
from time import time

from lcorpp.errors import ConnectionLostError, WorldError
from lcorpp.worlds.ros.connection import Message, RosConnection, Subscription
from lcorpp.worlds.ros.fields import FaultLog
from lcorpp.worlds.ros.people.humans import (
    PART_KIND,
    PERSONS,
    PERSONS_KIND,
    STATIC,
    HumanReader,
    name_part_topics,
)
from lcorpp.worlds.ros.sensor_messages import Detection
from lcorpp.worlds.ros.transforms import TRANSFORMS

STATIC_TIMEOUT = 1.0
"""Seconds to wait for the frames that do not move: without them a camera has no place on the robot."""


class HumanStream:
    """Read people from the frames of a running robot.

    Args:
        connection: of the robot. topic: of the frames. targets, head: as of `HumanReader`.
    """

    def __init__(
        self, connection: RosConnection, topic: str, *, targets: Sequence[str], head: str | None
    ) -> None:
        self._connection, self._faults = connection, FaultLog(topic)
        self._reader = HumanReader(topic, targets=targets, head=head)
        self._persons = self._subscribe(PERSONS, PERSONS_KIND)
        self._parts = dict[str, Subscription]()
        self._static = self._subscribe(STATIC, TRANSFORMS)
        first = None if self._static is None else self._static.wait(STATIC_TIMEOUT)
        if first is not None:
            self._reader.read(first)

    def read(self, message: Message) -> list[Detection]:
        """Return the people in a message with frames, after what has come about persons."""
        found = list[Detection]()
        if self._static is not None:
            for static in self._static.take():
                found += self._reader.read(static)
        if self._persons is not None:
            for listed in self._persons.take():
                found += self._reader.read_human(PERSONS, listed)
            self._follow_persons()
        for topic, parts in self._parts.items():
            for part in parts.take():
                found += self._reader.read_human(topic, part)
        return found + self._reader.read(message, time())

    def _follow_persons(self) -> None:
        """Subscribe to the faces and bodies of the persons who are tracked now, and of no others."""
        wanted = [topic for person in sorted(self._reader.persons) for topic in name_part_topics(person)]
        for topic in wanted:
            if topic not in self._parts and (parts := self._subscribe(topic, PART_KIND)) is not None:
                self._parts[topic] = parts
        for topic in self._parts.keys() - set(wanted):
            self._parts.pop(topic).__exit__()

    def _subscribe(self, topic: str, kind: str) -> Subscription | None:
        """Return the messages of a topic; None, with a warning, if they cannot be received."""
        try:
            return self._connection.subscribe(topic, kind)
        except ConnectionLostError:
            raise
        except WorldError as error:
            self._faults.warn(f"{topic} is not read: {error}", kind)
            return None
