"""Worker processes that leave Ctrl-C to the process that started them."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def sheltered() -> Iterator[None]:
    """Start worker processes inside of this: they ignore Ctrl-C, from their very first import on.

    A new process goes on ignoring what its parent ignored. So does the parent itself meanwhile: a Ctrl-C in
    the fraction of a second in which workers start has to be given again. (Blocking the signal would lose
    none, but the resource trackers of multiprocessing and loky unblock it.)
    """
    if threading.current_thread() is not threading.main_thread():  # only there handlers can be set
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
