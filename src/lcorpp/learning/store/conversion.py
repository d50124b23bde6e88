"""Replace the file of a store: convert version 1, or rebuild a damaged file from its readable records."""

from __future__ import annotations

import logging
import os
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

from lcorpp.errors import FileError
from lcorpp.files import sync_folder
from lcorpp.learning.store.contents import Contents, iterate_rows
from lcorpp.learning.store.database import connect_reader, write_store
from lcorpp.learning.store.legacy import read_legacy

LOG = logging.getLogger("lcorpp.learning")


def convert(path: Path) -> None:
    """Convert a store of version 1 to SQLite and log a warning; the original stays as `PATH.old`.

    The caller has the writer's lock.

    Raises:
        FileError, DataError: as `read_legacy`; or the folder is not writable.
    """
    header, tracks, labels = read_legacy(path)
    backup = _back_up(path, "old")
    write_store(path, header, tracks, labels)
    LOG.warning(
        "%s: converted from version 1 to SQLite, %d records; the original is %s",
        path,
        len(tracks) + len(labels),
        backup.name,
    )


def rebuild(path: Path, contents: Contents) -> str:
    """Write the readable records of a damaged file to a new one; the original stays as `PATH.damaged`.

    The caller has the writer's lock.

    Returns:
        What was done, as a sentence.

    Raises:
        FileError: another process reads the file, or the folder is not writable.
    """
    _leave_wal(path)
    backup = _back_up(path, "damaged")
    tables = []
    with closing(connect_reader(backup)) as connection:
        for table in ("track", "later_label"):
            rows = iterate_rows(connection, table, contents.last)
            tables.append([row for row in rows if row[0] in contents.readable])
    write_store(path, contents.header, *tables)
    return f"the readable records are in a new file; the damaged one is {backup.name}"


def _leave_wal(path: Path) -> None:
    """Move everything from the write-ahead log to the main file; it fails if a reader is active."""
    try:
        with closing(sqlite3.connect(path, timeout=0)) as connection:
            (mode,) = connection.execute("PRAGMA journal_mode = DELETE").fetchone()
    except sqlite3.DatabaseError as error:
        raise FileError(f"{path}: is damaged and cannot be rebuilt now: {error}") from None
    if mode != "delete":
        raise FileError(f"{path}: is damaged and cannot be rebuilt while another process reads it")


def _back_up(path: Path, suffix: str) -> Path:
    """Give the file a second name, or copy it where the file system has no links; return that name."""
    path = Path(os.path.realpath(path))
    number = 1
    while (backup := path.with_name(f"{path.name}.{suffix}{'' if number == 1 else f'-{number}'}")).exists():
        number += 1
    try:
        try:
            os.link(path, backup)
        except OSError:
            shutil.copy2(path, backup)
    except OSError as error:
        raise FileError(f"{backup}: cannot be written: {error.strerror}") from None
    sync_folder(backup)
    return backup
