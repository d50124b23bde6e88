"""The WebSocket to a rosbridge server."""

from __future__ import annotations

import logging
from contextlib import ExitStack

from websockets.exceptions import InvalidHandshake, InvalidURI
from websockets.sync.client import ClientConnection, connect

from lcorpp.errors import ConnectionLostError
from lcorpp.worlds.ros.rosbridge_messages import MAX_SIZE

WEBSOCKETS_LOG = logging.getLogger("lcorpp.websockets")
"""The log of websockets' own threads, which report a lost connection with a traceback; its users see
`ConnectionLostError` instead. It is silent unless a handler is added."""
WEBSOCKETS_LOG.addHandler(logging.NullHandler())
WEBSOCKETS_LOG.propagate = False

PING_INTERVAL, PING_TIMEOUT = 2.0, 3.0
"""Seconds between two pings, and until a connection without pongs counts as lost, e.g. a cut cable."""


def open_socket(url: str, timeout: float) -> ClientConnection:
    """Return a connection to a server.

    Raises:
        ConnectionLostError: there is none at `url` within `timeout` seconds.
    """
    try:
        opening = connect(
            url,
            open_timeout=timeout,
            ping_interval=PING_INTERVAL,
            ping_timeout=PING_TIMEOUT,
            close_timeout=1.0,
            max_size=MAX_SIZE,
            logger=WEBSOCKETS_LOG,
            compression=None,  # on a robot's own network it costs time and saves none
            proxy=None,
        )
        return ExitStack().enter_context(opening)  # `close` and the receiving thread leave it
    except (OSError, InvalidHandshake, InvalidURI, EOFError, ValueError) as error:
        reason = str(error) or type(error).__name__
        raise ConnectionLostError(f"{url}: no rosbridge server can be reached: {reason}") from None
