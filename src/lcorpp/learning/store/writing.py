"""A store open for writing: appended tracks and labels are on the disk when the call returns."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Self
from uuid import uuid4

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError, FileError
from lcorpp.learning.store import database
from lcorpp.learning.store.conversion import convert, rebuild
from lcorpp.learning.store.records import (
    NewTrack,
    Row,
    TrackSchema,
    encode_label,
    encode_track,
    with_checksum,
)
from lcorpp.learning.store.snapshot import Snapshot, load_snapshot
from lcorpp.values import Distribution

STATEMENTS = (
    "PRAGMA journal_mode = WAL",
    "PRAGMA foreign_keys = ON",
    "PRAGMA fullfsync = ON",  # macOS; without effect elsewhere
    "PRAGMA checkpoint_fullfsync = ON",
)
"""Settings of the writer's connection."""


class Store:
    """An append-only file of tracks, open for writing by this process alone.

    A crash at any moment loses at most the records of the unfinished call: `append` returns when its
    transaction is on the disk. Stored records never change; a later label is a new record.

    path: the file. schema: channels, interval, classes and length of the tracks.
    identity: 32 hexadecimal digits that no other store has.
    notes: the damage found when the store was opened, and what was done about it, as sentences.

    Examples:
        >>> from lcorpp.learning import NewTrack, Store, TrackSchema
        >>> with Store("people.tracks", TrackSchema(["x", "y"], 0.1, ["no", "yes"])) as store:
        ...     id = store.append(NewTrack([[0.0, 0.1], [0.0, 0.0]], "no"))
        ...     store.relabel(id, "yes")
        ...     store.snapshot().tracks[0].label
        'yes'
    """

    @check_arguments
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
        database.detect_version(self.path)
        self._lock = database.acquire_lock(self.path)
        try:
            self.identity, self.notes = self._prepare()
            self._connection = database.connect(self.path, "mode=rw", STATEMENTS)
        except BaseException as error:
            self._lock.close()
            if isinstance(error, sqlite3.Error):
                raise FileError(f"{path}: cannot be opened for writing: {error}") from None
            raise
        self._process, self._closed, self._file = os.getpid(), False, self.path.stat()

    @property
    def last_record(self) -> int:
        """Number of the last record that was ever written; tracks and later labels are records."""
        (last,) = self._select(database.LAST_RECORD)
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
        tracks, rows = list(tracks), dict[str, Row]()
        first = self.last_record + 1
        for index, track in enumerate(tracks):
            id = uuid4().hex if track.id is None else track.id
            try:
                row = encode_track(track, first + index, id, self.schema)
                if id in rows or id in self:
                    raise DataError(f"there is already a track {id!r}")
            except DataError as error:
                which = f"track {index} of {len(tracks)} (counted from 0)" if len(tracks) > 1 else "the track"
                raise DataError(f"{self.path}: {which} is not stored: {error}") from None
            rows[id] = row
        with self._transaction(durable) as connection:
            database.insert(connection, "track", rows.values())
        return list(rows)

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
        with self._transaction() as connection:
            database.insert(
                connection, "later_label", [with_checksum(self.last_record + 1, track[0], *cells)]
            )

    def sync(self) -> None:
        """Return when all appended records are on the disk.

        Raises:
            FileError: the disk reports an error; the store is closed.
        """
        with self._transaction() as connection:  # a durable transaction flushes the log, with all before it
            connection.execute(f"PRAGMA user_version = {database.VERSION}")

    def close(self) -> None:
        """Write everything to the one file and release the lock. Snapshots remain usable."""
        if not self._closed and os.getpid() == self._process:
            self._connection.close()
            self._lock.close()
        self._closed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def _prepare(self) -> tuple[str, tuple[str, ...]]:
        """Create, convert or rebuild the file if necessary; return its identity and the notes."""
        version = database.detect_version(self.path)
        if not version:
            database.write_store(self.path, uuid4().hex, self.schema)
        elif version == 1:
            convert(self.path)
        snapshot = load_snapshot(self.path)
        snapshot.schema.check_equal(self.schema, str(self.path))
        notes = list(map(str, snapshot.damage))
        if any(damage.structural for damage in snapshot.damage):
            notes.append(rebuild(self.path))
        return snapshot.identity, tuple(f"{self.path}: {note}" for note in notes)

    @contextmanager
    def _transaction(self, durable: bool = True) -> Iterator[sqlite3.Connection]:
        """Begin a transaction, which is committed at the end or, on an error, undone."""
        connection = self._connect()
        if not os.path.exists(self.path) or not os.path.samestat(self.path.stat(), self._file):
            raise FileError(f"{self.path}: was deleted or replaced by another program; open it again")
        try:
            connection.execute(f"PRAGMA synchronous = {'FULL' if durable else 'NORMAL'}")
            with connection:
                connection.execute("BEGIN IMMEDIATE")
                yield connection
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
