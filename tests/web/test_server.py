"""The server of the page: what it serves, to whom, and that no connection disturbs another one."""

import asyncio
import http.client
import json
import socket
import threading

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from lcorpp.web.server import HEADERS, MAX_MESSAGE, PageServer, make_uvicorn
from lcorpp.web.session import Session


@pytest.fixture(scope="module")
def server(intention, tmp_path_factory):
    """A running server: its port, and the server."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "index.html").write_text("the page")
    (folder.parent / "secret").write_text("secret")
    page = PageServer(lambda: Session(lambda: intention), folder)
    uvicorn = make_uvicorn(page)
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        thread = threading.Thread(target=lambda: asyncio.run(uvicorn.serve([listening])))
        thread.start()
        yield listening.getsockname()[1], page
        uvicorn.should_exit = True
        thread.join()


def get(port, path, host="127.0.0.1"):
    connection = http.client.HTTPConnection("127.0.0.1", port)
    connection.putrequest("GET", path, skip_host=True)
    connection.putheader("Host", f"{host}:{port}")
    connection.endheaders()
    reply = connection.getresponse()
    body = reply.read()
    connection.close()
    return reply, body


def open_session(port, **options):
    return connect(f"ws://127.0.0.1:{port}/session", **options)


def ask(session, **fields):
    session.send(json.dumps({"id": 1, **fields}))
    return json.loads(session.recv())


def test_the_page_has_a_strict_policy(server):
    reply, body = get(server[0], "/")
    assert body == b"the page"
    for name, value in HEADERS.items():
        assert reply.headers[name] == value
    assert "unsafe" not in reply.headers["Content-Security-Policy"]


@pytest.mark.parametrize("path", ["/../secret", "/%2e%2e/secret", "//etc/passwd", "/..%2fsecret", "/session"])
def test_nothing_outside_the_folder_is_served(server, path):
    reply, body = get(server[0], path)
    assert reply.status in (400, 404)
    assert b"secret" not in body
    assert b"root:" not in body


def test_another_host_name_is_refused(server):
    assert get(server[0], "/", host="evil.example")[0].status == 400


def test_a_page_of_another_origin_is_refused(server):
    with pytest.raises(InvalidStatus) as caught, open_session(server[0], origin="http://evil.example"):
        pass
    assert caught.value.response.status_code == 403
    with open_session(server[0], origin=f"http://127.0.0.1:{server[0]}") as session:
        assert ask(session, type="start")["type"] == "started"


def test_two_pages_have_sessions_of_their_own(server):
    with open_session(server[0]) as first, open_session(server[0]) as second:
        assert ask(first, type="decide")["type"] == "decision"
        assert ask(second, type="answer", said="pos", draw=0)["code"] == "out_of_order"
        assert ask(second, type="decide")["type"] == "decision"


def test_refused_messages_keep_the_session(server):
    with open_session(server[0]) as session:
        ask(session, type="decide")
        for text in ("{", b"\xff\xfe", " " * 100_000, "null"):
            session.send(text)
            assert json.loads(session.recv())["type"] == "error"
        assert ask(session, type="answer", said="pos", draw=0)["type"] == "step"


def test_a_message_beyond_all_bounds_ends_its_connection_alone(server):
    with open_session(server[0]) as other:
        with open_session(server[0]) as session:
            session.send("x" * (MAX_MESSAGE + 1))
            with pytest.raises(ConnectionClosed):
                session.recv()
        assert ask(other, type="start")["type"] == "started"


def test_a_page_that_goes_away_leaves_nothing(server):
    port, page = server
    raw = socket.create_connection(("127.0.0.1", port))
    raw.sendall(
        b"GET /session HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )
    assert b"101" in raw.recv(1024)
    raw.close()  # without a close frame
    with open_session(port) as session:
        while len(page.waiting) > 1:
            ask(session, type="start")
    while page.waiting:
        get(port, "/")


def test_too_many_pages_are_refused(server, monkeypatch):
    monkeypatch.setattr("lcorpp.web.server.MAX_SESSIONS", 1)
    with open_session(server[0]) as session:
        ask(session, type="start")
        with open_session(server[0]) as second:
            assert json.loads(second.recv())["message"] == "1 pages are open; expected fewer"


def test_a_notice_reaches_all_pages(server):
    port, page = server
    with open_session(port) as first, open_session(port) as second:
        for session in (first, second):
            ask(session, type="start")
        page.notify({"type": "learning"})
        for session in (first, second):
            assert json.loads(session.recv()) == {"id": None, "type": "learning"}
