"""Worker processes ignore Ctrl-C; their parent does not."""

import signal
import subprocess
import sys
import threading

import pytest
from joblib import Parallel, delayed

from lcorpp.workers import delay_sigint, ignore_sigint


def test_a_child_process_ignores_sigint():
    code = "import os, signal; os.kill(os.getpid(), signal.SIGINT); print('alive')"
    with ignore_sigint():
        worker = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert worker.communicate(timeout=60)[0] == "alive\n"


def test_workers_of_joblib_ignore_sigint():
    with ignore_sigint():
        started = Parallel(n_jobs=2, return_as="generator")(
            delayed(signal.getsignal)(signal.SIGINT) for _ in range(4)
        )
    assert list(started) == [signal.SIG_IGN] * 4


def test_the_handler_is_restored():
    before = signal.getsignal(signal.SIGINT)
    with ignore_sigint():
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    assert signal.getsignal(signal.SIGINT) is before


def test_other_threads_change_no_handler():
    seen = []

    def inside() -> None:
        with ignore_sigint():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=inside)
    thread.start()
    thread.join()
    assert seen == [signal.getsignal(signal.SIGINT)]


def test_an_interrupt_waits_for_the_end_of_a_block():
    done = []

    def work():
        with delay_sigint():
            signal.raise_signal(signal.SIGINT)
            done.append(True)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
