"""The server of the page: what it serves, to whom, and that no connection disturbs another one."""

import http.client
import json
import math
import random
import re
import socket
import threading

import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from lcorpp.web import connections, server as server_module
from lcorpp.web.requests import FIELDS, MAX_REQUEST
from lcorpp.web.server import HEADERS, MAX_MESSAGE, PageServer
from lcorpp.web.service import Service
from tests.web.conftest import serve

INFER = {"type": "infer", "facts": {"time": "morning"}, "labels": {}}


@pytest.fixture(scope="module")
def server(intention, tmp_path_factory):
    """A running server: its port, and the server."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "index.html").write_text("the page")
    (folder.parent / "secret").write_text("secret")
    page = PageServer(lambda: Service(lambda: intention), folder)
    with serve(page) as port:
        yield port, page


def get(port, path, host="127.0.0.1"):
    connection = http.client.HTTPConnection("127.0.0.1", port)
    connection.putrequest("GET", path, skip_host=True)
    connection.putheader("Host", f"{host}:{port}")
    connection.endheaders()
    reply = connection.getresponse()
    body = reply.read()
    connection.close()
    return reply, body


def open_page(port, **options):
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
    with pytest.raises(InvalidStatus) as caught, open_page(server[0], origin="http://evil.example"):
        pass
    assert caught.value.response.status_code == 403
    with open_page(server[0], origin=f"http://127.0.0.1:{server[0]}") as session:
        assert ask(session, type="start")["type"] == "started"


def test_two_pages_have_services_of_their_own(server):
    with open_page(server[0]) as first, open_page(server[0]) as second:
        assert ask(first, type="start")["model"] is not None
        assert ask(second, **INFER)["code"] == "out_of_order"
        assert ask(second, type="start")["model"] is not None
        samples = {"type": "samples", "sense": "motion", "samples": [[0, 1, 9]]}
        for session in (first, second):
            assert ask(session, **samples)["points"] == 1


def test_refused_messages_keep_the_trial(server):
    with open_page(server[0]) as session:
        ask(session, type="start")
        for text in ("{", b"\xff\xfe", " " * (MAX_REQUEST + 1), "null"):
            session.send(text)
            assert json.loads(session.recv())["type"] == "error"
        assert ask(session, **INFER)["type"] == "posterior"


def test_a_message_beyond_all_bounds_ends_its_connection_alone(server):
    def exchange(session):
        session.send("x" * (MAX_MESSAGE + 1))
        return session.recv()

    with open_page(server[0]) as other:
        # The connection ends while the message is sent or afterwards, whichever is first.
        with open_page(server[0]) as session, pytest.raises(ConnectionClosed):
            exchange(session)
        assert ask(other, type="start")["type"] == "started"


def test_a_page_that_goes_away_leaves_nothing(server):
    port, page = server
    raw = socket.create_connection(("127.0.0.1", port))
    raw.sendall(HANDSHAKE)
    assert b"101" in raw.recv(1024)
    raw.close()  # without a close frame
    with open_page(port) as session:
        while len(page.waiting) > 1:
            ask(session, type="start")
    while page.waiting:
        get(port, "/")


def test_too_many_pages_are_refused(server, monkeypatch):
    monkeypatch.setattr("lcorpp.web.server.MAX_PAGES", 1)
    with open_page(server[0]) as session:
        ask(session, type="start")
        with open_page(server[0]) as second:
            assert json.loads(second.recv())["message"] == "1 pages are open; expected fewer"


def test_a_notice_reaches_all_pages(server):
    port, page = server
    with open_page(port) as first, open_page(port) as second:
        for session in (first, second):
            ask(session, type="start")
        page.notify({"type": "learning"})
        for session in (first, second):
            assert json.loads(session.recv()) == {"id": None, "type": "learning"}


def encode(value):
    """Return JSON in which a text such as "957 deep" is a nested array, too deep for `json.dumps`."""
    return re.sub(r'"(\d+) deep"', lambda found: "[" * int(found[1]) + "]" * int(found[1]), json.dumps(value))


def draw_value(rng, depth=0):
    """Return any JSON value, or a number that JSON has not."""
    leaves = [
        lambda: None,
        lambda: rng.random() < 0.5,
        lambda: rng.choice([0, -1, 1, 2**53, 10**400, -(10**400), 10**4000]),
        lambda: rng.choice([0.5, 1e308, -1e308, 1e-320, math.nan, math.inf, -math.inf]),
        lambda: rng.choice(["", "motion", "pos", "time", "x" * 300, "\ud800", "\0", "\u202e"]),
        lambda: f"{rng.choice([1, 50, 957, 990, 9000])} deep",
    ]
    if depth < 3 and rng.random() < 0.4:
        values = [draw_value(rng, depth + 1) for _ in range(rng.randrange(4))]
        return values if rng.random() < 0.5 else {str(i): value for i, value in enumerate(values)}
    return rng.choice(leaves)()


def draw_request(rng):
    """Return the text of a request, most of which are wrong in one way."""
    kind = rng.choice(list(FIELDS))
    good = {
        "facts": {"time": "morning"},
        "labels": {},
        "sense": "motion",
        "samples": [[rng.random(), 1, 9]],
        "value": ["interested"],
        "steps": [["greet", "pos"]],
    }
    request = {"id": rng.randrange(9), "type": kind, **{name: good[name] for name in FIELDS[kind]}}
    if rng.random() < 0.9:
        request[rng.choice([*request, "other"])] = draw_value(rng)
    text = encode(request)
    if rng.random() < 0.1:
        text = text[: rng.randrange(len(text))]
    return text.encode(errors="replace") if rng.random() < 0.2 else text


def test_each_of_many_wrong_requests_has_a_reply(server):
    rng = random.Random(0)
    with open_page(server[0], max_size=None) as session:
        for _ in range(300):
            session.send(draw_request(rng))
            reply = json.loads(session.recv(), parse_constant=pytest.fail)
            assert {"id", "type"} <= reply.keys()
            assert reply["type"] != "error" or reply["code"] in (
                ["malformed", "unknown_type", "invalid", "out_of_order", "too_large", "unavailable", "failed"]
            )
        assert ask(session, type="start")["type"] == "started"


@pytest.mark.parametrize("value", [10**400, "900 deep", "957 deep", "9000 deep"])
@pytest.mark.parametrize("field", ["id", "type", "facts", "steps", "samples", "value", "unknown"])
def test_a_number_of_401_digits_and_deep_arrays_are_refused(server, field, value):
    kinds = {"facts": "infer", "steps": "log", "samples": "samples", "value": "judge"}
    kind = kinds.get(field, "start")
    others = {"facts": {}, "labels": {}, "sense": "motion", "samples": {}}
    with open_page(server[0]) as session:
        request = {"id": 1, "type": kind, **{name: others.get(name) for name in FIELDS[kind]}, field: value}
        session.send(encode(request))
        assert json.loads(session.recv())["code"] in ("malformed", "unknown_type", "invalid")
        assert ask(session, type="start")["type"] == "started"


class Failing:
    """A service of which a request fails for an unknown reason, and another has no JSON."""

    def reply(self, request):
        if request.type == "infer":
            raise ZeroDivisionError("a fault")
        return {"value": math.nan}


def test_any_exception_in_a_request_is_a_reply(caplog):
    with serve(PageServer(Failing)) as port, open_page(port) as session:
        reply = ask(session, **INFER)
        assert (reply["id"], reply["code"], reply["message"]) == (1, "failed", "ZeroDivisionError: a fault")
        assert ask(session, type="start")["code"] == "failed"
    assert [record.message for record in caplog.records] == ["a request failed"] * 2


class Judging:
    """A service whose judged trials wait for an event."""

    def __init__(self, event):
        self._event = event

    def reply(self, request):
        if request.type == "judge":
            self._event.wait()
        return {"type": request.type}


def test_a_long_judgement_delays_no_other_page():
    event = threading.Event()
    page = PageServer(lambda: Judging(event))
    with serve(page) as port, open_page(port) as first, open_page(port) as second:
        first.send(
            json.dumps({"id": 1, "type": "judge", "facts": {}, "samples": {}, "value": ["interested"]})
        )
        assert ask(second, type="start")["type"] == "start"
        assert get(port, "/")[0].status == 200
        event.set()
        assert json.loads(first.recv())["type"] == "judge"


HANDSHAKE = (
    b"GET /session HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


@pytest.fixture(scope="module")
def impatient(intention):
    """The port of a server with short limits."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(connections, "REQUEST_SECONDS", 0.2)
        patch.setattr(server_module, "PING_SECONDS", 0.2)
        with serve(PageServer(lambda: Service(lambda: intention))) as port:
            yield port


@pytest.mark.parametrize(
    "start",
    [b"", b"GET / HT", HANDSHAKE[:-2], b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 9\r\n\r\n1"],
)
def test_a_half_open_connection_ends(impatient, start):
    with socket.create_connection(("127.0.0.1", impatient), timeout=300) as raw:  # an open one fails
        raw.sendall(start)
        try:
            while raw.recv(4096):
                pass
        except ConnectionResetError:
            pass


def test_a_page_that_does_not_reply_to_pings_ends(impatient):
    with socket.create_connection(("127.0.0.1", impatient), timeout=300) as raw:  # an open one fails
        raw.sendall(HANDSHAKE)
        try:
            while raw.recv(4096):  # the pings are read, but not replied to
                pass
        except ConnectionResetError:
            pass


def test_an_open_page_that_is_silent_stays(impatient):
    with open_page(impatient) as session, open_page(impatient) as other:
        with socket.create_connection(("127.0.0.1", impatient)) as raw:
            raw.recv(1)  # until the limit of a request is over
        for own in (session, other):
            assert ask(own, type="start")["type"] == "started"
