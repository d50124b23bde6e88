"""Read and write files with typed errors and limits; writes are atomic."""

from __future__ import annotations

import codecs
import io
import os
from collections.abc import Container, Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import chain
from typing import TYPE_CHECKING, BinaryIO, TextIO

from lcorpp.errors import FileError
from lcorpp.input_files import (
    describe_reason,
    format_path,
    is_utf16,
    keep_pipes as keep_pipes,
    make_nul_error,
    make_read_error,
    make_size_error,
    open_input,
    open_lines,
)

if TYPE_CHECKING:
    import mmap
    from pathlib import Path

PARQUET_SUFFIXES = (".parquet", ".pq")
"""Names of Parquet files."""

FIGURE_SUFFIXES = (".png", ".svg", ".pdf")
"""Supported formats of figures."""

MAX_TEXT_BYTES = 2**26
"""Maximum of `read_text`, unless the reader of a format chooses another one."""

MAX_BYTES = 2**32
"""Maximum of `read_bytes`, unless the reader of a format chooses another one."""

MAX_MAPPED_BYTES = 2**36
"""Maximum of `map_text` and `open_text`, of which a part is in memory."""

_BLOCK_BYTES = 2**20


def read_text(path: str | Path, max_bytes: int = MAX_TEXT_BYTES) -> str:
    """Return the text of a file with its line endings unchanged; encodings as in `open_text`.

    Raises:
        FileError: the file is missing, unreadable, a folder, a device, larger than `max_bytes` or not text.
    """
    return _decode(path, read_bytes(path, max_bytes))


def map_text(path: str | Path, *, comment: bytes = b"") -> bytes | mmap.mmap:
    """Return the text of a file in UTF-8, possibly with a byte order mark.

    The content of a regular file is mapped into memory: the system reads the parts that are used and may drop
    them again, so a large file needs little memory. Encodings as in `open_text`.

    Args:
        comment: begins a comment, up to the end of its line, which may have bytes of another encoding.

    Raises:
        FileError: the file is missing, unreadable, a folder, a device or not text.
    """
    import mmap

    with open_input(path, MAX_MAPPED_BYTES) as file:
        try:
            start = file.read(2)
            file.seek(0)
            if is_utf16(start) or not os.fstat(file.fileno()).st_size:
                return _decode(path, _read_all(path, file, MAX_TEXT_BYTES)).encode()
            _check_text(path, file, comment)
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except OSError as error:
            raise make_read_error(path, describe_reason(error)) from None


def read_bytes(path: str | Path, max_bytes: int = MAX_BYTES) -> bytes:
    """Return the content of a file.

    Raises:
        FileError: the file is missing, unreadable, a folder, a device or larger than `max_bytes`.
    """
    with open_input(path, max_bytes) as file:
        return _read_all(path, file, max_bytes)


def _read_all(path: str | Path, file: BinaryIO, max_bytes: int) -> bytes:
    try:
        if os.fstat(file.fileno()).st_size:
            return file.read()
        blocks, size = [], 0  # the system's files state no size
        while block := file.read(_BLOCK_BYTES):
            blocks.append(block)
            size += len(block)
            if size > max_bytes:
                raise make_size_error(path, max_bytes)
        return b"".join(blocks)
    except OSError as error:
        raise make_read_error(path, describe_reason(error)) from None


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
        FileError: the file is missing, unreadable, a folder or a device; reading it raises FileError at a NUL
            byte or in a line that is too long, and may raise UnicodeDecodeError, see `locate_bad_byte`.
    """
    file = open_lines(path, MAX_MAPPED_BYTES)
    try:
        return io.TextIOWrapper(file, encoding=_detect_encoding(file.peek(2)))
    except (OSError, FileError) as error:
        file.close()
        if isinstance(error, FileError):
            raise
        raise make_read_error(path, describe_reason(error)) from None


def locate_bad_byte(path: str | Path) -> FileError:
    """Return the error for a file whose reading raised UnicodeDecodeError: the line of its first bad byte."""
    with open_input(path, MAX_MAPPED_BYTES) as file:
        return _locate_bad_byte(path, file)


def has_matplotlib() -> bool:
    """Whether figures can be drawn: with the extra `plots`."""
    return find_spec("matplotlib") is not None


def choose_formats(formats: Sequence[str] | None, default: Sequence[str]) -> Sequence[str]:
    """Return the formats of figures, e.g. "png": those given, or the default ones; none without matplotlib.

    Raises:
        FileError: formats are given, and matplotlib is not installed.
    """
    if formats:
        check_matplotlib()
    if formats is None:
        return default if has_matplotlib() else ()
    return formats


def check_matplotlib() -> None:
    """Check before a figure is computed that it can be drawn.

    Raises:
        FileError: matplotlib is not installed.
    """
    if not has_matplotlib():
        raise FileError("figures need matplotlib, which is not installed: pip install 'lcorpp[plots]'")


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
        raise FileError(f"{format_path(path)}: cannot be written: {describe_reason(error)}") from None
    if special:  # replacing a device would destroy it; opening a folder fails
        try:
            with open(target, "wb") as device:
                yield device
        except OSError as error:
            raise FileError(f"{path}: cannot be written: {describe_reason(error)}") from None
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
        raise FileError(f"{path}: cannot be written: {describe_reason(error)}") from None
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
        raise FileError(f"{format_path(path)}: cannot create the folder: {describe_reason(error)}") from None
    return Path(path)


def _decode(path: str | Path, data: bytes) -> str:
    if 0 in data and not is_utf16(data):
        raise make_nul_error(path, 1 + data[: data.index(0)].count(b"\n"))
    try:
        return data.decode(_detect_encoding(data))
    except UnicodeDecodeError:
        raise _locate_bad_byte(path, io.BytesIO(data)) from None


def _detect_encoding(start: bytes) -> str:
    return "utf-16" if is_utf16(start) else "utf-8-sig"


def _check_text(path: str | Path, file: BinaryIO, comment: bytes) -> None:
    """Raise a FileError at the first NUL byte, or byte that is not UTF-8 and in no comment."""
    decoder, is_utf8, lines = codecs.getincrementaldecoder("utf-8")(), True, 1
    while block := file.read(_BLOCK_BYTES):
        if 0 in block:
            raise make_nul_error(path, lines + block[: block.index(0)].count(b"\n"))
        lines += block.count(b"\n")
        try:
            decoder.decode(block)
        except UnicodeDecodeError:
            is_utf8 = False
            decoder.reset()
    try:
        decoder.decode(b"", final=True)
    except UnicodeDecodeError:
        is_utf8 = False
    if not is_utf8:
        file.seek(0)
        found = _find_bad_byte(file, comment)
        if found is not None:
            raise _make_bad_byte_error(path, *found)


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
