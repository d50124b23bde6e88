"""Connection to ROS 1 by rospy, for those who have ROS on the machine."""

from __future__ import annotations

import threading
from collections.abc import Callable
from time import monotonic
from typing import Any

from lcorpp.errors import ActionFailedError, ConnectionLostError, WorldError
from lcorpp.worlds.ros.connection import (
    MAX_MESSAGES,
    Message,
    Subscription,
    name_type,
    wait_for_receiver,
)
from lcorpp.worlds.ros.stop_report import Cancellation
from lcorpp.worlds.ros.topic_actions import cancel_topic_goals, run_topic_action

QUEUE_SIZE = 10
"""Messages of a topic that wait to be sent; rospy drops the oldest above it."""
CHECK_INTERVAL = 1.0
"""Seconds between two calls of the master."""


class RospyConnection:
    """A connection by rospy (`lcorpp.worlds.ros.connection.RosConnection`).

    Nodes exchange messages without the master. But a master that does not answer counts as a lost connection:
    no new topic can be reached, and whether the old ones still can is unknown.

    Args:
        node: name of the node; a number is appended.

    Raises:
        ConnectionLostError: rospy is missing, or there is no master.
    """

    version = 1

    def __init__(self, node: str = "lcorpp") -> None:
        try:
            import genpy
            import rosgraph
            import roslib.message
            import rospy
        except ImportError as error:
            raise ConnectionLostError(
                f"rospy cannot be imported ({error}); run lcorpp by a Python with ROS 1 on its path, or use"
                " rosbridge"
            ) from None
        if not rosgraph.is_master_online():
            raise ConnectionLostError(f"there is no ROS master at {rosgraph.get_master_uri()}")
        self._genpy, self._types, self._rosgraph, self._rospy = genpy, roslib.message, rosgraph, rospy
        rospy.init_node(node, anonymous=True, disable_signals=True)
        self._publishers, self._used = dict[str, Any](), set[str]()
        self._after_reconnect: Callable[[], bool] | None = None
        self._is_online, self._is_closed = True, threading.Event()
        threading.Thread(target=self._watch_master, name="rosmaster", daemon=True).start()

    def check(self) -> None:
        """As `RosConnection.check`."""
        if not self._is_online:
            raise ConnectionLostError(f"the ROS master at {self._rosgraph.get_master_uri()} does not answer")

    def call_after_reconnect(self, function: Callable[[], bool]) -> None:
        """As `RosConnection.call_after_reconnect`."""
        self._after_reconnect = function

    def advertise(self, topic: str, kind: str) -> None:
        """As `RosConnection.advertise`."""
        if topic not in self._publishers:
            self.check()
            made = self._rospy.Publisher(topic, self._find_type(kind), queue_size=QUEUE_SIZE)
            self._publishers[topic] = made

    def publish(self, topic: str, kind: str, message: Message) -> None:
        """As `RosConnection.publish`."""
        self.advertise(topic, kind)
        if topic not in self._used:
            self._used.add(topic)
            wait_for_receiver(self._publishers[topic].get_num_connections)
        made = self._make_message(self._find_type(kind)(), message)
        try:
            self._publishers[topic].publish(made)
        except self._rospy.ROSException as error:
            raise ConnectionLostError(f"rospy cannot publish to {topic}: {error}") from None

    def count_receivers(self, topic: str) -> int:
        """As `RosConnection.count_receivers`."""
        made = self._publishers.get(topic)
        return 0 if made is None else int(made.get_num_connections())

    def subscribe(self, topic: str, kind: str, *, max_messages: int = MAX_MESSAGES) -> Subscription:
        """As `RosConnection.subscribe`."""
        self.check()
        made: list[Any] = []
        subscription = Subscription(
            max_messages=max_messages, check=self.check, end=lambda _: made[0].unregister()
        )

        def receive(message: Any) -> None:
            subscription.put(self._read_fields(message))

        made.append(self._rospy.Subscriber(topic, self._find_type(kind), receive))
        return subscription

    def call_service(self, service: str, kind: str, request: Message, *, timeout: float) -> Message:
        """As `RosConnection.call_service`."""
        end = monotonic() + timeout
        self.check()
        found = self._types.get_service_class(name_type(kind, 1, "srv"))
        if found is None:
            raise _unknown_type(kind)
        try:
            self._rospy.wait_for_service(service, timeout)
        except self._rospy.ROSException as error:
            raise ActionFailedError(f"there is no service {service}: {error}") from None
        outcome: list[Any] = []

        def call() -> None:
            try:
                call_it = self._rospy.ServiceProxy(service, found)
                outcome.append(call_it(self._make_message(found._request_class(), request)))
            except Exception as error:  # rospy raises several kinds, and sockets others
                outcome.append(error)

        thread = threading.Thread(target=call, daemon=True)  # rospy's calls have no time-out
        thread.start()
        thread.join(max(0.0, end - monotonic()))
        if not outcome:
            raise ActionFailedError(f"the service {service} has not responded within {timeout:g} s")
        if isinstance(outcome[0], Exception):
            raise ActionFailedError(f"the service {service} failed: {outcome[0]}")
        content: Message = self._read_fields(outcome[0])
        return content

    def run_action(self, name: str, kind: str, goal: Message, *, timeout: float) -> Message:
        """As `RosConnection.run_action`."""
        return run_topic_action(self, name, kind, goal, timeout=timeout)

    def cancel_goals(self, name: str, *, timeout: float = 0.0) -> Cancellation:
        """As `RosConnection.cancel_goals`."""
        return cancel_topic_goals(self, name)

    def close(self) -> None:
        """As `RosConnection.close`."""
        self._is_closed.set()
        self._rospy.signal_shutdown("lcorpp ends")

    def _watch_master(self) -> None:
        while not self._is_closed.wait(CHECK_INTERVAL):
            was_online, self._is_online = self._is_online, bool(self._rosgraph.is_master_online())
            if self._is_online and not was_online and self._after_reconnect is not None:
                try:
                    self._after_reconnect()
                except WorldError:
                    self._is_online = False

    def _find_type(self, kind: str) -> Any:
        found = self._types.get_message_class(name_type(kind, 1, "msg"))
        if found is None:
            raise _unknown_type(kind)
        return found

    def _make_message(self, empty: Any, fields: Message) -> Any:
        try:
            self._genpy.message.fill_message_args(empty, [fields])
        except self._genpy.MessageException as error:
            raise WorldError(f"a message {empty._type}: {error}") from None
        return empty

    def _read_fields(self, value: Any) -> Any:
        """Return a message as a dictionary, and other values as they are."""
        if isinstance(value, self._genpy.Message):
            return {name: self._read_fields(getattr(value, name)) for name in value.__slots__}
        if isinstance(value, self._genpy.TVal):
            return {"secs": value.secs, "nsecs": value.nsecs}
        return [self._read_fields(part) for part in value] if isinstance(value, list | tuple) else value


def _unknown_type(kind: str) -> WorldError:
    return WorldError(f"ROS has no type {kind}; expected one of an installed package")
