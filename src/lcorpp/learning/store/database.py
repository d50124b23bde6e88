"""SQLite files of tracks: tables, connections, the writer's lock, and reading in spite of damage."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

from lcorpp.errors import DataError, FileError
from lcorpp.files import sync_folder, write_atomically
from lcorpp.learning.store.records import Row
from lcorpp.learning.store.schema import StoreHeader

APPLICATION_ID, VERSION = 0x6C637472, 2
"""SQLite's `application_id` ("lctr") and `user_version` of a store."""

LEGACY_MAGIC = b"lcorpp tracks "
"""First bytes of a store of version 1, which is not an SQLite file."""

MAX_HEADER = 2**20
"""Bytes at the beginning of a file that may contain the header of version 1."""

TIMEOUT = 60.0
"""Seconds to wait for SQLite's locks, which other processes hold for the time of one transaction."""

TABLES = f"""
PRAGMA application_id = {APPLICATION_ID};
PRAGMA user_version = {VERSION};
CREATE TABLE store (
    identity TEXT NOT NULL CHECK (length(identity) = 32),
    channels TEXT NOT NULL,
    interval REAL NOT NULL CHECK (interval > 0),
    classes TEXT NOT NULL,
    points INTEGER CHECK (points >= 2)
);
CREATE TABLE track (
    record INTEGER PRIMARY KEY AUTOINCREMENT,
    id TEXT NOT NULL UNIQUE CHECK (id <> ''),
    group_id TEXT NOT NULL CHECK (group_id <> ''),
    label TEXT,
    source TEXT NOT NULL CHECK (source IN ('person', 'robot')),
    belief TEXT,
    time TEXT NOT NULL,
    context TEXT NOT NULL,
    extra TEXT NOT NULL,
    points INTEGER NOT NULL CHECK (points >= 2),
    trajectory BLOB NOT NULL CHECK (length(trajectory) % (8 * points) = 0),
    crc32 INTEGER NOT NULL
);
CREATE TABLE later_label (
    record INTEGER PRIMARY KEY AUTOINCREMENT,
    track INTEGER NOT NULL REFERENCES track (record),
    label TEXT,
    source TEXT NOT NULL CHECK (source IN ('person', 'robot')),
    belief TEXT,
    time TEXT NOT NULL,
    crc32 INTEGER NOT NULL
);
"""

INSERT_TRACK = f"INSERT INTO track VALUES ({', '.join('?' * 12)})"
INSERT_LABEL = f"INSERT INTO later_label VALUES ({', '.join('?' * 7)})"


def check_is_file(path: Path) -> None:
    """Check that a store can be at `path`: a missing file in an existing folder, or a regular file.

    Raises:
        FileError: `path` is a folder or device, or its folder is missing.
    """
    try:
        if path.exists() and not path.is_file():
            raise FileError(f"{path}: is not a file; a store of tracks is one")
        os.stat(path.parent)
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be opened: {getattr(error, 'strerror', None) or error}") from None


def detect_version(path: Path) -> int:
    """Return the format version of a store; 0 for an empty file.

    Raises:
        FileError: the file cannot be read.
        DataError: the file is not a store, is damaged at its beginning, or has a newer version.
    """
    try:
        if not path.stat().st_size:
            return 0
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True)) as connection:
            (application,) = connection.execute("PRAGMA application_id").fetchone()
            (version,) = connection.execute("PRAGMA user_version").fetchone()
    except sqlite3.DatabaseError:
        return _detect_legacy(path)
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if application != APPLICATION_ID:
        raise DataError(f"{path}: an SQLite file, but not a store of tracks")
    if version != VERSION:
        raise DataError(f"{path}: its version is {version}; this lcorpp reads versions 1 and {VERSION}")
    return VERSION


