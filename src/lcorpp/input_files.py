"""Open files for reading, with limits: regular files of a size, and pipes of a size and a time."""

from __future__ import annotations

import codecs
import io
import os
import stat
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from time import monotonic
from typing import TYPE_CHECKING, BinaryIO

from lcorpp.errors import FileError

if TYPE_CHECKING:
    from pathlib import Path

    from _typeshed import WriteableBuffer

MAX_PIPE_BYTES = 2**30
"""Maximum content of a pipe, which is copied to a temporary file."""

MAX_WAIT_SECONDS = 10.0
"""A named pipe needs a writer within this time."""

MAX_SILENCE_SECONDS = 30.0
"""The writer of a pipe needs to continue or to end within this time."""

MAX_LINE_BYTES = 2**27
"""Maximum length of a line of a text file that is read line by line."""

_BLOCK_BYTES = 2**20

_pipes: ContextVar[tuple[ExitStack, dict[str, str]] | None] = ContextVar("pipes", default=None)


@contextmanager
def keep_pipes() -> Iterator[None]:
    """Within this block, a pipe can be opened several times: the first one copies it to a file."""
    if _pipes.get() is not None:  # an outer block keeps them
        yield
        return
    with ExitStack() as stack:
        token = _pipes.set((stack, {}))
        try:
            yield
        finally:
            _pipes.reset(token)


def open_input(path: str | Path, max_bytes: int) -> BinaryIO:
    """Open a regular file for reading, or the copy of a pipe.

    Args:
        max_bytes: maximum of the size.

    Raises:
        FileError: the file is missing, unreadable, a folder, a device or too large; or a pipe has no writer,
            or one that neither writes nor ends.
    """
    copies = _pipes.get()
    if copies is not None and str(path) in copies[1]:
        return open(copies[1][str(path)], "rb")
    try:
        # opening a pipe would wait for its writer
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except (OSError, ValueError) as error:
        raise make_read_error(path, describe_reason(error)) from None
    with ExitStack() as stack:
        stack.callback(os.close, handle)
        kind = os.fstat(handle)
        if stat.S_ISFIFO(kind.st_mode):
            return _copy_pipe(path, handle, min(max_bytes, MAX_PIPE_BYTES))
        if stat.S_ISDIR(kind.st_mode):
            raise make_read_error(path, "Is a directory")
        if not stat.S_ISREG(kind.st_mode):
            raise make_read_error(path, "it is a device; expected a file or a pipe")
        if kind.st_size > max_bytes:
            raise make_size_error(path, max_bytes)
        stack.pop_all()
    return os.fdopen(handle, "rb")


def open_lines(path: str | Path, max_bytes: int) -> io.BufferedReader:
    """Open a text file for reading line by line; reading checks what `TextGuard` checks.

    Raises:
        FileError: as `open_input`.
    """
    return io.BufferedReader(TextGuard(open_input(path, max_bytes), path), _BLOCK_BYTES)


class TextGuard(io.RawIOBase):
    """The bytes of a text file; reading raises `FileError` at a NUL byte, or in a line that is too long.

    UTF-16 may have NUL bytes.
    """

    def __init__(self, file: BinaryIO, path: str | Path) -> None:
        self._file, self._path = file, path
        self._line, self._line_bytes = 1, 0
        self._is_utf16: bool | None = None

    def readable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._file.fileno()

    def close(self) -> None:
        self._file.close()
        super().close()

    def readinto(self, buffer: WriteableBuffer) -> int:
        block = self._file.read(len(memoryview(buffer)))
        if self._is_utf16 is None:
            self._is_utf16 = is_utf16(block)
        if not self._is_utf16 and 0 in block:
            raise make_nul_error(self._path, self._line + block[: block.index(0)].count(b"\n"))
        breaks = block.count(b"\n")
        self._line += breaks
        self._line_bytes = len(block) - 1 - block.rfind(b"\n") if breaks else self._line_bytes + len(block)
        if self._line_bytes > MAX_LINE_BYTES:
            raise make_read_error(
                self._path,
                f"line {self._line} is longer than {MAX_LINE_BYTES >> 20} MB; expected a text file",
            )
        memoryview(buffer)[: len(block)] = block
        return len(block)


def is_inside(path: Path, folder: Path) -> bool:
    """Whether a path leads to a place in a folder, after all links of both, or to none."""
    try:
        return path.resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):  # an impossible name, or links in a circle: it cannot be read
        return True


