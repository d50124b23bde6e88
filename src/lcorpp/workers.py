"""Handlers of Ctrl-C for the duration of a block; worker processes leave it to their parent process."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


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
