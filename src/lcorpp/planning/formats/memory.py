"""Errors of files that are too large for the memory."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lcorpp.errors import FileError


@contextmanager
def report_full_memory(path: str | Path) -> Iterator[None]:
    """Within this block, a MemoryError becomes a FileError that names the file."""
    try:
        yield
    except MemoryError as error:
        error.__traceback__ = None  # it would keep the arrays of the failed computation
        raise FileError(f"{path}: the memory is full; the content takes more than is free") from None
