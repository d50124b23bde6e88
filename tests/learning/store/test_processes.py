"""One writer, any number of readers, each in a process of its own."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from lcorpp.errors import FileError
from lcorpp.learning.store import Store, read_store
from tests.learning.store.stores import SCHEMA, filled, track, walk

ROOT = Path(__file__).parents[3]

OPEN = """
import os, sys, time
from lcorpp.learning.store import Store, read_store
from tests.learning.store.stores import SCHEMA, track
"""


@pytest.fixture
def path(tmp_path):
    return tmp_path / "s"


@pytest.fixture
def started(path):
    """Start a process that runs some lines, with `path` as `sys.argv[1]`; it is killed after the test."""
    processes = []

    def start(lines: str) -> subprocess.Popen:
        process = subprocess.Popen(
            [sys.executable, "-c", OPEN + lines, str(path)], cwd=ROOT, stdout=subprocess.PIPE, text=True
        )
        processes.append(process)
        return process

    yield start
    for process in processes:
        process.kill()
        process.communicate()


HOLDS = (
    "store = Store(sys.argv[1], SCHEMA); store.append(track(0)); print('open', flush=True); time.sleep(600)"
)


def test_a_second_writer_is_refused_until_the_first_is_gone_however_it_went(path, started):
    first = started(HOLDS)
    assert first.stdout.readline() == "open\n"
    with pytest.raises(FileError, match="is already being written to, by another process or by this one"):
        Store(path, SCHEMA)
    assert len(read_store(path)) == 1
    first.send_signal(signal.SIGKILL)
    first.wait()
    with Store(path, SCHEMA) as store:
        store.append(track(1))
        assert len(store) == 2


def test_nor_may_this_process_write_twice(path):
    with Store(path, SCHEMA), pytest.raises(FileError, match="or by this one"):
        Store(path, SCHEMA)
    Store(path, SCHEMA).close()


def test_a_forked_child_that_outlives_the_writer_keeps_no_lock(path, started):
    parent = started(
        "store = Store(sys.argv[1], SCHEMA)\n"
        "if os.fork():\n    os._exit(0)\n"
        "time.sleep(.1)\n"
        "try:\n    store.append(track(0))\n"
        "except Exception as error:\n    print(os.getpid(), error, flush=True)\n"
        "time.sleep(600)"
    )
    parent.wait()
    child, _, words = parent.stdout.readline().partition(" ")
    try:
        assert "this store is closed" in words
        with Store(path, SCHEMA) as store:
            store.append(track(1))
        os.kill(int(child), 0)  # it lives
    finally:
        os.kill(int(child), signal.SIGKILL)


def test_readers_see_whole_records_while_they_are_written(path, started):
    writer = started(
        "with Store(sys.argv[1], SCHEMA) as store:\n"
        "    print('open', flush=True)\n"
        "    for row in range(400):\n"
        "        store.append(track(row, points=40), durable=row % 10 == 0)\n"
    )
    assert writer.stdout.readline() == "open\n"
    count, reading = 0, read_store(path)
    while len(reading) < 400:
        ended = writer.poll() is not None
        reading = read_store(path)
        assert len(reading) >= count
        assert not reading.damage
        new = reading.tracks[count:]
        assert [stored.extra["row"] for stored in new] == list(range(count, len(reading)))
        for stored, numbers in zip(new, reading.trajectories(new), strict=True):
            assert np.array_equal(numbers, walk(stored.extra["row"], 40))
        count = len(reading)
        assert not ended or count == 400


def test_many_readers_at_once(path, started):
    """Eight threads of readers beside a writer; none needs the lock."""
    filled(path, 50)
    counts = []
    with Store(path, SCHEMA) as store:
        threads = [
            threading.Thread(target=lambda: counts.append(len(read_store(path).dataset()))) for _ in range(8)
        ]
        for thread in threads:
            thread.start()
        for row in range(50, 60):
            store.append(track(row), durable=False)
        for thread in threads:
            thread.join()
    assert len(counts) == 8
    assert all(43 <= count <= 52 for count in counts)
