"""SQLite files of tracks: tables, connections, the writer's lock, and reading in spite of damage."""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Collection, Iterator, Sequence
from contextlib import closing, suppress
from pathlib import Path

from lcorpp.errors import DataError, FileError
from lcorpp.files import sync_folder, write_atomically
from lcorpp.learning.store.records import Row, TrackSchema, is_intact, with_checksum

APPLICATION_ID, VERSION = 0x6C637472, 2
"""SQLite's `application_id` ("lctr") and `user_version` of a store."""

LEGACY_MAGIC = b"lcorpp tracks "
"""Beginning of both copies of the header of version 1, which is not an SQLite file."""

MAX_HEADER = 2**20
"""Bytes at the beginning of a file that contain the two copies; the first may be damaged."""

TIMEOUT = 60.0
"""Seconds to wait for SQLite's locks, which other processes hold for the time of one transaction."""

TABLES = f"""
PRAGMA application_id = {APPLICATION_ID};
PRAGMA user_version = {VERSION};
CREATE TABLE store (
    identity TEXT NOT NULL, channels TEXT NOT NULL, interval REAL NOT NULL, classes TEXT NOT NULL,
    points INTEGER, crc32 INTEGER NOT NULL
);
CREATE TABLE track (
    record INTEGER PRIMARY KEY AUTOINCREMENT, id TEXT NOT NULL UNIQUE, group_id TEXT NOT NULL,
    context TEXT NOT NULL, extra TEXT NOT NULL, label TEXT, source TEXT NOT NULL, belief TEXT,
    time TEXT NOT NULL, trajectory BLOB NOT NULL, crc32 INTEGER NOT NULL
);
CREATE TABLE later_label (
    record INTEGER PRIMARY KEY AUTOINCREMENT, track INTEGER NOT NULL REFERENCES track (record),
    label TEXT, source TEXT NOT NULL, belief TEXT, time TEXT NOT NULL, crc32 INTEGER NOT NULL
);
"""

LAST_RECORD = """
SELECT coalesce(min(max(CAST(seq AS INTEGER)), page_count * page_size / 32), 0)
FROM sqlite_sequence, pragma_page_count, pragma_page_size
"""
"""Query for the number of the last record that was ever written, of a track or a later label.

A damaged number is limited to the records for which the file has space; each takes more than 32 bytes.
"""

IS_LAST_PLAUSIBLE = """
SELECT coalesce(max(seq), 0) BETWEEN
    max((SELECT coalesce(max(record), 0) FROM track), (SELECT coalesce(max(record), 0) FROM later_label))
    AND (SELECT page_count * page_size / 32 FROM pragma_page_count, pragma_page_size)
FROM sqlite_sequence
"""
"""Query whether no record has a number above the last, and the file has space for so many."""

DEFINITIONS = "SELECT type, name, tbl_name, sql FROM sqlite_master"
"""Query for the definitions of the tables, which repeat the text of `TABLES`."""

LENIENT = ("PRAGMA writable_schema = ON",)
"""Statements with which SQLite opens a file that is cut off or whose definitions of tables are damaged."""

READER = ("PRAGMA query_only = ON", "BEGIN", "SELECT 1 FROM sqlite_master")
"""Statements for reading; the SELECT starts the transaction, which sees no later writes."""


def sibling(path: Path, suffix: str) -> Path:
    """Return the path of a store, without symbolic links, with a suffix, e.g. PATH-wal."""
    return Path(f"{os.path.realpath(path)}{suffix}")


def detect_version(path: Path) -> int | None:
    """Return the format version of a store; 0 for a file without a complete header, None for a missing one.

    The system drops all locks of this process on a file when it closes any descriptor of it; SQLite prevents
    this for its own. Only a file that SQLite does not recognise as a store is therefore opened directly.
    """
    try:
        if not path.exists():
            os.stat(path.parent)
            return None
        if not path.is_file():
            raise FileError(f"{path}: is not a file; a store of tracks is one")
        with suppress(sqlite3.DatabaseError), closing(connect(path, "immutable=1", LENIENT)) as connection:
            application, version = connection.execute(
                "SELECT * FROM pragma_application_id, pragma_user_version"
            ).fetchone()
            if application == APPLICATION_ID:
                if version == VERSION:
                    return VERSION
                raise DataError(
                    f"{path}: its version is {version}; this lcorpp reads versions 1 and {VERSION}"
                )
        with path.open("rb") as file:
            content = file.read(MAX_HEADER)
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    start = content.rstrip(b"\0")
    is_short = len(content) < MAX_HEADER
    if is_short and b"\n" not in start and (LEGACY_MAGIC.startswith(start) or start.startswith(LEGACY_MAGIC)):
        return 0  # empty, or the header that an interrupted process of version 1 began to write
    if LEGACY_MAGIC in content:
        return 1
    kind = "an SQLite file, but " if content.startswith(b"SQLite format 3\0") else ""
    raise DataError(f"{path}: {kind}not a store of tracks, or its first page is damaged")


def write_store(
    path: Path, identity: str, schema: TrackSchema, tracks: Collection[Row] = (), labels: Collection[Row] = ()
) -> None:
    """Write a new store with the given rows, whole or not at all.

    A file at `path` is replaced; nothing in its log is needed any more.
    """
    names = json.dumps(schema.channels), schema.interval, json.dumps(schema.classes), schema.points
    with closing(create_tables()) as connection:
        insert(connection, "store", [with_checksum(identity, *names)])
        insert(connection, "track", tracks)
        insert(connection, "later_label", labels)
        connection.commit()
        content = connection.serialize()
    for suffix in ("-wal", "-shm", "-journal"):
        sibling(path, suffix).unlink(missing_ok=True)
    write_atomically(path, content)
    sync_folder(path)


