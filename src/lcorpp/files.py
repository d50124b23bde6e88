"""Read and write files with typed errors; writes are atomic."""

from __future__ import annotations

import codecs
import io
import os
import stat
from collections.abc import Container, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from itertools import chain
from typing import TYPE_CHECKING, BinaryIO, TextIO

from lcorpp.errors import FileError

if TYPE_CHECKING:
    import mmap
    from pathlib import Path

FIGURE_SUFFIXES = (".png", ".svg", ".pdf")
"""Supported formats of figures."""


_BLOCK_BYTES = 2**20

_pipes: ContextVar[tuple[ExitStack, dict[str, str]] | None] = ContextVar("pipes", default=None)


@contextmanager
def keep_pipes() -> Iterator[None]:
    """Within this block, `open_text` can open a pipe several times: the first one copies it to a file."""
    if _pipes.get() is not None:  # an outer block keeps them
        yield
        return
    with ExitStack() as stack:
        token = _pipes.set((stack, {}))
        try:
            yield
        finally:
            _pipes.reset(token)


def read_text(path: str | Path) -> str:
    """Return the text of a file with its line endings unchanged; encodings as in `open_text`.

    Raises:
        FileError: the file is missing, unreadable, a folder or not text.
    """
    return _decode(path, read_bytes(path))


def map_text(path: str | Path, *, comment: bytes = b"") -> bytes | mmap.mmap:
    """Return the text of a file in UTF-8, possibly with a byte order mark.

    The content of a regular file is mapped into memory: the system reads the parts that are used and may drop
    them again, so a large file needs little memory. Encodings as in `open_text`.

    Args:
        comment: begins a comment, up to the end of its line, which may have bytes of another encoding.

    Raises:
        FileError: the file is missing, unreadable, a folder or not text.
    """
    import mmap

    try:
        with open(_copy_pipe(path), "rb") as file:
            encoding = _detect_encoding(file.peek(2))
            mappable = stat.S_ISREG(os.fstat(file.fileno()).st_mode) and file.peek(1)
            if encoding == "utf-16":
                return _decode(path, file.read()).encode()
            if not mappable:
                data = file.read()
                _check_utf8(path, io.BytesIO(data), comment)
                return data
            _check_utf8(path, file, comment)
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError) as error:
        raise FileError(f"{_make_printable(path)}: cannot be read: {_describe_reason(error)}") from None


def read_bytes(path: str | Path) -> bytes:
    """Return the content of a file.

    Raises:
        FileError: the file is missing, unreadable or a folder.
    """
    try:
        with open(path, "rb") as file:
            return file.read()
    except (OSError, ValueError) as error:
        raise FileError(f"{_make_printable(path)}: cannot be read: {_describe_reason(error)}") from None


def hash_files(folder: Path, suffixes: Container[str]) -> str:
    """Return the SHA-256 of the content of all files with these suffixes in a folder and those below it."""
    import hashlib

    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if path.suffix in suffixes:
            digest.update(path.read_bytes())
    return digest.hexdigest()


def open_text(path: str | Path) -> TextIO:
    """Open a text file for reading line by line; line endings become newlines.

    The encoding is UTF-16 if the file begins with its byte order mark, otherwise UTF-8.
    A pipe has its content once; see `keep_pipes`.

    Raises:
        FileError: the file is missing, unreadable or a folder. Reading it may raise UnicodeDecodeError, see
            `locate_bad_byte`.
    """
    try:
        file = open(_copy_pipe(path), "rb")  # noqa: SIM115
        return io.TextIOWrapper(file, encoding=_detect_encoding(file.peek(2)))
    except (OSError, ValueError) as error:
        raise FileError(f"{_make_printable(path)}: cannot be read: {_describe_reason(error)}") from None


def locate_bad_byte(path: str | Path) -> FileError:
    """Return the error for a file whose reading raised UnicodeDecodeError: the line of its first bad byte."""
    with open(_copy_pipe(path), "rb") as file:
        return _locate_bad_byte(path, file)


def write_atomically(path: str | Path, content: str | bytes) -> None:
    """Write a file completely or not at all; see `open_atomically`.

    Raises:
        FileError: the folder is missing or cannot be written, or `path` is a folder.
    """
    with open_atomically(path) as file:
        file.write(content.encode("utf-8") if isinstance(content, str) else content)


