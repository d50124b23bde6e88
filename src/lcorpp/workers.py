"""Worker processes that leave Ctrl-C to their parent process."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def ignore_sigint() -> Iterator[None]:
    """Ignore SIGINT while worker processes start, so that they inherit this setting.

    The parent process ignores SIGINT meanwhile, too: a Ctrl-C in the fraction of a second in which workers
    start is lost. (A blocked signal would not be lost, but the
    resource trackers of multiprocessing and loky unblock it.)
    """
    if threading.current_thread() is not threading.main_thread():  # only the main thread sets handlers
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def delay_sigint() -> Iterator[None]:
    """Raise the KeyboardInterrupt of a Ctrl-C at the end of the block, so that the block is done or not."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived = list[int]()
    before = signal.signal(signal.SIGINT, lambda number, _: arrived.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if arrived:
        raise KeyboardInterrupt
