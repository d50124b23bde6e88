"""A web server of one file that cuts connections, as networks do."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

TAG = '"first"'


class Web:
    """State of the server, to be changed between requests, and a record of the requests.

    content: the file. cut: bytes after which each answer is cut, None sends all. ranges: whether it knows
    parts. tag: the ETag. status: an answer other than the file. asked: Range and If-Range of each request.
    """

    def __init__(self, content: bytes) -> None:
        self.content, self.tag = content, TAG
        self.cut: int | None = None
        self.ranges, self.status = True, 200
        self.asked: list[tuple[str | None, str | None]] = []
        self.url = ""


@contextmanager
def serving(content: bytes) -> Iterator[Web]:
    """Run a server on this machine while the context is active."""
    web = Web(content)

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def do_GET(self) -> None:
            asked, condition = self.headers.get("Range"), self.headers.get("If-Range")
            web.asked.append((asked, condition))
            if web.status != 200:
                self.send_error(web.status)
                return
            start, size = 0, len(web.content)
            if asked and web.ranges and condition in (None, web.tag):
                start = int(asked.removeprefix("bytes=").rstrip("-"))
                if start >= size:
                    self.send_response(416)
                    self.send_header("Content-Range", f"bytes */{size}")
                    self.send_header("Content-Length", "0")
                    self.end_headers()
                    return
                self.send_response(206)
                self.send_header("Content-Range", f"bytes {start}-{size - 1}/{size}")
            else:
                self.send_response(200)
            if web.tag:
                self.send_header("ETag", web.tag)
            self.send_header("Content-Length", str(size - start))
            self.end_headers()
            end = size if web.cut is None else min(size, start + web.cut)
            self.wfile.write(web.content[start:end])
            self.wfile.flush()
            if end < size:
                self.close_connection = True
                self.connection.shutdown(2)

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
