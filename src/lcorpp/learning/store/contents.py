"""Read the records of a store in spite of damage, and describe the damage."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

from lcorpp.errors import DataError
from lcorpp.learning.store.records import Row, StoredTrack, decode_label, decode_track
from lcorpp.learning.store.schema import StoreHeader, TrackSchema

DECODING_ERRORS = (
    *(DataError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError),
)
"""Errors that a damaged row or header may cause."""

LAST_RECORD = "SELECT coalesce(max(seq), 0) FROM sqlite_sequence"
"""Query for the number of the last record that was ever written."""

MIN_RECORD = 32
"""Minimum size of a record in bytes."""


@dataclass(frozen=True)
class Damage:
    """A damaged place in a store.

    description: the records or the page, and the fault. lost: number of records lost by it.
    structural: whether SQLite's own structure is damaged there, so that nothing can be appended safely.
    """

    description: str
    lost: int = 0
    structural: bool = False

    def __str__(self) -> str:
        plural = "s" * (self.lost != 1)
        return f"{self.description}; {self.lost} record{plural} lost" if self.lost else self.description


@dataclass(frozen=True)
class Contents:
    """Everything that was read from a store.

    tracks: in the order of their records. damage: likewise. last: the last record that was ever written.
    readable: the records of tracks and of later labels.
    """

    header: StoreHeader
    tracks: tuple[StoredTrack, ...]
    readable: frozenset[int]
    damage: tuple[Damage, ...]
    last: int


def read_header(connection: sqlite3.Connection) -> StoreHeader:
    """Read the header of a store; if it is damaged, raise sqlite3.Error or one of `DECODING_ERRORS`."""
    ((identity, channels, interval, classes, points),) = connection.execute("SELECT * FROM store")
    return StoreHeader(TrackSchema(json.loads(channels), interval, json.loads(classes), points), identity)


def read_contents(connection: sqlite3.Connection) -> Contents:
    """Read and check the header and every record.

    Raises:
        sqlite3.Error or one of `DECODING_ERRORS`: the header is damaged.
    """
    header = read_header(connection)
    last = _read_last_record(connection)
    tracks, damaged, numbers = dict[int, StoredTrack](), dict[int, Damage](), set[int]()
    ids = set[str]()
    for row in iterate_rows(connection, "track", last):
        try:
            track = decode_track(row, header.schema)
            if track.id in ids:
                raise DataError(f"another track has the id {track.id!r}")
            tracks[track.record] = track
            ids.add(track.id)
        except DECODING_ERRORS as error:
            damaged[row[0]] = Damage(f"record {row[0]}: {error}", 1)
    numbers.update(tracks)
    for row in iterate_rows(connection, "later_label", last):
        try:
            record, number, label = decode_label(row, header.schema)
            if number not in tracks:
                raise DataError(f"it labels record {number}, which is lost")
            known = tracks[number]
            tracks[number] = replace(known, label_history=(*known.label_history, label))
            numbers.add(record)
        except DECODING_ERRORS as error:
            damaged[row[0]] = Damage(f"record {row[0]}: {error}", 1)
    last = max(last, *numbers, 0)
    places = sorted({0, last + 1, *(record for record in numbers.union(damaged) if record <= last)})
    for before, after in pairwise(places):
        if after > before + 1:
            first, end = before + 1, after - 1
            which = f"record {first} is" if first == end else f"records {first} to {end} are"
            damaged[first] = Damage(f"{which} missing", end - first + 1)
    damage = (*_check_structure(connection), *(damaged[record] for record in sorted(damaged)))
    return Contents(header, tuple(tracks.values()), frozenset(numbers), damage, last)


def iterate_rows(connection: sqlite3.Connection, table: str, last: int) -> Iterator[Row]:
    """Yield all readable rows of a table of records, in the order of their numbers, past damaged pages.

    Args:
        last: the number of the last record in the store.
    """
    query = f"SELECT * FROM {table} WHERE record"
    start = 1
    while start <= last + 1:
        try:
            for row in connection.execute(f"{query} >= ? ORDER BY record", (start,)):
                start = max(start, row[0] + 1)
                yield row
            return
        except sqlite3.DatabaseError:  # a damaged page: try the next record
            with suppress(sqlite3.DatabaseError):
                yield from connection.execute(f"{query} = ?", (start,)).fetchall()
            start += 1


def _read_last_record(connection: sqlite3.Connection) -> int:
    """Return the number of the last record, at most as many as the file has space for; 0 if unreadable."""
    queries = LAST_RECORD, "PRAGMA page_count", "PRAGMA page_size"
    try:
        last, pages, size = (int(connection.execute(query).fetchone()[0]) for query in queries)
    except (sqlite3.DatabaseError, ValueError):
        return 0
    return min(last, pages * size // MIN_RECORD)


def _check_structure(connection: sqlite3.Connection) -> Iterator[Damage]:
    """Yield what SQLite's integrity check reports."""
    try:
        report = [str(line) for (line,) in connection.execute("PRAGMA integrity_check(10)")]
    except sqlite3.DatabaseError as error:
        report = [str(error)]
    if report != ["ok"]:
        yield from (Damage("; ".join(line.splitlines()), structural=True) for line in report)
