"""A rosbridge server without ROS: topics, services and actions of ROS 2 are Python functions.

With it a simulated robot speaks the protocol of a real one, so `lcorpp robot` cannot tell them apart.
"""

from __future__ import annotations

import json
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.server import Server, ServerConnection, serve

Message = dict[str, Any]

MAX_RECEIVED = 10_000
"""Messages of clients that are kept."""

SUCCEEDED, CANCELLED, ABORTED = 4, 5, 6
"""Status of a goal, from action_msgs/msg/GoalStatus."""


class Goal:
    """A goal that a client has sent. content: its fields. is_cancelled: set once it should end."""

    def __init__(self, content: Message) -> None:
        self.content, self.is_cancelled = content, threading.Event()


class BridgeServer:
    """A server on the loopback; each client has a thread.

    Attributes:
        url: of the server. connections: the open ones. received: the latest messages of clients.
        accept_delay: seconds until a goal is accepted; what cancels goals before does not reach it.

    Args:
        port: 0 takes a free one.
    """

    def __init__(self, port: int = 0) -> None:
        self._topics: dict[str, Callable[[Message], None]] = {}
        self._services: dict[str, Callable[[Message], Message]] = {}
        self._actions: dict[str, Callable[[Goal], tuple[int, Message]]] = {}
        self._subscribers: dict[str, set[ServerConnection]] = {}
        self._goals: dict[str, list[Goal]] = {}
        self._lock = threading.Lock()
        self.accept_delay = 0.0
        self.connections: set[ServerConnection] = set()
        self.received: deque[Message] = deque(maxlen=MAX_RECEIVED)
        self._server: Server = serve(self._serve, "127.0.0.1", port, compression=None)
        self.port = self._server.socket.getsockname()[1]
        self.url = f"ws://127.0.0.1:{self.port}"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def take_topic(self, topic: str, function: Callable[[Message], None]) -> None:
        """Call a function with each message that a client publishes to a topic."""
        self._topics[topic] = function

    def serve_service(self, name: str, function: Callable[[Message], Message]) -> None:
        """Call a function with each request; it returns the response."""
        self._services[name] = function

    def serve_action(self, name: str, function: Callable[[Goal], tuple[int, Message]]) -> None:
        """Call a function with each goal, in a thread; it returns status and result."""
        self._actions[name] = function

    def publish(self, topic: str, message: Message) -> None:
        """Send a message to the clients that have subscribed."""
        text = json.dumps({"op": "publish", "topic": topic, "msg": message})
        with self._lock:
            connections = list(self._subscribers.get(topic, ()))
        for connection in connections:
            with suppress(ConnectionClosed, OSError):
                connection.send(text)

    def is_subscribed(self, topic: str) -> bool:
        """Return whether a client receives a topic."""
        return bool(self._subscribers.get(topic))

    def cut(self) -> None:
        """Close all connections without a closing handshake, as a network that fails does."""
        for connection in list(self.connections):
            with suppress(OSError):
                connection.socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """End the server and its connections."""
        self._server.shutdown()
        for connection in list(self.connections):
            with suppress(Exception):
                connection.close()

    def _serve(self, connection: ServerConnection) -> None:
        self.connections.add(connection)
        try:
            for text in connection:
                message = json.loads(text)
                self.received.append(message)
                self._take(connection, message)
        except (ConnectionClosed, OSError):
            pass
        finally:
            self.connections.discard(connection)
            with self._lock:
                for subscribers in self._subscribers.values():
                    subscribers.discard(connection)

    def _take(self, connection: ServerConnection, message: Message) -> None:
        kind = message.get("op")
        if kind == "publish" and message["topic"] in self._topics:
            self._topics[message["topic"]](message["msg"])
        elif kind == "subscribe":
            with self._lock:
                self._subscribers.setdefault(message["topic"], set()).add(connection)
        elif kind == "call_service":
            self._answer(connection, message)
        elif kind == "send_action_goal" and message["action"] in self._actions:
            threading.Thread(target=self._run_goal, args=(connection, message), daemon=True).start()

    def _answer(self, connection: ServerConnection, message: Message) -> None:
        name = message["service"]
        if name.endswith("/_action/cancel_goal"):
            with self._lock:
                for goal in self._goals.get(name.removesuffix("/_action/cancel_goal"), []):
                    goal.is_cancelled.set()
            self._reply(connection, message, "service_response", True, {"return_code": 0})
        elif name in self._services:
            response = self._services[name](message.get("args", {}))
            self._reply(connection, message, "service_response", True, response)

    def _run_goal(self, connection: ServerConnection, message: Message) -> None:
        name, goal = message["action"], Goal(message["args"])
        time.sleep(self.accept_delay)
        with self._lock:
            self._goals.setdefault(name, []).append(goal)
        status, result = self._actions[name](goal)
        with self._lock:
            self._goals[name].remove(goal)
        self._reply(connection, message, "action_result", status == SUCCEEDED, result, status=status)

    def _reply(
        self,
        connection: ServerConnection,
        message: Message,
        kind: str,
        is_success: bool,
        values: Message,
        **more: Any,
    ) -> None:
        reply = {"op": kind, "id": message.get("id"), "result": is_success, "values": values, **more}
        with suppress(ConnectionClosed, OSError):
            connection.send(json.dumps(reply))
