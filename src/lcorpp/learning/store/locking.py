"""One writer at a time: a lock that the operating system gives up when its process ends, however it ends."""

from __future__ import annotations

import os
import weakref
from typing import Any, Protocol

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

GUARDED = fcntl is not None
"""Whether a second writer is noticed on this system."""


class Closable(Protocol):
    def close(self) -> None: ...


_open: weakref.WeakSet[Any] = weakref.WeakSet()


def lock(file: int) -> bool:
    """Lock an open file for this process; False where another one, or this one, has it open for writing.

    The lock (flock) belongs to the open file, so it ends with the process that holds it and never outlives
    a crash. It is advice that only other stores heed. On NFS it needs a lock server, which Linux has.
    """
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def close_in_children(store: Closable) -> None:
    """See to it that a forked child does not keep the file, and with it the lock, when its parent is gone."""
    _open.add(store)


def _close_all() -> None:
    for store in list(_open):
        store.close()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_close_all)
