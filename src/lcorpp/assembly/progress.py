"""Displays of the progress of long steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol

Advance = Callable[[int, int], None]
"""A function that takes the completed and the total number of parts of a step."""


class ProgressDisplay(Protocol):
    """A display of one long step at a time, as a context: it yields an `Advance`."""

    def __call__(self, title: str, total: int | None = None, /) -> AbstractContextManager[Advance]: ...


def show_nothing(done: int, total: int) -> None:
    """Ignore the completed parts of a step."""


@contextmanager
def no_progress(title: str, total: int | None = None, /) -> Iterator[Advance]:
    """Display nothing."""
    yield show_nothing