@contextmanager
def open_atomically(path: str | Path) -> Iterator[BinaryIO]:
    """Open a file for writing that appears completely or not at all.

    The content goes to a temporary file in the same folder, which replaces `path` at the end. A symbolic
    link is followed: its target is replaced. Devices and pipes are written directly.

    Raises:
        FileError: the folder is missing or cannot be written, or `path` is a folder.
    """
    import tempfile  # this and pathlib take longer to load than to read a file
    from pathlib import Path

    try:
        target = Path(os.path.realpath(path))
        special = target.exists() and not target.is_file()
        if not special:
            prefix = f".{target.name[:100]}."
            handle, name = tempfile.mkstemp(prefix=prefix, suffix=".part", dir=target.parent)
    except (OSError, ValueError) as error:
        raise FileError(f"{_make_printable(path)}: cannot be written: {_describe_reason(error)}") from None
    if special:  # replacing a device would destroy it; opening a folder fails
        try:
            with open(target, "wb") as device:
                yield device
        except OSError as error:
            raise FileError(f"{path}: cannot be written: {_describe_reason(error)}") from None
        return
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        set_default_mode(name)
        os.replace(name, target)
    except OSError as error:
        Path(name).unlink(missing_ok=True)
        raise FileError(f"{path}: cannot be written: {_describe_reason(error)}") from None
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def set_default_mode(path: str | Path) -> None:
    """Give a file that was created as a private temporary file the permissions of any new file."""
    mask = os.umask(0)
    os.umask(mask)
    os.chmod(path, 0o666 & ~mask)


def sync_folder(path: str | Path) -> None:
    """Flush the folder entry of a file that was created or renamed to the disk.

    Does nothing if the system cannot open folders (Windows), which needs no such flush.
    """
    try:
        folder = os.open(os.path.dirname(os.path.realpath(path)), os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(folder)
    except OSError:
        return  # a file system without folders on a disk
    finally:
        os.close(folder)


def make_folder(path: str | Path) -> Path:
    """Create a folder and its parents if it does not exist.

    Raises:
        FileError: the folder cannot be created, e.g. because a file has its name.
    """
    from pathlib import Path

    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise FileError(
            f"{_make_printable(path)}: cannot create the folder: {_describe_reason(error)}"
        ) from None
    return Path(path)


def _copy_pipe(path: str | Path) -> str | Path:
    """Return the path of the copy of a pipe; of any other file, and without `keep_pipes`, the path itself."""
    kept = _pipes.get()
    if kept is None or not stat.S_ISFIFO(os.stat(path).st_mode):
        return path
    stack, copies = kept
    if str(path) not in copies:
        import shutil
        import tempfile

        with open(path, "rb") as pipe, tempfile.NamedTemporaryFile(delete=False) as copy:
            stack.callback(os.unlink, copy.name)
            shutil.copyfileobj(pipe, copy)
        copies[str(path)] = copy.name
    return copies[str(path)]


def _decode(path: str | Path, data: bytes) -> str:
    try:
        return data.decode(_detect_encoding(data))
    except UnicodeDecodeError:
        raise _locate_bad_byte(path, io.BytesIO(data)) from None


def _detect_encoding(start: bytes) -> str:
    return "utf-16" if start[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8-sig"


def _check_utf8(path: str | Path, file: BinaryIO, comment: bytes) -> None:
    """Raise a FileError at the first byte that is not UTF-8, apart from those in comments."""
    try:
        decoder = codecs.getincrementaldecoder("utf-8")()
        while block := file.read(_BLOCK_BYTES):
            decoder.decode(block)
        decoder.decode(b"", final=True)
    except UnicodeDecodeError:
        file.seek(0)
        found = _find_bad_byte(file, comment)
        if found is not None:
            raise _make_bad_byte_error(path, *found) from None


def _find_bad_byte(lines: Iterable[bytes], comment: bytes = b"") -> tuple[int, int] | None:
    """Return the line number and the value of the first byte that is not UTF-8; None if there is none."""
    import re

    ignored = re.compile(re.escape(comment) + rb"[^\r\n]*") if comment else None
    for number, line in enumerate(lines, start=1):
        text = ignored.sub(b"", line) if ignored else line
        try:
            text.decode()
        except UnicodeDecodeError as error:
            return number, text[error.start]
    return None


def _make_bad_byte_error(path: str | Path, line: int, byte: int) -> FileError:
    letter = f", {chr(byte)!r} in Latin-1" if chr(byte).isprintable() else ""
    return FileError(
        f"{path}:{line}: not UTF-8 text: byte {byte:#04x}{letter}; expected a file saved as UTF-8"
    )


def _locate_bad_byte(path: str | Path, lines: Iterable[bytes]) -> FileError:
    rows = iter(lines)
    first = next(rows, b"")
    found = None if _detect_encoding(first) == "utf-16" else _find_bad_byte(chain([first], rows))
    if found is not None:
        return _make_bad_byte_error(path, *found)
    return FileError(f"{path}: damaged UTF-16 text; expected a file saved as UTF-8")


def _describe_reason(error: OSError | ValueError) -> str:
    """Return the system's message; a ValueError means an impossible file name."""
    return str(getattr(error, "strerror", None) or error)


def _make_printable(path: str | Path) -> str:
    """Return a path for a message: at most 300 characters, in ASCII if it has unprintable ones."""
    text = str(path)
    return text if len(text) <= 300 and text.isprintable() else ascii(text)[:300]
