"""A web server of one file that cuts connections, as networks do."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


class Web:
    """State of the server, to be changed between requests.

    content: the file. cut: bytes after which each answer is cut, None sends all. length: whether it states
    the length. status: an answer other than the file. requests: how many it received.
    """

    def __init__(self, content: bytes) -> None:
        self.content = content
        self.cut: int | None = None
        self.length, self.status, self.requests = True, 200, 0
        self.url = ""


@contextmanager
def serving(content: bytes) -> Iterator[Web]:
    """Run a server on this machine while the context is active."""
    web = Web(content)

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            web.requests += 1
            if web.status != 200:
                self.send_error(web.status)
                return
            self.send_response(200)
            if web.length:
                self.send_header("Content-Length", str(len(web.content)))
            self.end_headers()
            self.wfile.write(web.content[: web.cut])

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    web.url = f"http://127.0.0.1:{server.server_port}/data/people%20here.csv"
    try:
        yield web
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
