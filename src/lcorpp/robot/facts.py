"""Facts that the robot observes: fixed values, the time of day, or texts of a topic."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Protocol

from lcorpp.errors import expected_one_of
from lcorpp.worlds.ros.connection import RosConnection, Subscription
from lcorpp.worlds.ros.fields import FaultLog

TEXT = "std_msgs/String"


class Fact(Protocol):
    """A source of the value of an observed attribute."""

    @property
    def values(self) -> tuple[str, ...]:
        """The values that it may have; () if they are known only later."""

    def start(self, connection: RosConnection) -> None:
        """Subscribe to what it needs."""

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

    def start(self, connection: RosConnection) -> None:
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

    def start(self, connection: RosConnection) -> None:
        """As `Fact.start`."""

    def read(self) -> str:
        """As `Fact.read`."""
        now = datetime.now()
        return self.at(now.hour + now.minute / 60)

    def at(self, hour: float) -> str:
        """Return the value at an hour from 0 to below 24."""
        begun = {start: value for value, start in self.hours.items() if start <= hour}
        return begun[max(begun)] if begun else max(self.hours, key=self.hours.__getitem__)


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

    def start(self, connection: RosConnection) -> None:
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
