"""Replies to requests, which another thread receives."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from lcorpp.errors import ConnectionLostError


class Reply:
    """The reply to a request, which another thread receives."""

    def __init__(self) -> None:
        self._event, self._content = threading.Event(), dict[str, Any]()
        self._is_lost = False

    @property
    def is_set(self) -> bool:
        """Whether the reply has come."""
        return self._event.is_set() and not self._is_lost

    def set(self, content: Mapping[str, Any]) -> None:
        """Set the reply."""
        self._content = dict(content)
        self._event.set()

    def lose(self) -> None:
        """Note that the connection was lost, so that no reply will come."""
        self._is_lost = True
        self._event.set()

    def wait(self, what: str, timeout: float) -> dict[str, Any] | None:
        """Return the reply; None if it does not come within `timeout` seconds.

        Raises:
            ConnectionLostError: the connection was lost; the message names `what` was requested.
        """
        if not self._event.wait(max(0.0, timeout)):
            return None
        if self._is_lost:
            raise ConnectionLostError(f"the connection was lost during {what}")
        return self._content


class Replies:
    """The replies that are expected now, by the ids of their requests."""

    def __init__(self) -> None:
        self._ids, self._expected = itertools.count(1), dict[str, Reply]()

    def __len__(self) -> int:
        return len(self._expected)

    @contextmanager
    def expect(self) -> Iterator[tuple[str, Reply]]:
        """Return the id of a request, and the reply to it."""
        key, reply = f"lcorpp:{next(self._ids)}", Reply()
        self._expected[key] = reply
        try:
            yield key, reply
        finally:
            self._expected.pop(key, None)

    def set(self, key: object, content: Mapping[str, Any]) -> bool:
        """Set the reply to a request; return whether it is expected."""
        reply = self._expected.get(key) if isinstance(key, str) else None
        if reply is not None:
            reply.set(content)
        return reply is not None

    def lose(self) -> None:
        """Note that the connection was lost, so that no reply will come."""
        for reply in list(self._expected.values()):
            reply.lose()
