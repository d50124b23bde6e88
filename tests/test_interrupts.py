"""Handlers of Ctrl-C, and the end of a process by other signals."""

import signal
import subprocess
import sys
import threading
from textwrap import indent

import pytest

from lcorpp.interrupts import Terminated, delay_sigint, end_on_signals, ignore_sigint


def test_a_child_process_ignores_sigint():
    code = "import os, signal; os.kill(os.getpid(), signal.SIGINT); print('alive')"
    with ignore_sigint():
        worker = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert worker.communicate(timeout=60)[0] == "alive\n"


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


def run(code: str) -> subprocess.CompletedProcess[str]:
    """Run a program in which SIGTERM is to end it."""
    start = "import os, signal, sys, threading, time\nfrom lcorpp import interrupts\ntry:\n"
    stop = "\nexcept interrupts.Terminated as ended:\n    sys.exit(ended.code)\n"
    program = start + indent(code, "    ") + stop
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_a_signal_ends_a_process_after_its_clean_up(name):
    code = f"""
with interrupts.end_on_signals():
    try:
        signal.raise_signal(signal.{name})
        time.sleep(600)
    finally:
        print("cleaned up")
"""
    ended = run(code)
    assert (ended.returncode, ended.stdout) == (128 + getattr(signal, name), "cleaned up\n")


def test_a_second_signal_ends_a_process_at_once():
    code = """
with interrupts.end_on_signals():
    try:
        signal.raise_signal(signal.SIGTERM)
    finally:
        signal.raise_signal(signal.SIGTERM)
        print("not reached")
"""
    ended = run(code)
    assert (ended.returncode, ended.stdout) == (143, "")


def test_a_process_that_does_not_clean_up_ends_all_the_same():
    code = """
interrupts.EXIT_SECONDS = 0
with interrupts.end_on_signals():
    try:
        signal.raise_signal(signal.SIGTERM)
    finally:
        threading.Event().wait(600)
"""
    assert run(code).returncode == 143


def test_the_reason_and_the_former_handlers():
    before = signal.getsignal(signal.SIGTERM)
    assert str(Terminated(signal.SIGTERM)) == "ended by SIGTERM"
    assert not issubclass(Terminated, (Exception, SystemExit))  # which own code of users may raise
    with end_on_signals():
        assert signal.getsignal(signal.SIGTERM) is not before
    assert signal.getsignal(signal.SIGTERM) is before


def test_an_ignored_sighup_stays_ignored():
    former = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with end_on_signals():
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, former)