def check_regular(path: str | Path) -> None:
    """Raise `FileError` if a path is neither a regular file nor a folder, for libraries that open it."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError) as error:
        raise make_read_error(path, describe_reason(error)) from None
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise make_read_error(path, "it is a pipe or a device; expected a file")


def starts_with(path: str | Path, start: bytes) -> bool:
    """Whether a regular file begins with these bytes.

    Raises:
        FileError: it cannot be read.
    """
    try:
        with open(path, "rb") as file:
            return file.read(len(start)) == start
    except OSError as error:
        raise make_read_error(path, describe_reason(error)) from None


def is_utf16(start: bytes) -> bool:
    """Whether a text begins with a byte order mark of UTF-16."""
    return start[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def make_nul_error(path: str | Path, line: int) -> FileError:
    """Return the error for a file with a NUL byte."""
    return FileError(f"{format_path(path)}:{line}: not UTF-8 text: a NUL byte; expected a text file")


def make_size_error(path: str | Path, max_bytes: int) -> FileError:
    """Return the error for a file that is too large."""
    limit = f"{max_bytes >> 20} MB" if max_bytes >= 2**20 else f"{max_bytes} bytes"
    return make_read_error(path, f"it is larger than {limit}")


def make_read_error(path: str | Path, reason: str) -> FileError:
    """Return the error for a file that cannot be read."""
    return FileError(f"{format_path(path)}: cannot be read: {reason}")


def describe_reason(error: OSError | ValueError) -> str:
    """Return the system's message; a ValueError means an impossible file name."""
    return str(getattr(error, "strerror", None) or error)


def format_path(path: str | Path) -> str:
    """Return a path for a message: at most 300 characters, in ASCII if it has unprintable ones."""
    text = str(path)
    return text if len(text) <= 300 and text.isprintable() else ascii(text)[:300]


def _copy_pipe(path: str | Path, handle: int, max_bytes: int) -> BinaryIO:
    """Return a temporary file with the content of a pipe; `keep_pipes` keeps it for further calls."""
    import tempfile

    kept = _pipes.get()
    with ExitStack() as stack:
        if kept is None:
            copy: BinaryIO = stack.enter_context(tempfile.TemporaryFile())
        else:
            copy = stack.enter_context(tempfile.NamedTemporaryFile(delete=False))  # type: ignore[assignment]
            kept[0].callback(os.unlink, copy.name)
        size = 0
        for block in _read_pipe(path, handle):
            size += len(block)
            if size > max_bytes:
                raise make_size_error(path, max_bytes)
            copy.write(block)
        copy.flush()
        copy.seek(0)
        if kept is not None:
            kept[1][str(path)] = copy.name
            return open(copy.name, "rb")
        stack.pop_all()
        return copy


def _read_pipe(path: str | Path, handle: int) -> Iterator[bytes]:
    """Yield the content of a pipe that was opened without waiting, until its writers end."""
    import select

    started = not _has_name(path)  # a pipe of the shell has a writer, or had one
    deadline = monotonic() + (MAX_SILENCE_SECONDS if started else MAX_WAIT_SECONDS)
    while True:
        try:
            block = os.read(handle, _BLOCK_BYTES)
        except BlockingIOError:  # there is a writer
            if not started:
                started, deadline = True, monotonic() + MAX_SILENCE_SECONDS
            block = b""
        else:
            if not block and started:
                return
        if block:
            yield block
            started, deadline = True, monotonic() + MAX_SILENCE_SECONDS
            continue
        rest = deadline - monotonic()
        if rest <= 0:
            if started:
                raise make_read_error(
                    path, f"the writer of this pipe writes nothing for {MAX_SILENCE_SECONDS:g} s"
                )
            raise make_read_error(path, f"this pipe has no writer after {MAX_WAIT_SECONDS:g} s")
        poll = select.poll()
        poll.register(handle, select.POLLIN)
        events = poll.poll(1000 * min(rest, 1))
        if events and not events[0][1] & select.POLLIN:  # its writer came and ended
            return


def _has_name(path: str | Path) -> bool:
    try:
        return stat.S_ISFIFO(os.lstat(os.path.realpath(path)).st_mode)
    except OSError:  # e.g. pipe:[123]
        return False
