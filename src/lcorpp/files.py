"""Reading and writing files so that failures are typed and nothing is ever half written."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

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


def write_atomically(path: str | Path, content: str | bytes) -> None:
    """Write a file whole or not at all: to a temporary file beside it, then rename.

    A link is followed, so that what it points to is written; a device or a pipe is written to as it is.

    Raises:
        FileError: the folder is missing or cannot be written, or `path` is a folder.
    """
    data = content.encode("utf-8") if isinstance(content, str) else content
    try:
        target = Path(os.path.realpath(path))
        if target.exists() and not target.is_file():
            target.write_bytes(data)  # to replace a device would destroy it; a folder refuses
            return
        handle, name = tempfile.mkstemp(prefix=f".{target.name[:100]}.", suffix=".part", dir=target.parent)
    except (OSError, ValueError) as error:
        raise FileError(f"{_shown(path)}: cannot be written: {_reason(error)}") from None
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
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
