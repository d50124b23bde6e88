"""The connection to a robot that runs ROS: topics, services and actions, with messages as dictionaries."""

from __future__ import annotations

import re
import threading
from collections import deque
from collections.abc import Callable, Mapping
from time import monotonic, sleep
from typing import Any, Protocol, Self

from lcorpp.errors import WorldError
from lcorpp.worlds.ros.stop_report import Cancellation

Message = Mapping[str, Any]
"""A ROS message: field -> number, text, list or message."""

MAX_MESSAGES = 64
"""Messages of a topic that wait; above it the oldest is dropped, so that a slow reader sees new ones."""

MAX_WAIT = 0.2
"""Seconds between two checks of the connection while a thread waits for a message."""

SUCCEEDED, CANCELLED = 4, 5
"""Status of a goal, from action_msgs/msg/GoalStatus."""
NOTHING_LEFT = (0, 2, 3)
"""Return codes of action_msgs/srv/CancelGoal after which no goal goes on: none, unknown goal, goal ended."""

MAX_DISCOVERY = 0.5
"""Seconds within which publisher and receivers of a topic find each other."""


class RosConnection(Protocol):
    """A connection to ROS, made by rosbridge or by a native client library.

    Types are written as in either version, "geometry_msgs/Twist" or "geometry_msgs/msg/Twist"; see
    `name_type`. All methods raise `ConnectionLostError` without a connection.
    """

    version: int
    """Version of ROS: 1 or 2."""

    def check(self) -> None:
        """Raise `ConnectionLostError` if there is no connection now."""

    def advertise(self, topic: str, kind: str) -> None:
        """Announce messages of a type; a topic is advertised before its first message."""

    def publish(self, topic: str, kind: str, message: Message) -> None:
        """Send a message."""

    def count_receivers(self, topic: str) -> int | None:
        """Return the number of nodes that receive what is published to a topic; None if it is unknown."""

    def subscribe(self, topic: str, kind: str, *, max_messages: int = MAX_MESSAGES) -> Subscription:
        """Return the messages of a topic from now on."""

    def call_service(self, service: str, kind: str, request: Message, *, timeout: float) -> Message:
        """Call a service and return its response.

        Raises:
            ActionFailedError: the service fails, or does not respond within `timeout` seconds.
        """

    def run_action(self, name: str, kind: str, goal: Message, *, timeout: float) -> Message:
        """Send a goal to an action server and return the result.

        Raises:
            ActionFailedError: the goal is refused, aborted or cancelled by others, or there is no result
                within `timeout` seconds; then its cancellation is requested, and the message states what is
                known about that.
        """

    def cancel_goals(self, name: str, *, timeout: float = 0.0) -> Cancellation:
        """Request the cancellation of all goals of an action server.

        Returns:
            What is known about it after at most `timeout` seconds.
        """

    def call_after_reconnect(self, function: Callable[[], bool]) -> None:
        """Set what is called in another thread once a lost connection is back, until it returns True."""

    def close(self) -> None:
        """End the connection."""


class Subscription:
    """Messages of a topic that were received and not read yet, in a queue of bounded length.

    dropped: the number of messages that were dropped because the queue was full.

    Args:
        check: raises `ConnectionLostError` without a connection. end: ends the reception.
    """

    def __init__(
        self,
        *,
        max_messages: int = MAX_MESSAGES,
        check: Callable[[], None] = lambda: None,
        end: Callable[[Subscription], None] = lambda _: None,
    ) -> None:
        self.dropped, self._check, self._end = 0, check, end
        self._messages = deque[Message](maxlen=max_messages)
        self._changed = threading.Condition()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._end(self)

    def put(self, message: Message) -> None:
        """Add a message; it is called by the thread that receives."""
        with self._changed:
            self.dropped += len(self._messages) == self._messages.maxlen
            self._messages.append(message)
            self._changed.notify()

    def take(self) -> list[Message]:
        """Return the messages that wait, the oldest first, and remove them."""
        with self._changed:
            taken = list(self._messages)
            self._messages.clear()
        return taken

    def wait(self, timeout: float) -> Message | None:
        """Return the oldest message and remove it; None if none comes within `timeout` seconds.

        Raises:
            ConnectionLostError: there is no connection when the time is over.
        """
        end = monotonic() + timeout
        with self._changed:
            while not self._messages:
                left = end - monotonic()
                if left <= 0:
                    self._check()
                    return None
                self._changed.wait(min(left, MAX_WAIT))
            return self._messages.popleft()


def wait_for_receiver(count: Callable[[], int]) -> None:
    """Wait until a new publisher has a receiver, at most `MAX_DISCOVERY` seconds.

    ROS sends the messages of a topic to the receivers that it has found, so the first ones may get lost.
    """
    end = monotonic() + MAX_DISCOVERY
    while not count() and monotonic() < end:
        sleep(0.01)


def name_type(kind: str, version: int, folder: str) -> str:
    """Return the name of a type as a version of ROS writes it.

    Args:
        kind: "package/Name" or "package/folder/Name". folder: "msg", "srv" or "action".

    Raises:
        WorldError: `kind` has another form.
    """
    if not re.fullmatch(r"\w+(/\w+)?/\w+", kind, re.ASCII):
        raise WorldError(f"the type {kind!r}; expected PACKAGE/NAME, e.g. std_msgs/String")
    package, *_, name = kind.split("/")
    return f"{package}/{name}" if version == 1 else f"{package}/{folder}/{name}"
