"""Facts that the robot observes: fixed values, the time of day, its place, or texts of a topic."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Protocol

from lcorpp.errors import WorldError, expected_one_of
from lcorpp.worlds.ros.connection import RosConnection, Subscription
from lcorpp.worlds.ros.fields import FaultLog
from lcorpp.worlds.ros.pose import Pose

TEXT = "std_msgs/String"


class Fact(Protocol):
    """A source of the value of an observed attribute."""

    @property
    def values(self) -> tuple[str, ...]:
        """The values that it may have; () if they are known only later."""

    def start(self, connection: RosConnection, find_pose: Callable[[], Pose]) -> None:
        """Subscribe to what it needs; find_pose: returns the robot's pose in the fixed frame."""

    def read(self) -> str | None:
        """Return the current value; None if it is unknown."""


@dataclass(frozen=True)
class FixedFact:
    """A value that does not change."""

    value: str

    @property
    def values(self) -> tuple[str, ...]:
        """As `Fact.values`."""
        return (self.value,)

    def start(self, connection: RosConnection, find_pose: Callable[[], Pose]) -> None:
        """As `Fact.start`."""

    def read(self) -> str:
        """As `Fact.read`."""
        return self.value


@dataclass(frozen=True)
class ClockFact:
    """The time of day.

    hours: value -> the hour from which it holds, local time; the last one holds until the first.
    """

    hours: Mapping[str, float]

    @property
    def values(self) -> tuple[str, ...]:
        """As `Fact.values`."""
        return tuple(self.hours)

    def start(self, connection: RosConnection, find_pose: Callable[[], Pose]) -> None:
        """As `Fact.start`."""

    def read(self) -> str:
        """As `Fact.read`."""
        now = datetime.now()
        return self.at(now.hour + now.minute / 60)

    def at(self, hour: float) -> str:
        """Return the value at an hour from 0 to below 24."""
        begun = {start: value for value, start in self.hours.items() if start <= hour}
        return begun[max(begun)] if begun else max(self.hours, key=self.hours.__getitem__)


Polygon = tuple[tuple[float, float], ...]
"""Corners in metres of the fixed frame, at least three; the last one is joined to the first."""


@dataclass(eq=False)
class PlaceFact:
    """Where the robot is: the first of these areas that it is in.

    areas: value -> its polygons.

    Examples:
        >>> from lcorpp.robot.facts import PlaceFact
        >>> square = ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))
        >>> rooms = PlaceFact({"library": [square], "classroom": [((5.0, 0.0), (9.0, 0.0), (7.0, 4.0))]})
        >>> rooms.at(1.0, 1.0), rooms.at(7.0, 1.0), rooms.at(8.5, 3.0)
        ('library', 'classroom', None)
    """

    areas: Mapping[str, Sequence[Polygon]]
    _find_pose: Callable[[], Pose] | None = field(default=None, init=False)

    @property
    def values(self) -> tuple[str, ...]:
        """As `Fact.values`."""
        return tuple(self.areas)

    def start(self, connection: RosConnection, find_pose: Callable[[], Pose]) -> None:
        """As `Fact.start`."""
        self._find_pose = find_pose

    def read(self) -> str | None:
        """As `Fact.read`; None outside of all areas, and while the robot's pose is unknown."""
        try:
            pose = self._find_pose() if self._find_pose else None
        except WorldError:
            return None
        return None if pose is None else self.at(pose.x, pose.y)

    def at(self, x: float, y: float) -> str | None:
        """Return the value at a point of the fixed frame."""
        areas = self.areas.items()
        return next((value for value, own in areas if any(is_inside(x, y, part) for part in own)), None)


def measure_area(polygon: Polygon) -> float:
    """Return the area of a polygon in square metres; negative if its corners are clockwise."""
    pairs = zip(polygon, (*polygon[1:], *polygon[:1]), strict=True)
    return sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in pairs) / 2


def is_inside(x: float, y: float, polygon: Polygon) -> bool:
    """Return whether a point is inside of a polygon: whether a ray from it crosses an odd number of edges."""
    inside = False
    for (x1, y1), (x2, y2) in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
        if (y1 > y) != (y2 > y) and x < x1 + (y - y1) * (x2 - x1) / (y2 - y1):
            inside = not inside
    return inside


@dataclass(eq=False)
class TopicFact:
    """The latest text of a topic of std_msgs/String.

    allowed: the values of the attribute.
    """

    topic: str
    allowed: tuple[str, ...]
    _subscription: Subscription | None = field(default=None, init=False)
    _value: str | None = field(default=None, init=False)
    _faults: FaultLog = field(init=False)

    def __post_init__(self) -> None:
        self._faults = FaultLog(self.topic)

    @property
    def values(self) -> tuple[str, ...]:
        """As `Fact.values`."""
        return ()

    def start(self, connection: RosConnection, find_pose: Callable[[], Pose]) -> None:
        """As `Fact.start`."""
        self._subscription = connection.subscribe(self.topic, TEXT, max_messages=1)

    def read(self) -> str | None:
        """As `Fact.read`; a text that is not a value of the attribute makes it unknown, with one warning."""
        for message in self._subscription.take() if self._subscription else []:
            text = message.get("data")
            self._value = text if text in self.allowed else None
            if self._value is None:
                self._faults.warn(f"{text!r}; {expected_one_of(self.allowed)}")
        return self._value
