"""Progress of long steps: the interface that a console or a web page implements."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol

Advance = Callable[[int, int], None]
"""A function that takes the completed and the total number of parts of a step."""


class Progress(Protocol):
    """A display of one long step at a time, as a context: it yields an `Advance`."""

    def __call__(self, title: str, total: int | None = None, /) -> AbstractContextManager[Advance]: ...


@contextmanager
def no_progress(title: str, total: int | None = None, /) -> Iterator[Advance]:
    """Display nothing."""
    yield lambda done, total: None
