"""Worker processes leave Ctrl-C to their parent process, and end with it."""

import os
import shutil
import signal
import subprocess
import sys
import time

import pytest
from joblib import delayed
from joblib.externals.loky.process_executor import ShutdownExecutorError

from lcorpp.workers import end_with_thread, run_in_workers, start_worker

PARENT = """
import sys, tempfile, time
from joblib import delayed
from lcorpp.interrupts import Terminated, end_on_signals
from lcorpp.workers import run_in_workers, start_worker

try:
    with end_on_signals(), tempfile.TemporaryDirectory() as folder:
        print(folder, start_worker().submit(time.sleep, 600), flush=True)
        with run_in_workers((delayed(time.sleep)(seconds) for seconds in (0, 600)), jobs=2) as results:
            for _ in results:
                print("works", flush=True)
except Terminated as ended:
    sys.exit(ended.code)
"""
"""A parent process of two pools of workers, which works for ten minutes."""


def find_processes(group: int) -> list[int]:
    """Return the processes of a group that still run."""
    lines = subprocess.run(
        ["ps", "-A", "-o", "pid=,pgid=,stat="], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    rows = [line.split() for line in lines]
    return [int(pid) for pid, own, state in rows if int(own) == group and state[0] != "Z"]


def wait_for_end(group: int) -> list[int]:
    """Return the processes of a group that remain after a minute, which a busy machine may need."""
    end = time.monotonic() + 60
    while (left := find_processes(group)) and time.monotonic() < end:
        time.sleep(0.1)
    return left


def test_workers_ignore_sigint():
    with run_in_workers((delayed(signal.getsignal)(signal.SIGINT) for _ in range(4)), jobs=2) as results:
        assert list(results) == [signal.SIG_IGN] * 4


def test_results_come_in_the_order_of_the_calls():
    calls = (delayed(abs)(number) for number in range(20))
    with run_in_workers(calls, jobs=2, ordered=True) as results:
        assert list(results) == list(range(20))


def test_a_worker_is_killed_during_its_work():
    executor = start_worker()
    future = executor.submit(time.sleep, 600)
    executor.shutdown(kill_workers=True)
    assert isinstance(future.exception(), ShutdownExecutorError)


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_no_worker_outlives_its_parent_process(number, tmp_path):
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    with subprocess.Popen(
        [sys.executable, "-c", PARENT],
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=environment,
    ) as parent:
        assert str(tmp_path) in parent.stdout.readline()
        assert parent.stdout.readline() == "works\n"
        assert len(find_processes(parent.pid)) >= 3
        parent.send_signal(number)
        parent.wait()
    assert wait_for_end(parent.pid) == []
    assert parent.returncode == (-number if number == signal.SIGKILL else 128 + number)
    if number == signal.SIGTERM:
        assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(shutil.which("setpriv") is None, reason="programs end with their thread by setpriv")
def test_no_program_outlives_the_process_that_waits_for_it():
    code = """
import subprocess
from lcorpp.workers import end_with_thread
subprocess.run(end_with_thread(["sh", "-c", "echo works; exec sleep 600"]))
"""
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True) as parent:
        assert parent.stdout.readline() == "works\n"
        parent.kill()
        parent.wait()
        assert wait_for_end(parent.pid) == []


def test_a_program_that_is_missing_is_not_wrapped():
    assert end_with_thread(["no-such-program", "x"]) == ["no-such-program", "x"]
