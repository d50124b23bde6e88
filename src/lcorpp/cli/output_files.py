"""Checks of output files and folders before a long computation, and the lock of a folder of results."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from lcorpp.cli import console
from lcorpp.errors import FileError, expected_one_of
from lcorpp.files import FIGURE_SUFFIXES, check_matplotlib, has_matplotlib, make_folder

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]


def check_writable(path: Path) -> None:
    """Reject an output file that cannot be written.

    Raises:
        FileError: its folder is missing or not writable, its disk is full, or the path is a folder.
    """
    try:
        target = Path(os.path.realpath(path))
        if target.exists() and not target.is_file() and not target.is_dir():  # a device or a pipe
            if not os.access(target, os.W_OK):
                raise PermissionError(0, "Permission denied")
            return
        reason = _find_fault(path, target.parent)
        if reason is None:
            with suppress(FileNotFoundError):
                os.lstat(target)  # the name may be too long
            _write_a_byte(target.parent)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
    if reason is not None:
        raise FileError(f"{str(path)[:300]}: cannot be written: {reason}")


def _find_fault(path: Path, folder: Path) -> str | None:
    """Return why a file cannot be written to a folder, or None."""
    if path.is_dir():
        return "Is a directory"
    if not folder.exists():
        return f"there is no folder {path.parent}"
    return None if folder.is_dir() else f"{path.parent} is a file"


def _write_a_byte(folder: Path) -> None:
    """Write a file without a name into a folder; an OSError says why that is impossible."""
    with tempfile.TemporaryFile(dir=folder) as file:
        file.write(b"x")
        file.flush()


@contextmanager
def lock_results(out: Path | None, formats: Sequence[str] | None) -> Iterator[None]:
    """Create a folder of results (--out), check that it can be written, and lock it for the block.

    The system ends the lock with the process, however it ends. A new folder is removed if it stays empty.
    A note says that there are no figures if matplotlib is not installed.
    Without a folder there is nothing to do. On Windows, and on a file system without locks, there is no lock.

    Raises:
        FileError: another process has the lock, the folder cannot be created or written to, or there are
            formats of figures (--format) and no folder or no matplotlib.
    """
    if out is None:
        if formats:
            raise FileError("--format is for the figures in --out; without --out none is drawn")
        yield
        return
    if formats:
        check_matplotlib()
    if not has_matplotlib():
        console.print_note("no figures are drawn; they need the extra lcorpp[plots]")
    is_new = _check_folder(out)
    lock = _lock(out)
    try:
        try:
            _write_a_byte(out)
        except OSError as error:
            raise FileError(f"{out}: cannot be written: {error.strerror or error}") from None
        yield
    finally:
        if is_new:
            with suppress(OSError):  # it has results
                out.rmdir()
        if lock is not None:
            os.close(lock)


def _check_folder(out: Path) -> bool:
    """Return whether a folder of results is missing; raise FileError if it cannot be created."""
    try:
        if out.exists() and not out.is_dir():
            raise FileError(f"{out}: is a file; --out expects a folder")
        existing = next(folder for folder in (out, *out.absolute().parents) if folder.exists())
    except OSError as error:
        raise FileError(f"{str(out)[:300]}: cannot be created: {error.strerror or error}") from None
    if not existing.is_dir():
        raise FileError(f"{out}: cannot be created: {existing} is a file")
    return existing != out


def _lock(out: Path) -> int | None:
    """Create and lock a folder; return the open folder, which has the lock, or None without locks."""
    while True:
        make_folder(out)
        if fcntl is None:
            return None
        try:
            folder = os.open(out, os.O_RDONLY)
        except FileNotFoundError:  # its process has removed it, as it was new and empty
            continue
        except OSError:
            return None
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if os.path.samestat(os.fstat(folder), os.stat(out)):
                return folder
        except BlockingIOError:
            os.close(folder)
            raise FileError(
                f"{out}: another process writes its results there; expected another folder, or its end"
            ) from None
        except FileNotFoundError:
            pass
        except OSError:
            os.close(folder)
            return None
        os.close(folder)


def check_figure(path: Path, *, also: Sequence[str] = ()) -> None:
    """Reject a figure file that cannot be written, or whose suffix is neither a figure's nor in `also`.

    Raises:
        FileError: the suffix is another one, the file cannot be written, or matplotlib is not installed.
    """
    suffixes = (*FIGURE_SUFFIXES, *also)
    if path.suffix.lower() not in suffixes:
        raise FileError(f"{path}: not a figure file; {expected_one_of(suffixes)} at its end")
    if path.suffix.lower() in FIGURE_SUFFIXES:
        check_matplotlib()
    check_writable(path)
