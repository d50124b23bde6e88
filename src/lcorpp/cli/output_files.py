"""Checks of output files and folders before a long computation."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from lcorpp.errors import FileError, expected_one_of

FIGURE_SUFFIXES = (".png", ".svg", ".pdf")
"""The same as `lcorpp.plot_style.SUFFIXES`, without loading matplotlib."""


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


def check_folder(path: Path) -> None:
    """Reject an output folder that cannot be created or written to; it may be missing.

    Raises:
        FileError: the path or a parent is a file, or the nearest existing folder is not writable.
    """
    if path.exists() and not path.is_dir():
        raise FileError(f"{path}: is a file; --out expects a folder")
    existing = Path(os.path.realpath(path))
    while not existing.exists():
        existing = existing.parent
    if not existing.is_dir():
        raise FileError(f"{path}: cannot be created: {existing} is a file")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise FileError(f"{path}: cannot be written: Permission denied")


def check_formats(out: Path | None, formats: Sequence[str] | None) -> None:
    """Reject formats of figures without a folder for them.

    Raises:
        FileError: there are formats and no folder.
    """
    if formats and out is None:
        raise FileError("--format is for the figures in --out; without --out none is drawn")


def check_figure(path: Path, *others: str) -> None:
    """Reject a figure file that cannot be written, or has another suffix.

    Args:
        others: further suffixes that are accepted.

    Raises:
        FileError: the suffix is none of a figure, or the file cannot be written.
    """
    suffixes = (*FIGURE_SUFFIXES, *others)
    if path.suffix.lower() not in suffixes:
        raise FileError(f"{path}: not a figure file; {expected_one_of(suffixes)} at its end")
    check_writable(path)
