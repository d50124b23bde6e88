"""Connection to ROS 2 by rclpy, for those who have ROS on the machine."""

from __future__ import annotations

import importlib
import re
import threading
from collections.abc import Callable
from time import monotonic
from typing import Any

from lcorpp.errors import ActionFailedError, ConnectionLostError, WorldError
from lcorpp.worlds.ros.connection import (
    CANCELLED,
    MAX_MESSAGES,
    NOTHING_LEFT,
    SUCCEEDED,
    Message,
    Subscription,
    wait_for_receiver,
)
from lcorpp.worlds.ros.stop_report import Cancellation, describe_missing_result

QUEUE_SIZE = 10
"""Depth of the queues of topics."""
SERVER_TIMEOUT = 3.0
"""Seconds within which a server of an action or service is discovered."""

FINAL = (SUCCEEDED, CANCELLED, 6)
"""Status of a goal that has ended; 6 is ABORTED."""

DISCOVERY = 0.3
"""Seconds to find the service that cancels goals."""


class RclpyConnection:
    """A connection by rclpy (`lcorpp.worlds.ros.connection.RosConnection`).

    ROS 2 has no master, so that the connection itself is never lost: a part that is gone does not answer.

    Args:
        node: name of the node.

    Raises:
        ConnectionLostError: rclpy is missing.
    """

    version = 2

    def __init__(self, node: str = "lcorpp") -> None:
        try:
            import rclpy
            from rclpy.action import ActionClient
            from rclpy.executors import SingleThreadedExecutor
        except ImportError as error:
            raise ConnectionLostError(
                f"rclpy cannot be imported ({error}); run lcorpp by a Python with ROS 2 on its path, or use"
                " rosbridge"
            ) from None
        self._make_client = ActionClient
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node(node, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._publishers, self._used = dict[str, Any](), set[str]()
        self._clients = dict[str, Any]()
        self._thread = threading.Thread(target=self._executor.spin, name="rclpy", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """As `RosConnection.check`."""
        if not self._context.ok():
            raise ConnectionLostError("rclpy was shut down")

    def call_after_reconnect(self, function: Callable[[], bool]) -> None:
        """Do nothing: the connection is never lost."""

    def advertise(self, topic: str, kind: str) -> None:
        """As `RosConnection.advertise`."""
        if topic not in self._publishers:
            self.check()
            try:
                made = self._node.create_publisher(find_type(kind, "msg"), topic, QUEUE_SIZE)
            except ValueError as error:  # rclpy's errors of names
                raise WorldError(f"the topic {topic!r}: {error}") from None
            self._publishers[topic] = made

    def publish(self, topic: str, kind: str, message: Message) -> None:
        """As `RosConnection.publish`."""
        self.advertise(topic, kind)
        if topic not in self._used:
            self._used.add(topic)
            wait_for_receiver(self._publishers[topic].get_subscription_count)
        self.check()
        self._publishers[topic].publish(make_message(find_type(kind, "msg"), message))

    def count_receivers(self, topic: str) -> int:
        """As `RosConnection.count_receivers`."""
        made = self._publishers.get(topic)
        return 0 if made is None else int(made.get_subscription_count())

    def subscribe(self, topic: str, kind: str, *, max_messages: int = MAX_MESSAGES) -> Subscription:
        """As `RosConnection.subscribe`."""
        self.check()
        made: list[Any] = []
        subscription = Subscription(
            max_messages=max_messages,
            check=self.check,
            end=lambda _: self._node.destroy_subscription(made[0]),
        )

        def receive(message: Any) -> None:
            subscription.put(read_fields(message))

        found = find_type(kind, "msg")
        made.append(self._node.create_subscription(found, topic, receive, QUEUE_SIZE))
        return subscription

    def call_service(self, service: str, kind: str, request: Message, *, timeout: float) -> Message:
        """As `RosConnection.call_service`."""
        end = monotonic() + timeout
        found = find_type(kind, "srv")
        client = self._find_client(service, lambda: self._node.create_client(found, service))
        if not client.wait_for_service(min(timeout, SERVER_TIMEOUT)):
            raise ActionFailedError(f"there is no service {service}")
        response = _wait(client.call_async(make_message(found.Request, request)), end)
        if response is None:
            raise ActionFailedError(f"the service {service} has not responded within {timeout:g} s")
        content: Message = read_fields(response)
        return content

    def run_action(self, name: str, kind: str, goal: Message, *, timeout: float) -> Message:
        """As `RosConnection.run_action`."""
        end = monotonic() + timeout
        found = find_type(kind, "action")
        client = self._find_client(name, lambda: self._make_client(self._node, found, name))
        if not client.wait_for_server(min(timeout, SERVER_TIMEOUT)):
            raise ActionFailedError(f"there is no action server {name}")
        self._find_cancel_client(name)  # it needs some time to find the server
        sent, result = client.send_goal_async(make_message(found.Goal, goal)), None
        try:
            handle = _wait(sent, end)
            if handle is not None and not handle.accepted:
                raise ActionFailedError(f"the goal of {name} was refused")
            result = None if handle is None else _wait(handle.get_result_async(), end)
        finally:
            if result is None:  # also if it is accepted later
                sent.add_done_callback(_cancel_accepted)
        if result is None:
            known = self.cancel_goals(name, timeout=DISCOVERY)
            has_ended = handle is not None and handle.status in FINAL
            raise ActionFailedError(describe_missing_result(name, timeout, known, has_ended=has_ended))
        if result.status != SUCCEEDED:
            how = "was cancelled by others" if result.status == CANCELLED else "was aborted"
            raise ActionFailedError(f"the goal of {name} {how}")
        content: Message = read_fields(result.result)
        return content

    def cancel_goals(self, name: str, *, timeout: float = 0.0) -> Cancellation:
        """As `RosConnection.cancel_goals`."""
        client = self._find_cancel_client(name)
        if not client.wait_for_service(DISCOVERY):
            return Cancellation.NOT_SENT
        request = find_type("action_msgs/CancelGoal", "srv").Request()  # empty goal id and stamp: all goals
        response = _wait(client.call_async(request), monotonic() + timeout)
        if response is None:
            return Cancellation.NO_REPLY
        is_done = response.return_code in NOTHING_LEFT
        return Cancellation.CONFIRMED if is_done else Cancellation.FAILED

    def _find_cancel_client(self, name: str) -> Any:
        found, service = find_type("action_msgs/CancelGoal", "srv"), f"{name}/_action/cancel_goal"
        return self._find_client(service, lambda: self._node.create_client(found, service))

    def close(self) -> None:
        """As `RosConnection.close`."""
        self._executor.shutdown()
        self._thread.join(2.0)
        self._node.destroy_node()
        self._context.try_shutdown()

    def _find_client(self, name: str, make: Callable[[], Any]) -> Any:
        self.check()
        if name not in self._clients:
            self._clients[name] = make()
        return self._clients[name]


def _cancel_accepted(sent: Any) -> None:
    """Cancel a goal of a future of rclpy if the server has accepted it."""
    if sent.exception() is None and sent.result().accepted:
        sent.result().cancel_goal_async()


def _wait(future: Any, end: float) -> Any:
    """Return the result of a future of rclpy; None if it is not there at the time `end`.

    Raises:
        ActionFailedError: the request failed.
    """
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    if not done.wait(max(0.0, end - monotonic())):
        return None
    if future.exception() is not None:
        raise ActionFailedError(f"the request failed: {future.exception()}")
    return future.result()


def find_type(kind: str, folder: str) -> Any:
    """Return the class of a type, "package/Name" or "package/folder/Name".

    Raises:
        WorldError: its package is not installed, or has no such type.
    """
    package, *_, name = kind.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{folder}"), name)
    except (ImportError, AttributeError) as error:
        raise WorldError(f"ROS has no type {kind}: {error}; expected one of an installed package") from None


def make_message(found: Any, fields: Message) -> Any:
    """Return a message of a class with these fields; others have their defaults.

    Raises:
        WorldError: a field is unknown or its value has another type.
    """
    message, kinds = found(), found.get_fields_and_field_types()
    for name, value in fields.items():
        if name not in kinds:
            raise WorldError(
                f"a message {found.__name__} has no field {name!r}; expected one of {', '.join(kinds)}"
            )
        try:
            setattr(message, name, _make_value(kinds[name], value, getattr(message, name)))
        except (AssertionError, TypeError, AttributeError) as error:
            raise WorldError(f"the field {name!r} of a message {found.__name__}: {error}") from None
    return message


def _make_value(kind: str, value: Any, default: Any) -> Any:
    inner = re.fullmatch(r"sequence<([\w/]+)(?:, \d+)?>|([\w/]+)\[\d*\]", kind)
    if inner and "/" in (element := inner[1] or inner[2]):
        return [make_message(find_type(element, "msg"), part) for part in value]
    if "/" in kind:
        return make_message(type(default), value)
    return float(value) if isinstance(default, float) else value


def read_fields(value: Any) -> Any:
    """Return a message as a dictionary, and other values as they are."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: read_fields(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if hasattr(value, "tolist"):
        return value.tolist()
    return [read_fields(part) for part in value] if isinstance(value, list | tuple) else value