def _detect_legacy(path: Path) -> int:
    try:
        with path.open("rb") as file:
            start = file.read(MAX_HEADER)
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}") from None
    line = start.rstrip(b"\0")
    if b"\n" not in line and (LEGACY_MAGIC.startswith(line) or line.startswith(LEGACY_MAGIC)):
        return 0  # the header that an interrupted process began to write
    if LEGACY_MAGIC in start:
        return 1
    if start.startswith(b"SQLite format 3\0"):
        raise DataError(f"{path}: an SQLite file whose first page is damaged")
    raise DataError(f"{path}: not a store of tracks")


def write_store(
    path: Path, header: StoreHeader, tracks: Iterable[Row] = (), labels: Iterable[Row] = ()
) -> None:
    """Write a new store with the given rows, whole or not at all, in place of the file at `path`.

    Raises:
        FileError: the file cannot be written.
    """
    schema = header.schema
    names = json.dumps(schema.channels), schema.interval, json.dumps(schema.classes), schema.points
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.executescript(TABLES)
        connection.execute("INSERT INTO store VALUES (?, ?, ?, ?, ?)", (header.identity, *names))
        connection.executemany(INSERT_TRACK, tracks)
        connection.executemany(INSERT_LABEL, labels)
        connection.commit()
        content = connection.serialize()
    for suffix in ("-wal", "-shm", "-journal"):  # of a file that was deleted
        Path(f"{os.path.realpath(path)}{suffix}").unlink(missing_ok=True)
    write_atomically(path, content)
    sync_folder(path)


def acquire_lock(path: Path) -> sqlite3.Connection:
    """Lock a store for one writer; closing the connection, or the end of the process, releases the lock.

    The lock is a transaction on the empty file `PATH-lock`, so that it works on every system and is never
    inherited by a child process. The file remains: to delete it while others open it is not safe.

    Raises:
        FileError: another process, or this one, has the lock; or the folder is not writable.
    """
    lock = sqlite3.connect(
        f"{os.path.realpath(path)}-lock", timeout=0, isolation_level=None, check_same_thread=False
    )
    try:
        lock.execute("BEGIN IMMEDIATE")
    except sqlite3.Error as error:
        lock.close()
        if error.sqlite_errorcode == sqlite3.SQLITE_BUSY:
            raise FileError(
                f"{path}: is being written to already, by another process or by this one; a store has one"
                " writer at a time, readers are not affected"
            ) from None
        raise FileError(f"{path}: cannot be locked for writing: {error}") from None
    return lock


def connect_writer(path: Path) -> sqlite3.Connection:
    """Open a store for writing with a write-ahead log.

    Raises:
        sqlite3.Error: SQLite cannot open the file.
    """
    connection = _connect(path, "mode=rw")
    try:
        for pragma in (
            "journal_mode = WAL",
            "synchronous = FULL",
            "foreign_keys = ON",
            "fullfsync = ON",  # macOS; without effect elsewhere
            "checkpoint_fullfsync = ON",
        ):
            connection.execute(f"PRAGMA {pragma}")
    except BaseException:
        connection.close()
        raise
    return connection


def connect_reader(path: Path) -> sqlite3.Connection:
    """Open a store for reading, as of one moment: a transaction that sees no later writes.

    A store that is not open elsewhere can be read from a read-only folder.

    Raises:
        sqlite3.Error: SQLite cannot open the file.
    """
    connection = _connect(path, "mode=rw")
    try:
        connection.execute("SELECT 1 FROM sqlite_master").fetchone()
    except sqlite3.OperationalError:
        connection.close()
        if Path(f"{os.path.realpath(path)}-wal").exists():
            raise
        connection = _connect(path, "immutable=1")
    except BaseException:
        connection.close()
        raise
    for pragma in ("query_only = ON", "writable_schema = ON"):  # the second accepts a truncated file
        connection.execute(f"PRAGMA {pragma}")
    connection.execute("BEGIN")
    return connection


def _connect(path: Path, mode: str) -> sqlite3.Connection:
    connection = sqlite3.connect(
        f"{path.absolute().as_uri()}?{mode}",
        uri=True,
        timeout=TIMEOUT,
        isolation_level=None,
        check_same_thread=False,
    )
    connection.text_factory = lambda text: text.decode(errors="replace")
    return connection
