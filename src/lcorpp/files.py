"""Reading and writing files so that failures are typed and nothing is ever half written."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, TextIO

from lcorpp.errors import FileError


def read_text(path: str | Path) -> str:
    """The UTF-8 text of a file, with its line ends as they are.

    Raises:
        FileError: the file is missing, unreadable, a folder or not UTF-8.
    """
    data = read_bytes(path)
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise FileError(f"{path}:{line}: not UTF-8 text (byte {data[error.start]:#04x})") from None


def read_bytes(path: str | Path) -> bytes:
    """The content of a file.

    Raises:
        FileError: the file is missing, unreadable or a folder.
    """
    try:
        return Path(path).read_bytes()
    except (OSError, ValueError) as error:
        raise FileError(f"{_shown(path)}: cannot be read: {_reason(error)}") from None


def open_text(path: str | Path) -> TextIO:
    """A file of UTF-8 text, to be read line by line; every line ends in a newline, except maybe the last.

    Raises:
        FileError: the file is missing, unreadable or a folder. Reading it may raise UnicodeDecodeError.
    """
    try:
        return open(path, encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        raise FileError(f"{_shown(path)}: cannot be read: {_reason(error)}") from None


def write_atomically(path: str | Path, content: str | bytes) -> None:
    """Write a file whole or not at all; see `written_atomically`.

    Raises:
        FileError: the folder is missing or cannot be written, or `path` is a folder.
    """
    with written_atomically(path) as file:
        file.write(content.encode("utf-8") if isinstance(content, str) else content)


@contextmanager
def written_atomically(path: str | Path) -> Iterator[BinaryIO]:
    """A file to be written piece by piece that is there whole or not at all.

    It is a temporary file beside the one wanted, and renamed when all is written. A link is followed, so
    that what it points to is written; a device or a pipe is written to as it is.

    Raises:
        FileError: the folder is missing or cannot be written, or `path` is a folder.
    """
    try:
        target = Path(os.path.realpath(path))
        special = target.exists() and not target.is_file()
        if not special:
            prefix = f".{target.name[:100]}."
            handle, name = tempfile.mkstemp(prefix=prefix, suffix=".part", dir=target.parent)
    except (OSError, ValueError) as error:
        raise FileError(f"{_shown(path)}: cannot be written: {_reason(error)}") from None
    if special:  # to replace a device would destroy it; a folder refuses
        try:
            with open(target, "wb") as device:
                yield device
        except OSError as error:
            raise FileError(f"{path}: cannot be written: {_reason(error)}") from None
        return
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(name, 0o666 & ~mask)  # mkstemp makes private files; an output is an ordinary one
        os.replace(name, target)
    except OSError as error:
        Path(name).unlink(missing_ok=True)
        raise FileError(f"{path}: cannot be written: {_reason(error)}") from None
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def sync(file: int) -> None:
    """Return when the content of an open file (its descriptor) is on the disk, as far as the system knows.

    Raises:
        OSError: the disk failed; what it holds of the file is not known then.
    """
    os.fsync(file)
    if sys.platform == "darwin":  # there fsync leaves it in the cache of the drive
        import fcntl

        fcntl.fcntl(file, fcntl.F_FULLFSYNC)


def sync_folder(path: str | Path) -> None:
    """Return when the disk knows the name of a file that was just made or renamed.

    Where a folder cannot be opened (Windows), the system sees to it by itself.
    """
    try:
        folder = os.open(Path(os.path.realpath(path)).parent, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(folder)
    except OSError:
        return  # file systems that keep no folders on a disk
    finally:
        os.close(folder)


def make_folder(path: str | Path) -> Path:
    """Make a folder with its parents; an existing one is fine.

    Raises:
        FileError: it cannot be made, for instance because a file has its name.
    """
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise FileError(f"{_shown(path)}: cannot be made a folder: {_reason(error)}") from None
    return Path(path)


def _reason(error: OSError | ValueError) -> str:
    """The system's words; a ValueError is a name that no file can have."""
    return str(getattr(error, "strerror", None) or error)


def _shown(path: str | Path) -> str:
    text = str(path)
    return text if len(text) <= 300 and text.isprintable() else ascii(text)[:300]
