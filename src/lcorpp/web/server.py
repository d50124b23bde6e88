"""The server of the page: static files and a WebSocket for each page, on the loopback only."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.routing import Mount, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from lcorpp.web.connections import PING_SECONDS, TimedHttpProtocol
from lcorpp.web.requests import RequestError, parse_request
from lcorpp.web.serial_thread import SerialThread
from lcorpp.web.service import Service
from lcorpp.web.setup import find_page_folder

LOG = logging.getLogger(__name__)

HOST = "127.0.0.1"
HOSTS = [HOST, "localhost", "[::1]"]
"""Names under which the page may be asked for; another one is a page that was given this address."""
MAX_PAGES = 200
"""Open pages at a time."""
MAX_MESSAGE = 2**21
"""Bytes of a message; a longer one closes its connection."""
MAX_PUSHED = 64
"""Messages that wait for a slow page; later ones that it did not ask for are left out."""
SHUTDOWN_SECONDS = 1
"""Seconds for replies at the end of the server."""
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self';"
        " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class PageServer:
    """Serves the page, and a service for each of its connections.

    The services share a robot, so one thread replies to their requests, one after another; another thread
    takes the judged trials, which may be long. The event loop never waits for them.

    waiting: the messages for each open page.

    Args:
        make_service: called for each connection, in the thread of the requests.
        folder: of the page's files; by default those of the package.
    """

    def __init__(self, make_service: Callable[[], Service], folder: Path | None = None) -> None:
        self._make_service = make_service
        self.waiting: set[asyncio.Queue[str]] = set()
        self._requests, self._judgements = SerialThread("requests"), SerialThread("judgements")
        routes = [
            WebSocketRoute("/session", self._serve_page),
            Mount("/", StaticFiles(directory=folder or find_page_folder(), html=True)),
        ]
        hosts = Middleware(TrustedHostMiddleware, allowed_hosts=HOSTS)
        self.app = Starlette(routes=routes, middleware=[Middleware(SecurityHeaders), hosts])

    def notify(self, message: Mapping[str, Any]) -> None:
        """Send a message to all pages, from the thread of the event loop."""
        text = json.dumps({"id": None, **message})
        for queue in self.waiting:
            with suppress(asyncio.QueueFull):
                queue.put_nowait(text)

    def close(self) -> None:
        """End the threads."""
        self._requests.close()
        self._judgements.close()

    async def _serve_page(self, socket: WebSocket) -> None:
        if not is_own_origin(socket):
            await socket.close(1008)  # before `accept`: the answer is 403
            return
        await socket.accept()
        if len(self.waiting) >= MAX_PAGES:
            error = RequestError("unavailable", f"{MAX_PAGES} pages are open; expected fewer")
            await socket.send_json(error.reply())
            await socket.close(1013)
            return
        queue: asyncio.Queue[str] = asyncio.Queue(MAX_PUSHED)
        self.waiting.add(queue)
        sender = asyncio.create_task(_send_all(socket, queue))
        try:
            service = await self._requests.call(self._make_service)
            while True:
                message = await socket.receive()
                if message["type"] == "websocket.disconnect":
                    break
                text = message.get("text")
                await queue.put(await self._reply(service, message["bytes"] if text is None else text))
        finally:
            self.waiting.discard(queue)
            sender.cancel()

    async def _reply(self, service: Service, text: str | bytes) -> str:
        """Return the reply to a request as JSON, whatever happens in it."""
        number = None
        try:
            request = parse_request(text)
            number = request.id
            thread = self._judgements if request.type == "judge" else self._requests
            return json.dumps(await thread.call(service.reply, request), allow_nan=False)
        except RequestError as error:
            return json.dumps(error.reply())
        except Exception as error:  # of an own learner or of a fault of ours: it must not end the connection
            LOG.exception("a request failed")
            reason = f"{type(error).__name__}: {error}"
            return json.dumps(RequestError("failed", reason, number).reply())


async def _send_all(socket: WebSocket, queue: asyncio.Queue[str]) -> None:
    """Send the messages of a queue one after the other; those for a closed page are dropped."""
    is_open = True
    while True:
        text = await queue.get()
        if is_open:
            try:
                await socket.send_text(text)
            except (WebSocketDisconnect, RuntimeError):
                is_open = False


class SecurityHeaders:
    """Adds `HEADERS` to each response."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = [(name.lower().encode(), value.encode()) for name, value in HEADERS.items()]
                message = {**message, "headers": [*message.get("headers", []), *own]}
            await send(message)

        await self._app(scope, receive, send_with_headers)


def is_own_origin(socket: WebSocket) -> bool:
    """Whether a connection comes from the page itself; programs without an origin are not pages."""
    origin = socket.headers.get("origin")
    return origin is None or origin == f"http://{socket.headers.get('host')}"


def make_uvicorn(server: PageServer) -> uvicorn.Server:
    """Return the server, which does not listen yet; `serve(sockets=[...])` runs it until Ctrl-C."""
    config = uvicorn.Config(
        server.app,
        http=TimedHttpProtocol,
        log_level="warning",
        ws_max_size=MAX_MESSAGE,
        ws_per_message_deflate=False,
        ws_ping_interval=PING_SECONDS,
        ws_ping_timeout=PING_SECONDS,
        timeout_graceful_shutdown=SHUTDOWN_SECONDS,
        lifespan="off",
    )
    return uvicorn.Server(config)
