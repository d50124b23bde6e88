"""`lcorpp play`: what it refuses before the training, and that it serves the page."""

import json
import os
import signal
import socket
import subprocess
import sys
import urllib.request

import pytest


@pytest.fixture
def untrained(monkeypatch):
    """Fails a test that begins to train or solve."""

    def fail(*arguments, **options):
        raise AssertionError("the command has begun to work")

    monkeypatch.setattr("lcorpp.web.setup.set_up_robot", fail)


@pytest.mark.usefixtures("untrained")
def test_a_port_in_use_is_refused(lcorpp):
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        ended = lcorpp("play", "--no-open", "--port", port)
    assert ended.code == 2
    assert ended.err == (
        f"lcorpp: --port {port}: cannot be opened: Address already in use;"
        " expected a free port, 0 takes any\n"
    )


@pytest.mark.usefixtures("untrained")
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere"], "nowhere"),
        (["--learner", "none"], "unknown learner 'none'"),
        (["shopping", "--tracks", "40"], "shopping has no sense of tracks that a pointer could give"),
        (["--store", __file__], "not a store of tracks"),
        (["shopping", "--store", "new.tracks"], "no classifier of shopping learns from the page"),
        (["--log", "."], ".: cannot be written: Is a directory"),
    ],
)
def test_play_refuses_options_at_once(lcorpp, arguments, message):
    ended = lcorpp("play", *arguments, "--no-open", "--port", 0)
    assert ended.code == 2
    assert message in ended.err


@pytest.mark.usefixtures("untrained")
def test_a_missing_package_is_named(lcorpp, monkeypatch):
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    ended = lcorpp("play", "--no-open")
    assert ended.code == 2
    assert "pip install 'lcorpp[play]'" in ended.err


def test_the_page_is_served_until_it_is_interrupted(tmp_path):
    command = "from lcorpp.cli.main import main; main()"
    options = ["play", "shopping", "--preset", "small", "--no-open", "--port", "0"]
    with subprocess.Popen(
        [sys.executable, "-c", command, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        line = process.stdout.readline()
        address = line.split(" is at ")[1].split()[0]
        with urllib.request.urlopen(address) as reply:
            assert b"<title>" in reply.read()
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate()
    assert "Traceback" not in errors
    assert process.returncode in (0, 130, -signal.SIGINT), (json.dumps(errors), os.name)
