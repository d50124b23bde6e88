"""A store open for writing: appended tracks and labels are on the disk when the call returns."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterable
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Self
from uuid import uuid4

from lcorpp.errors import DataError, FileError
from lcorpp.files import sync, sync_folder
from lcorpp.learning.store.conversion import convert, rebuild
from lcorpp.learning.store.database import (
    LAST_RECORD,
    acquire_lock,
    connect_writer,
    detect_version,
    insert,
    sibling,
    write_store,
)
from lcorpp.learning.store.reading import load_snapshot
from lcorpp.learning.store.records import NewTrack, Row, encode_label, encode_track, with_checksum
from lcorpp.learning.store.schema import TrackSchema
from lcorpp.learning.store.snapshot import Snapshot
from lcorpp.values import Distribution


class Store:
    """An append-only file of tracks, open for writing by this process alone.

    A crash at any moment loses at most the records of the unfinished call: `append` returns when its
    transaction is on the disk. Stored records never change; a later label is a new record.

    path: the file. schema: channels, interval, classes and length of the tracks.
    identity: 32 hexadecimal digits that no other store has.
    notes: the damage found when the store was opened, and what was done about it, as sentences.
    """

    notes: tuple[str, ...]
    identity: str

    def __init__(self, path: str | Path, schema: TrackSchema) -> None:
        """Open a store; create it if there is no file, or an empty one.

        A store of version 1 is converted to SQLite, with a warning in the log. A store whose structure is
        damaged is rebuilt from its readable records. The damaged or converted file is kept beside it.

        Args:
            path: the file; its name usually ends in .tracks.
            schema: channels, interval, classes and length of the tracks; an existing store has the same.

        Raises:
            FileError: the file cannot be read or written, or another process (or this one) writes to it.
            DataError: the file is not a store, has a newer version or another schema, or its header is
                damaged.
        """
        self.path, self.schema = Path(path), schema
        detect_version(self.path)
        self._lock = acquire_lock(self.path)
        try:
            self.identity, self.notes = self._prepare()
            self._connection = connect_writer(self.path)
        except BaseException as error:
            self._lock.close()
            if isinstance(error, sqlite3.Error):
                raise FileError(f"{path}: cannot be opened for writing: {error}") from None
            raise
        self._process, self._closed, self._file = os.getpid(), False, _identify_file(self.path)

    @property
    def last_record(self) -> int:
        """Number of the last record that was ever written; tracks and later labels are records."""
        (last,) = self._select(LAST_RECORD)
        return last

    def snapshot(self) -> Snapshot:
        """Return the current content; it stays the same when the store grows."""
        return load_snapshot(self.path)

    def __len__(self) -> int:
        """Number of tracks."""
        (count,) = self._select("SELECT count(*) FROM track")
        return count

    def __contains__(self, id: object) -> bool:
        """Whether a track has this id."""
        return isinstance(id, str) and bool(self._select("SELECT record FROM track WHERE id = ?", id))

    def __repr__(self) -> str:
        return f"Store({str(self.path)!r}, {'closed' if self._closed else f'{len(self)} tracks'})"

    def append(self, track: NewTrack, *, durable: bool = True) -> str:
        """Add one track; it is on the disk when this returns.

        Args:
            durable: False leaves it to the operating system when the disk receives the track. It then
                survives a killed process, but not a power loss before the next `sync`.

        Returns:
            The id of the track.

        Raises:
            DataError: the track does not fit the schema, or its id is taken; nothing is written.
            FileError: the track cannot be written, e.g. because the disk is full; the store is unchanged.
        """
        return self.extend([track], durable=durable)[0]

    def extend(self, tracks: Iterable[NewTrack], *, durable: bool = True) -> list[str]:
        """Add several tracks in one transaction: all or none. Arguments, result and errors: as `append`."""
        ids, rows = dict[str, None](), list[Row]()
        tracks, last = list(tracks), self.last_record
        for index, track in enumerate(tracks):
            id = uuid4().hex if track.id is None else track.id
            try:
                rows.append(encode_track(track, last + 1 + index, id, self.schema))
                if id in self or id in ids:
                    raise DataError(f"there is a track {id!r} already")
            except DataError as error:
                which = f"track {index} of {len(tracks)} (counted from 0)" if len(tracks) > 1 else "the track"
                raise DataError(f"{self.path}: {which} is not stored: {error}") from None
            ids[id] = None
        self._write("track", rows, durable)
        return list(ids)

    def relabel(
        self,
        id: str,
        label: str | None,
        *,
        source: str = "person",
        belief: Distribution | None = None,
        time: datetime | None = None,
    ) -> None:
        """Add a label record to a stored track; a person's label takes precedence over the robot's.

        Earlier label records remain (`StoredTrack.label_history`). The record is on the disk when this
        returns.

        Raises:
            DataError: an unknown track, class or source; nothing is written.
            FileError: the record cannot be written.
        """
        track = self._select("SELECT record FROM track WHERE id = ?", id)
        if not track:
            raise DataError(f"{self.path}: no track {id!r} to label")
        try:
            cells = encode_label(label, source, belief, time, self.schema)
        except DataError as error:
            raise DataError(f"{self.path}: track {id!r} not labelled: {error}") from None
        self._write("later_label", [with_checksum(self.last_record + 1, track[0], *cells)], True)

    def sync(self) -> None:
        """Return when all appended records are on the disk.

        Raises:
            FileError: the disk reports an error; the store is closed.
        """
        self._connect()
        try:
            log = os.open(sibling(self.path, "-wal"), os.O_RDWR)
            try:
                sync(log)
            finally:
                os.close(log)
            sync_folder(self.path)
        except OSError as error:
            self.close()
            raise FileError(f"{self.path}: cannot be written to the disk: {error.strerror}") from None

    def close(self) -> None:
        """Write everything to the one file and release the lock. Snapshots remain usable."""
        if not self._closed and os.getpid() == self._process:
            self._connection.close()
            self._lock.close()
        self._closed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _prepare(self) -> tuple[str, tuple[str, ...]]:
        """Create, convert or rebuild the file if necessary; return its identity and the notes."""
        version = detect_version(self.path)
        if not version:
            write_store(self.path, uuid4().hex, self.schema)
        elif version == 1:
            convert(self.path)
        snapshot = load_snapshot(self.path)
        snapshot.schema.check_equal(self.schema, str(self.path))
        notes = list(map(str, snapshot.damage))
        if any(damage.structural for damage in snapshot.damage):
            notes.append(rebuild(self.path))
        return snapshot.identity, tuple(f"{self.path}: {note}" for note in notes)

    def _write(self, table: str, rows: list[Row], durable: bool) -> None:
        """Insert rows in one transaction: all or, on an error, none."""
        connection = self._connect()
        if _identify_file(self.path) != self._file:
            raise FileError(f"{self.path}: was deleted or replaced by another program; open it again")
        try:
            connection.execute(f"PRAGMA synchronous = {'FULL' if durable else 'NORMAL'}")
            with connection:
                connection.execute("BEGIN IMMEDIATE")
                insert(connection, table, rows)
        except sqlite3.Error as error:
            if error.sqlite_errorcode not in (sqlite3.SQLITE_FULL, sqlite3.SQLITE_BUSY):
                self.close()  # only reading the file again shows what the disk has
            raise FileError(f"{self.path}: cannot be written: {error}") from None

    def _select(self, query: str, *values: str) -> list[int]:
        """Return the first column of a query."""
        try:
            return [row[0] for row in self._connect().execute(query, values)]
        except sqlite3.Error as error:
            raise FileError(f"{self.path}: cannot be read: {error}") from None

    def _connect(self) -> sqlite3.Connection:
        if self._closed or os.getpid() != self._process:
            raise FileError(f"{self.path}: this store is closed; open it again to write")
        return self._connection


def _identify_file(path: Path) -> tuple[int, int] | None:
    """Device and inode of a file; None if it is missing."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino
