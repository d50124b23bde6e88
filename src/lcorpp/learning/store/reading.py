"""Read a store: all its intact records, and a description of the damage to the others."""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

from lcorpp.errors import DataError, FileError
from lcorpp.learning.store.conversion import convert
from lcorpp.learning.store.database import (
    acquire_lock,
    connect_reader,
    detect_version,
    iterate_rows,
    read_last_record,
    read_schema,
)
from lcorpp.learning.store.records import StoredTrack, decode_label, decode_track, is_intact
from lcorpp.learning.store.schema import TrackSchema
from lcorpp.learning.store.snapshot import Damage, Snapshot


def read_store(path: str | Path) -> Snapshot:
    """Read a store; this does not disturb a process that writes to it.

    A store of version 1 is converted to SQLite first, with a warning in the log.

    Raises:
        FileError: the file is missing or unreadable.
        DataError: the file is not a store, has a newer version, or its header is damaged.
    """
    path = Path(path)
    version = detect_version(path)
    if version is None:
        raise FileError(f"{path}: cannot be read: no such file")
    if version == 0:
        raise DataError(f"{path}: an empty file; expected a store of tracks")
    if version == 1:
        with closing(acquire_lock(path)):
            if detect_version(path) == 1:  # no other process was faster
                convert(path)
    return load_snapshot(path)


def load_snapshot(path: Path) -> Snapshot:
    """Read and check all records of the SQLite file at `path`.

    Raises:
        DataError: its header is damaged. FileError: SQLite cannot open the file.
    """
    try:
        with closing(connect_reader(path)) as connection:
            identity, schema = read_schema(connection)
            structure = _check_structure(connection, path)
            tracks, records, damage = _read_records(connection, schema)
            if structure and not records:
                raise DataError(f"no record is readable: {structure[0]}")
    except sqlite3.OperationalError as error:
        raise FileError(f"{path}: cannot be read: {error}") from None
    except (sqlite3.Error, DataError, ValueError) as error:
        raise DataError(f"{path}: a store whose header is damaged: {error}") from None
    return Snapshot(path, schema, tuple(tracks), records, (*structure, *damage), identity)


def _read_records(
    connection: sqlite3.Connection, schema: TrackSchema
) -> tuple[list[StoredTrack], int, list[Damage]]:
    """Return the tracks with all their labels, the number of intact records, and the damaged records."""
    tracks, damaged, intact = dict[int, StoredTrack](), dict[int, Damage](), set[int]()
    for table in ("track", "later_label"):
        for record, *row in iterate_rows(connection, table):
            try:
                if not is_intact((record, *row)):
                    raise DataError("its checksum is wrong")
                if table == "track":
                    tracks[record] = decode_track((record, *row), schema)
                elif row[0] in tracks:
                    track, label = tracks[row[0]], decode_label(row[1:-1], schema)
                    tracks[row[0]] = replace(track, label_history=(*track.label_history, label))
                else:
                    raise DataError(f"it labels record {row[0]}, which is lost")
                intact.add(record)
            except (DataError, RecursionError) as error:  # the second: extra data of great depth
                damaged[record] = Damage(f"record {record}: {error}", 1)
    last = max(read_last_record(connection), *intact, 0)
    places = sorted({0, last + 1, *(record for record in {*intact, *damaged} if record <= last)})
    for before, after in pairwise(places):
        if after > before + 1:
            first, end = before + 1, after - 1
            which = f"record {first} is" if first == end else f"records {first} to {end} are"
            damaged[first] = Damage(f"{which} missing", end - first + 1)
    return (
        [tracks[record] for record in sorted(tracks)],
        len(intact),
        [damaged[record] for record in sorted(damaged)],
    )


def _check_structure(connection: sqlite3.Connection, path: Path) -> list[Damage]:
    """Return what SQLite reports when it opens the file without leniency and checks its integrity."""
    report = list[str]()
    try:
        report.extend(str(line) for (line,) in connection.execute("PRAGMA integrity_check(10)"))
        connect_reader(path, ()).close()
    except sqlite3.DatabaseError as error:
        report.append(str(error))
    return [Damage("; ".join(line.splitlines()), structural=True) for line in report if line != "ok"]


def is_store(path: str | Path) -> bool:
    """Whether a file is a store, by its name, *.tracks, or its first bytes."""
    path = Path(path)
    try:
        return path.is_file() and (path.suffix == ".tracks" or bool(detect_version(path)))
    except DataError:
        return False