def create_tables() -> sqlite3.Connection:
    """Return a database in memory with the empty tables of a store."""
    connection = sqlite3.connect(":memory:")
    connection.executescript(TABLES)
    return connection


def insert(connection: sqlite3.Connection, table: str, rows: Collection[Row]) -> None:
    """Insert whole rows into a table."""
    if rows:
        marks = ", ".join("?" * len(next(iter(rows))))
        connection.executemany(f"INSERT INTO {table} VALUES ({marks})", rows)


def read_schema(connection: sqlite3.Connection) -> tuple[str, TrackSchema]:
    """Return the identity and the schema of a store; a DataError or ValueError means damage."""
    (row,) = connection.execute("SELECT * FROM store")
    if not is_intact(row):
        raise DataError("its checksum is wrong")
    identity, channels, interval, classes, points, _ = row
    return identity, TrackSchema(json.loads(channels), interval, json.loads(classes), points)


def iterate_faults(connection: sqlite3.Connection, path: Path) -> Iterator[str]:
    """Describe each fault of the structure of the store at `path`, which `connection` reads leniently."""
    try:
        for (line,) in connection.execute("PRAGMA integrity_check(10)"):
            if line != "ok":
                yield str(line)
        with closing(create_tables()) as whole:
            if not set(whole.execute(DEFINITIONS)) <= set(connection.execute(DEFINITIONS)):
                yield "a definition of its tables is changed"
            if connection.execute(IS_LAST_PLAUSIBLE).fetchone() != (1,):
                yield "the number of its last record is changed"
        connect_reader(path, ()).close()  # an error here: only leniency opens the file
    except sqlite3.DatabaseError as error:
        yield str(error)
    if os.access(path, os.W_OK):
        try:  # like a writer, who may be active; this changes nothing
            connect(path, "mode=rw", ("PRAGMA busy_timeout = 0", "DELETE FROM store WHERE 0")).close()
        except sqlite3.DatabaseError as error:
            if error.sqlite_errorcode == sqlite3.SQLITE_READONLY:  # its header says so, not the system
                yield str(error)


def iterate_rows(connection: sqlite3.Connection, table: str) -> Iterator[Row]:
    """Yield each readable row of a table of records once; after a damaged page, search record by record."""
    query, seen = f"SELECT * FROM {table}", set[int]()
    with suppress(sqlite3.DatabaseError):
        for row in connection.execute(f"{query} ORDER BY record"):
            if row[0] not in seen:  # a damaged pointer can lead to a page twice
                seen.add(row[0])
                yield row
        return
    for record in range(1, read_last_record(connection) + 1):
        if record not in seen:
            with suppress(sqlite3.DatabaseError):
                yield from connection.execute(f"{query} WHERE record = ?", (record,)).fetchall()


def find_tracks(connection: sqlite3.Connection, record: int) -> Iterator[Row]:
    """Yield the row of a track by search and, as the order of the records may be damaged, by reading all."""
    with suppress(sqlite3.DatabaseError):
        yield from connection.execute("SELECT * FROM track WHERE record = ?", (record,)).fetchall()
    yield from (row for row in iterate_rows(connection, "track") if row[0] == record)


def read_last_record(connection: sqlite3.Connection) -> int:
    """Return the number of the last record that was ever written; 0 if it is unreadable."""
    with suppress(sqlite3.DatabaseError):
        return int(connection.execute(LAST_RECORD).fetchone()[0])
    return 0


def acquire_lock(path: Path) -> sqlite3.Connection:
    """Lock a store for one writer; closing the connection, or the end of the process, releases the lock.

    The lock is a transaction on the empty file `PATH-lock`, so that it works on every system and is never
    inherited by a child process. The file remains: to delete it while others open it is not safe.
    """
    lock = sqlite3.connect(sibling(path, "-lock"), timeout=0, isolation_level=None, check_same_thread=False)
    try:
        lock.execute("BEGIN IMMEDIATE")
    except sqlite3.Error as error:
        lock.close()
        if error.sqlite_errorcode == sqlite3.SQLITE_BUSY:
            raise FileError(
                f"{path}: is already being written to, by another process or by this one; a store has one"
                " writer at a time, readers are not affected"
            ) from None
        raise FileError(f"{path}: cannot be locked for writing: {error}") from None
    return lock


def connect(path: Path, options: str, statements: Sequence[str] = ()) -> sqlite3.Connection:
    """Open an SQLite file with options of its URI and execute statements."""
    uri = f"{path.absolute().as_uri()}?{options}"
    connection = sqlite3.connect(
        uri, uri=True, timeout=TIMEOUT, isolation_level=None, check_same_thread=False
    )
    connection.text_factory = lambda text: text.decode(errors="replace")
    try:
        for statement in statements:
            connection.execute(statement).fetchall()
    except BaseException:
        connection.close()
        raise
    return connection


def connect_reader(path: Path, statements: Sequence[str] = LENIENT) -> sqlite3.Connection:
    """Open a store for reading, as of one moment, in the mode that also reads its log.

    In a folder that is read-only this works only while no process has the store open for writing.
    """
    try:
        return connect(path, "mode=rw", (*statements, *READER))
    except sqlite3.OperationalError:
        if sibling(path, "-wal").exists():
            raise
        return connect(path, "immutable=1", (*statements, *READER))
