"""Handlers of signals for the duration of a block: Ctrl-C, and SIGTERM and SIGHUP, which end a process."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

EXIT_SECONDS = 3.0
"""Seconds that a process may take to clean up after a signal that ends it."""


class Terminated(BaseException):
    """A signal that ends the process. It is not a `SystemExit`, which is an error of own code of users.

    code: that of a shell, 128 and the number of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(f"ended by {signal.Signals(number).name}")
        self.code = 128 + number


@contextmanager
def end_on_signals() -> Iterator[None]:
    """Raise `Terminated` for SIGTERM and SIGHUP in the block, so that the process cleans up before it ends.

    A process that has not ended after `EXIT_SECONDS`, e.g. because it computes outside of Python, or that
    receives a second signal, ends without cleaning up. A SIGHUP that is ignored (nohup) stays so. Does
    nothing outside the main thread, which alone may set handlers, and on Windows.
    """
    if threading.current_thread() is not threading.main_thread() or os.name != "posix":
        yield
        return
    arrived = list[int]()

    def end(number: int, _: FrameType | None) -> None:
        if arrived:
            os._exit(128 + number)
        arrived.append(number)
        raise Terminated(number)

    def limit() -> None:
        """End the process some time after the first signal; the handler may wait for the main thread."""
        while received := os.read(reader, 1):
            number = received[0]
            if number in arrived or signal.getsignal(number) is end:
                time.sleep(EXIT_SECONDS)
                os._exit(128 + number)
        os.close(reader)

    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    former_writer = signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    numbers = [n for n in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(n) != signal.SIG_IGN]
    former = {number: signal.signal(number, end) for number in numbers}
    threading.Thread(target=limit, name="signals", daemon=True).start()
    try:
        yield
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(former_writer)
        os.close(writer)


@contextmanager
def handle_sigint(handler: Callable[[int, FrameType | None], object] | signal.Handlers) -> Iterator[None]:
    """Set the handler of SIGINT for the block; do nothing outside the main thread, which alone may set it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def ignore_sigint() -> Iterator[None]:
    """Ignore SIGINT while worker processes start, so that they inherit this setting.

    The parent process ignores SIGINT meanwhile, too: a Ctrl-C in the fraction of a second in which workers
    start is lost. (A blocked signal would not be lost, but the
    resource trackers of multiprocessing and loky unblock it.)
    """
    with handle_sigint(signal.SIG_IGN):
        yield


@contextmanager
def delay_sigint() -> Iterator[None]:
    """Raise the KeyboardInterrupt of a Ctrl-C at the end of the block, so that the block is done or not."""
    arrived = list[int]()
    with handle_sigint(lambda number, _: arrived.append(number)):
        yield
    if arrived:
        raise KeyboardInterrupt
