"""Long commands with several processes that are ended at random times: no process of theirs remains."""

import json
import random
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from shutil import which

import pytest
from websockets.sync.client import ClientConnection, connect

from tests.test_workers import find_processes

KILLS = 20
"""Number of times that each command is ended."""

SECONDS = 60
"""Seconds until which all processes end; 5 on a machine that is not busy."""

SIGNALS = (signal.SIGTERM, signal.SIGKILL, signal.SIGINT)

SWEEP = """
domain = "intention"
trials = 20000
strategies = ["R+P", "LCORPP"]

[axes]
noise = { from = 0.05, to = 0.4, count = 12 }
"""

COMMANDS = {
    "run": "run intention --learner summaries --tracks 300 --trials 200000 --jobs 2 --no-cache --out {}",
    "learn": "learn intention --learner summaries --tracks 100 --jobs 2 --no-cache --store {}/s.tracks",
    "figures": "figures strategies --fast --jobs 2 --out {}",
    "sweep": "sweep {}/sweep.toml --jobs 2 --out {}/out",
    "observe": "observe --voices flite:slt,flite:rms --out {}",
    "play": "play intention --no-open --port 0 --jobs 2 --no-cache --store {}/s.tracks",
    "data": "data make --tracks 20000 -o {}/made.csv",
}
"""Name -> a command; {} is a new folder."""


@dataclass
class Ending:
    """How a command ended: the seconds until no process remained, and what is wrong."""

    seconds: float
    faults: list[str] = field(default_factory=list)


def start(command: str, folder: Path) -> subprocess.Popen[str]:
    (folder / "sweep.toml").write_text(SWEEP)
    program = [sys.executable, "-c", "from lcorpp.cli.main import main; main()"]
    return subprocess.Popen(
        [*program, *command.replace("{}", str(folder)).split()],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )


def end(process: subprocess.Popen[str], number: int) -> Ending:
    """Send a signal, and wait until the processes of the session have ended."""
    process.send_signal(number)
    began = time.monotonic()
    while number == signal.SIGINT and process.poll() is None:
        time.sleep(0.05)
        if time.monotonic() > began + 20:  # some commands end a step, and continue with what they have
            process.send_signal(number)
            began = time.monotonic()
    if number == signal.SIGINT:
        began = time.monotonic()
    while (left := find_processes(process.pid)) and time.monotonic() < began + SECONDS:
        time.sleep(0.05)
    ending = Ending(time.monotonic() - began)
    if left:
        ending.faults.append(f"processes {left} remain")
        for pid in left:
            subprocess.run(["kill", "-9", str(pid)], check=False)
    output, _ = process.communicate()
    if ", in main" in output:  # a traceback; an interrupt while Python starts is not ours
        ending.faults.append(output)
    expected = {signal.SIGTERM: (143, 0, -15), signal.SIGKILL: (-9, 0), signal.SIGINT: (130, 0, 1, -2)}
    if process.returncode not in expected[number]:
        ending.faults.append(f"exit code {process.returncode}: {output}")
    return ending


def end_at_random(command: str, folder: Path, number: int, rng: random.Random) -> Ending:
    """Run a command and end it some time after its start, or after the start of its workers."""
    process, began = start(command, folder), time.monotonic()
    if rng.random() < 0.7:
        while process.poll() is None and len(find_processes(process.pid)) < 3:
            time.sleep(0.05)
            if time.monotonic() > began + 20:  # a command without workers
                break
    time.sleep(rng.uniform(0, 3))
    return end(process, number)


def end_during_training(folder: Path, number: int, rng: random.Random) -> Ending:
    """Judge a trial on the page, and end `play` while it trains."""
    options = "--learner lstm-fast --tracks 200 --epochs 100 --batch 1 --no-open --port 0 --jobs 2 --no-cache"
    process = start(f"play intention {options} --store {{}}/s.tracks", folder)
    address = process.stdout.readline().split(" is at http://")[1].split("/")[0]
    with connect(f"ws://{address}/session", max_size=None) as session:
        try:
            before = find_processes(process.pid)
            begin_training(session)
            if rng.random() < 0.7:
                limit = time.monotonic() + SECONDS
                while not set(find_processes(process.pid)).difference(before):
                    assert time.monotonic() < limit, "no process trains"
                    time.sleep(0.05)
            time.sleep(rng.uniform(0, 3))
        finally:
            ending = end(process, number)
    return ending


def begin_training(session: ClientConnection) -> None:
    """Judge a trial as the page does, and wait for the notice that the training begins."""
    track = [[i / 10, 1.0, 9 - i / 10] for i in range(40)]
    trial = {"facts": {}, "samples": {"motion": track}, "value": ["interested"]}
    for i, request in enumerate([{"type": "start"}, {"type": "judge", **trial}]):
        session.send(json.dumps({"id": i, **request}))
    messages = []
    while {"id": None, "type": "learning"} not in messages:
        messages.append(json.loads(session.recv(timeout=SECONDS)))
        assert messages[-1]["type"] != "error", messages[-1]


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_no_process_of_a_command_remains(name, tmp_path):
    if "flite" in COMMANDS[name] and not which("flite"):
        pytest.skip("flite is not installed")
    rng, endings = random.Random(name), []
    for i in range(KILLS):
        (folder := tmp_path / str(i)).mkdir()
        endings.append(end_at_random(COMMANDS[name], folder, SIGNALS[i % 3], rng))
    assert [fault for ending in endings for fault in ending.faults] == []


@pytest.mark.slow
def test_no_process_of_the_page_remains_after_the_end_of_a_training(tmp_path):
    rng, endings = random.Random(0), []
    for i in range(KILLS):
        (folder := tmp_path / str(i)).mkdir()
        endings.append(end_during_training(folder, SIGNALS[i % 3], rng))
    assert [fault for ending in endings for fault in ending.faults] == []
