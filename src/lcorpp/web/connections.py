"""Connections of the page's server that end if the other side has gone, or never asks for anything."""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

REQUEST_SECONDS = 10.0
"""Seconds for a whole HTTP request, and for its reply; an open WebSocket has no such limit."""
PING_SECONDS = 5.0
"""Seconds between two pings of a WebSocket, and for the reply to one."""


class TimedHttpProtocol(H11Protocol):
    """uvicorn's HTTP, with `REQUEST_SECONDS` for each request and reply."""

    _timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._restart()

    def data_received(self, data: bytes) -> None:
        before: object = self.cycle
        super().data_received(data)
        if self.cycle is not before:  # the request is whole
            self._restart()

    def on_response_complete(self) -> None:
        super().on_response_complete()
        self._restart()

    def handle_websocket_upgrade(self, event: Any) -> None:
        self._stop()
        super().handle_websocket_upgrade(event)

    def connection_lost(self, exc: Exception | None) -> None:
        self._stop()
        super().connection_lost(exc)

    def _restart(self) -> None:
        self._stop()
        if not self.transport.is_closing():
            self._timer = self.loop.call_later(REQUEST_SECONDS, self.transport.abort)

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
