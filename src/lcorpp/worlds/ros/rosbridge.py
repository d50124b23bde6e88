"""Connection to ROS 1 or 2 through a rosbridge server, by its JSON protocol over a WebSocket."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from time import monotonic
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.frames import CloseCode
from websockets.sync.client import ClientConnection

from lcorpp.errors import ActionFailedError, ConnectionLostError, WorldError
from lcorpp.worlds.ros.connection import (
    MAX_MESSAGES,
    Message,
    Subscription,
    name_type,
)
from lcorpp.worlds.ros.fields import FaultLog
from lcorpp.worlds.ros.replies import Replies, Reply
from lcorpp.worlds.ros.rosbridge_messages import MAX_SIZE, MessageDecoder, read_cancellation, read_result
from lcorpp.worlds.ros.rosbridge_socket import PING_TIMEOUT, open_socket
from lcorpp.worlds.ros.stop_report import Cancellation, describe_missing_result
from lcorpp.worlds.ros.topic_actions import cancel_topic_goals, run_topic_action

MIN_RETRY, MAX_RETRY = 0.1, 2.0
"""Seconds between two attempts to connect again; the pause doubles after each."""
MIN_CALLS, CALL_INTERVAL, MAX_SETTLING = 8, 0.25, 10.0
"""Calls of the function after a reconnection, seconds between them and at most: a new server loses what is
published before it has found the receivers of a topic, which takes seconds."""
LATE_GOAL = 0.5
"""Seconds after a cancellation within which a goal that was just sent may still be accepted."""
MAX_NOTES = 20
"""Error messages of the server that are kept."""


class RosbridgeConnection:
    """A connection through rosbridge (`lcorpp.worlds.ros.connection.RosConnection`).

    A thread receives messages. If the connection is lost, requests that wait for a reply fail; the thread
    connects again, announces and subscribes as before. Then what `call_after_reconnect` has set is called
    several times, and only then the connection counts as made.
    A slow reader loses the oldest messages of a topic, here and in the server (`queue_length`).

    notes: the latest error messages of the server that belong to no request, and messages that were left out.
        Each kind is logged once, at WARNING.

    Args:
        url: e.g. "ws://localhost:9090". version: of ROS, 1 or 2. timeout: seconds for the first connection.

    Raises:
        ConnectionLostError: there is no server at `url` within `timeout` seconds.

    Source: the rosbridge v2.0 protocol specification, with its actions of ROS 2; actions of ROS 1 are topics.
    """

    def __init__(self, url: str, *, version: int = 2, timeout: float = 5.0) -> None:
        self.url, self.version, self.notes = url, version, list[str]()
        self._lock = threading.RLock()
        self._replies, self._faults = Replies(), FaultLog(url)
        self._subscriptions = dict[str, tuple[Message, list[Subscription]]]()
        self._advertised = dict[str, Message]()
        self._after_reconnect: Callable[[], bool] | None = None
        self._is_closed, self._is_settled = threading.Event(), True
        self._socket: ClientConnection | None = open_socket(url, timeout)
        self._thread = threading.Thread(target=self._receive, name="rosbridge", daemon=True)
        self._thread.start()

    def __repr__(self) -> str:
        state = "connected" if self._socket is not None else "not connected"
        return f"RosbridgeConnection({self.url!r}, ROS {self.version}, {state})"

    def check(self) -> None:
        """As `RosConnection.check`."""
        if self._socket is None:
            raise ConnectionLostError(f"{self.url}: the connection was lost")
        if not self._is_settled:
            raise ConnectionLostError(f"{self.url}: the connection was lost; connecting again")

    def call_after_reconnect(self, function: Callable[[], bool]) -> None:
        """As `RosConnection.call_after_reconnect`."""
        self._after_reconnect = function

    def advertise(self, topic: str, kind: str) -> None:
        """As `RosConnection.advertise`."""
        with self._lock:
            if topic not in self._advertised:
                type_name = name_type(kind, self.version, "msg")
                self._advertised[topic] = {"op": "advertise", "topic": topic, "type": type_name}
                self._send(self._advertised[topic])

    def publish(self, topic: str, kind: str, message: Message) -> None:
        """As `RosConnection.publish`."""
        self.advertise(topic, kind)
        self._send({"op": "publish", "topic": topic, "msg": message})

    def count_receivers(self, topic: str) -> None:
        """As `RosConnection.count_receivers`: rosbridge does not report it."""

    def subscribe(self, topic: str, kind: str, *, max_messages: int = MAX_MESSAGES) -> Subscription:
        """As `RosConnection.subscribe`."""
        subscription = Subscription(max_messages=max_messages, check=self.check, end=self._end_subscription)
        with self._lock:
            if topic not in self._subscriptions:
                type_name = name_type(kind, self.version, "msg")
                request = {"op": "subscribe", "topic": topic, "type": type_name, "queue_length": max_messages}
                self._subscriptions[topic] = request, []
                self._send(request)
            self._subscriptions[topic][1].append(subscription)
        return subscription

    def call_service(self, service: str, kind: str, request: Message, *, timeout: float) -> Message:
        """As `RosConnection.call_service`."""
        type_name = name_type(kind, self.version, "srv")
        call = {"op": "call_service", "service": service, "type": type_name, "args": request}
        reply = self._request(call, service, timeout)
        if reply is None:
            raise ActionFailedError(f"the service {service} has not responded within {timeout:g} s")
        if not reply.get("result"):
            raise ActionFailedError(
                f"the service {service} failed: {reply.get('values') or 'no reason given'}"
            )
        values = reply.get("values")
        return values if isinstance(values, dict) else {}

    def run_action(self, name: str, kind: str, goal: Message, *, timeout: float) -> Message:
        """As `RosConnection.run_action`."""
        if self.version == 1:
            return run_topic_action(self, name, kind, goal, timeout=timeout)
        kind = name_type(kind, self.version, "action")
        send = {
            "op": "send_action_goal",
            "action": name,
            "action_type": kind,
            "args": goal,
            "feedback": False,
        }
        with self._replies.expect() as (key, waiting):
            self._send(send | {"id": key})
            is_over, known = False, Cancellation.NOT_SENT
            try:
                reply = waiting.wait(name, timeout)
                is_over = reply is not None
            finally:
                if not is_over:
                    known = self._cancel_late_goal(name, waiting)
            if reply is None:
                has_ended = waiting.is_set
                raise ActionFailedError(describe_missing_result(name, timeout, known, has_ended=has_ended))
        return read_result(name, reply)

    def cancel_goals(self, name: str, *, timeout: float = 0.0) -> Cancellation:
        """As `RosConnection.cancel_goals`."""
        if self.version == 1:
            return cancel_topic_goals(self, name)
        with self._request_cancellation(name) as (service, reply):
            return read_cancellation(reply.wait(service, timeout))

    @contextmanager
    def _request_cancellation(self, name: str) -> Iterator[tuple[str, Reply]]:
        """Request the cancellation of all goals; return the service and the reply to come."""
        service, kind = f"{name}/_action/cancel_goal", "action_msgs/srv/CancelGoal"
        call = {"op": "call_service", "service": service, "type": kind, "args": {}}
        with self._replies.expect() as (key, reply):
            self._send(call | {"id": key})  # an empty goal id and stamp mean all goals
            yield service, reply

    def _cancel_late_goal(self, name: str, waiting: Reply) -> Cancellation:
        """Cancel a goal until it has ended: the server may accept it after the first cancellation.

        A goal passes through a thread of the rosbridge server, so that a cancellation may overtake it.
        """
        known = Cancellation.NOT_SENT
        with suppress(WorldError):
            for _ in range(round(LATE_GOAL / CALL_INTERVAL)):
                with self._request_cancellation(name) as (service, reply):
                    if known is not Cancellation.CONFIRMED:
                        known = Cancellation.NO_REPLY
                    has_ended = waiting.wait(name, CALL_INTERVAL) is not None
                    latest = read_cancellation(reply.wait(service, 0.0))
                    known = known if latest is Cancellation.NO_REPLY else latest
                if has_ended:
                    break
        return known

    def close(self) -> None:
        """As `RosConnection.close`."""
        self._is_closed.set()
        socket = self._socket
        if socket is not None:
            socket.close()
        self._thread.join(2 * PING_TIMEOUT)

    def _end_subscription(self, subscription: Subscription) -> None:
        with self._lock:
            for _, subscriptions in self._subscriptions.values():
                if subscription in subscriptions:
                    subscriptions.remove(subscription)

    def _request(self, message: dict[str, Any], what: str, timeout: float) -> dict[str, Any] | None:
        """Send a message and return the reply to it; None if it does not come in time."""
        end = monotonic() + timeout
        with self._replies.expect() as (key, reply):
            self._send(message | {"id": key})
            return reply.wait(what, end - monotonic())

    def _send(self, message: Message) -> None:
        with self._lock:
            socket = self._socket
            if socket is None:
                raise ConnectionLostError(f"{self.url}: the connection was lost")
            try:
                socket.send(json.dumps(message))
            except (ConnectionClosed, OSError) as error:
                self._is_settled = False  # until the receiving thread has made it again
                raise ConnectionLostError(f"{self.url}: the connection was lost: {error}") from None

    def _receive(self) -> None:
        """Receive messages until `close`; connect again after each loss."""
        while not self._is_closed.is_set():
            socket, decoder = self._socket, MessageDecoder()
            assert socket is not None
            try:
                for text in socket:
                    try:
                        self._take(decoder, text)
                    except WorldError as fault:
                        self._note(str(fault))
                    except Exception as error:  # a message of a faulty server must not end the thread
                        self._note(f"a message that cannot be read: {type(error).__name__}: {error}")
            except ConnectionClosed as error:
                if error.sent is not None and error.sent.code == CloseCode.MESSAGE_TOO_BIG:
                    self._note(f"the connection was ended: a message is larger than {MAX_SIZE} bytes")
            except OSError:
                pass
            with suppress(OSError):
                socket.close()
            self._socket, self._is_settled = None, False
            self._replies.lose()
            self._reconnect()

    def _reconnect(self) -> None:
        pause = MIN_RETRY
        while not self._is_closed.wait(pause):
            pause = min(2 * pause, MAX_RETRY)
            try:
                socket = open_socket(self.url, PING_TIMEOUT)
                with self._lock:
                    self._socket = socket
                    requests = [request for request, _ in self._subscriptions.values()]
                    for message in (*self._advertised.values(), *requests):
                        self._send(message)
                if self._after_reconnect is None:
                    self._is_settled = True
                else:
                    arguments = (self._after_reconnect, socket)
                    threading.Thread(target=self._settle, args=arguments, daemon=True).start()
                return
            except WorldError:
                if self._socket is not None:
                    self._socket.close()
                self._socket = None

    def _settle(self, function: Callable[[], bool], socket: ClientConnection) -> None:
        """Call the function after a reconnection until it succeeds, and often enough to be received."""
        end, number = monotonic() + MAX_SETTLING, 0
        with suppress(WorldError):
            while self._socket is socket:
                number += 1
                is_confirmed = function()
                if number >= MIN_CALLS and (is_confirmed or monotonic() > end):
                    if not is_confirmed:
                        self._note("no confirmation that all goals are cancelled after the reconnection")
                    self._is_settled = True
                    return
                self._is_closed.wait(CALL_INTERVAL)

    def _take(self, decoder: MessageDecoder, text: str | bytes) -> None:
        """Pass a message on.

        Raises:
            WorldError: it is not a message of the protocol, and is left out.
        """
        message = decoder.decode(text)
        if message is None:
            return
        kind, key = message["op"], message.get("id")
        if kind == "publish":
            if not isinstance(message.get("msg"), dict):
                raise WorldError("a message of a topic without fields is left out")
            for subscription in self._subscriptions.get(str(message.get("topic")), ({}, []))[1]:
                subscription.put(message["msg"])
        elif kind in ("service_response", "action_result"):
            self._replies.set(key, message)
        elif kind == "status":
            if message.get("level") == "error":
                is_expected = self._replies.set(key, {"result": False, "values": message.get("msg")})
                if not is_expected:
                    self._note(str(message.get("msg")))
        elif kind != "action_feedback":
            raise WorldError(f"the operation {kind[:40]!r} is unknown and left out")

    def _note(self, text: str) -> None:
        self.notes = [*self.notes[1 - MAX_NOTES :], text]
        self._faults.warn(text)
