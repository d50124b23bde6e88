"""Checks of output files and folders before a long computation."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from lcorpp.errors import FileError, expected_one_of
from lcorpp.files import FIGURE_SUFFIXES


def check_writable(path: Path) -> None:
    """Reject an output file that cannot be written.

    Raises:
        FileError: its folder is missing or not writable, or the path is a folder.
    """
    folder = Path(os.path.realpath(path)).parent
    if path.is_dir():
        reason = "Is a directory"
    elif folder.exists() and not folder.is_dir():
        reason = f"{path.parent} is a file"
    elif not folder.exists():
        reason = f"there is no folder {path.parent}"
    elif not os.access(folder, os.W_OK):
        reason = "Permission denied"
    else:
        return
    raise FileError(f"{path}: cannot be written: {reason}")


def check_results(out: Path | None, formats: Sequence[str] | None) -> None:
    """Reject a folder of results (--out) that cannot be created or written to; it may be missing.

    Raises:
        FileError: the path or a parent is a file, the nearest existing folder is not writable, or there are
            formats of figures (--format) and no folder.
    """
    if out is None:
        if formats:
            raise FileError("--format is for the figures in --out; without --out none is drawn")
        return
    if out.exists() and not out.is_dir():
        raise FileError(f"{out}: is a file; --out expects a folder")
    existing = Path(os.path.realpath(out))
    while not existing.exists():
        existing = existing.parent
    if not existing.is_dir():
        raise FileError(f"{out}: cannot be created: {existing} is a file")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise FileError(f"{out}: cannot be written: Permission denied")


def check_figure(path: Path, *, also: Sequence[str] = ()) -> None:
    """Reject a figure file that cannot be written, or whose suffix is neither a figure's nor in `also`.

    Raises:
        FileError: the suffix is another one, or the file cannot be written.
    """
    suffixes = (*FIGURE_SUFFIXES, *also)
    if path.suffix.lower() not in suffixes:
        raise FileError(f"{path}: not a figure file; {expected_one_of(suffixes)} at its end")
    check_writable(path)
