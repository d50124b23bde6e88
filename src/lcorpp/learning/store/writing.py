"""The one process that adds to a store; what it was told is kept is on the disk."""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterable
from datetime import datetime
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import BinaryIO, Self
from uuid import uuid4

from lcorpp.errors import DataError, FileError
from lcorpp.files import sync, sync_folder, write_atomically
from lcorpp.learning.store.contents import Contents, read_head
from lcorpp.learning.store.frames import MARKER, Frame, framed
from lcorpp.learning.store.layout import Head, TrackSchema, head_bytes
from lcorpp.learning.store.locking import GUARDED, close_in_children, lock
from lcorpp.learning.store.reading import Snapshot, reading
from lcorpp.learning.store.tracks import NewTrack, encoded, encoded_judgement, said
from lcorpp.values import Distribution


class Store:
    """An append-only file of tracks, open for writing by this process alone.

    A crash at any moment loses at most the record that is being written: every record is known whole by its
    checksum, and `append` returns when it is on the disk. Nothing that was written is changed; what a crash
    left behind the last record is moved to a file beside the store when it is opened again.

    notes: what opening it found and did, in words, for people to read.
    """

    notes: tuple[str, ...]

    def __init__(self, path: str | Path, schema: TrackSchema) -> None:
        """Open a store, or make it where there is none or an empty file.

        Args:
            path: the file; by custom its name ends in .tracks.
            schema: what all tracks have in common; that of an existing store must be equal.

        Raises:
            FileError: the file cannot be read or written, or another process (or this one) writes to it.
            DataError: it is no store, is of another version or has another schema.
        """
        self.path = Path(path)
        self._file = _opened(self.path)
        try:
            if not lock(self._file.fileno()):
                raise FileError(
                    f"{path}: is being written to already, by another process or by this one; a store has one"
                    " writer (reading goes on meanwhile)"
                )
            self._contents, self.notes = self._recovered(schema)
        except OSError as error:
            self.close()
            raise FileError(f"{path}: cannot be opened: {error.strerror}") from None
        except BaseException:
            self.close()
            raise
        close_in_children(self)

    @property
    def schema(self) -> TrackSchema:
        """What all tracks have in common."""
        return self._contents.head.schema

    @property
    def marker(self) -> str:
        """What tells this store from any other: the marker of its records in hexadecimal digits."""
        return self._contents.head.marker.hex()

    @property
    def last(self) -> int:
        """The number of the last record: how many were ever written, tracks and later judgements."""
        return self._contents.last

    def snapshot(self) -> Snapshot:
        """What is in the store now, as a value that stays as it is."""
        return reading(self.path, self._contents, self._contents.end)

    def __len__(self) -> int:
        """How many tracks there are."""
        return len(self._contents.tracks)

    def __contains__(self, id: object) -> bool:
        """Whether there is a track of this id."""
        return id in self._contents.tracks

    def append(self, track: NewTrack, *, durable: bool = True) -> str:
        """Add one track; when this returns, it is on the disk.

        Args:
            durable: False leaves it to the operating system when the disk gets it. The track then survives
                a killed process, but not a power loss before the next `sync`.

        Returns:
            Its id.

        Raises:
            DataError: the track does not fit, or its id is taken; nothing has been written.
            FileError: it cannot be written, e.g. on a full disk; the store is as it was.
        """
        return self.extend([track], durable=durable)[0]

    def extend(self, tracks: Iterable[NewTrack], *, durable: bool = True) -> list[str]:
        """Add several tracks with one wait for the disk; arguments, result and errors as in `append`.

        Nothing is written unless all of them fit. A crash meanwhile keeps the first of them, in their order.
        """
        marker, number = self._contents.head.marker, self._contents.last
        ids, pieces = dict[str, None](), list[tuple[bytes, bytes]]()
        tracks = list(tracks)
        for row, track in enumerate(tracks):
            number += 1
            id = uuid4().hex if track.id is None else track.id
            try:
                if not isinstance(id, str) or not id:
                    raise DataError(f"the id of a track is text, not {id!r}")
                if id in self or id in ids:
                    raise DataError(f"there is a track {id!r} already")
                pieces.append(encoded(track, number, id, self.schema))
            except DataError as error:
                which = f"track {row} of {len(tracks)} (counted from 0)" if len(tracks) > 1 else "the track"
                raise DataError(f"{self.path}: {which} is not stored: {error}") from None
            ids[id] = None
        self._write([(framed(marker, *piece), *piece) for piece in pieces], durable)
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
        """Add what somebody says of a track that is stored; a person's word holds over the robot's.

        What was said before stays in the store (`StoredTrack.label_history`). On the disk when this returns.

        Raises:
            DataError: there is no such track, class or source; nothing has been written.
            FileError: it cannot be written.
        """
        if id not in self:
            raise DataError(f"{self.path}: no track {id!r} to label")
        try:
            facts = said(label, source, belief, time, self.schema)
            piece = encoded_judgement(self._contents.last + 1, id, facts)
        except DataError as error:
            raise DataError(f"{self.path}: track {id!r} not labelled: {error}") from None
        self._write([(framed(self._contents.head.marker, piece, b""), piece, b"")], True)

    def sync(self) -> None:
        """Return when everything that was appended is on the disk.

        Raises:
            FileError: the disk says that it is not.
        """
        try:
            sync(self._live())
        except OSError as error:
            self.close()  # what is on the disk now, only reading it again can tell
            raise FileError(f"{self.path}: cannot be written to the disk: {error.strerror}") from None

    def close(self) -> None:
        """Let another process write. A store that is closed can still be read."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _write(self, records: list[tuple[bytes, bytes, bytes]], durable: bool) -> None:
        """Append frames, given with their facts and numbers; all or, on an error, none."""
        file, start = self._live(), self._contents.end
        status = os.fstat(file)
        if status.st_nlink == 0 or status.st_size != start:
            what = "deleted" if status.st_nlink == 0 else f"changed ({status.st_size} bytes, not {start})"
            raise FileError(f"{self.path}: has been {what} by another program; open it again")
        try:
            _write_all(file, b"".join(frame for frame, _, _ in records), start)
        except OSError as error:
            self._undo(start)
            raise FileError(f"{self.path}: cannot be written: {error.strerror}") from None
        except BaseException:  # Ctrl-C between two parts of a long write
            self._undo(start)
            raise
        for frame, facts, numbers in records:
            self._contents.add(Frame(start, start + len(frame), facts, numbers))
            start += len(frame)
        if durable:
            self.sync()

    def _undo(self, end: int) -> None:
        """Cut what was written of frames that could not be written whole."""
        try:
            os.ftruncate(self._live(), end)
        except OSError:
            self.close()  # the next opening cuts it

    def _live(self) -> int:
        if self._file.closed:
            raise FileError(f"{self.path}: this store is closed; open it again to write")
        return self._file.fileno()

    def _recovered(self, schema: TrackSchema) -> tuple[Contents, tuple[str, ...]]:
        """Read what is there, move aside what is behind the last record, and begin a new store if need be."""
        size = os.fstat(self._file.fileno()).st_size
        notes = list[str]()
        if not GUARDED:
            notes.append("this system has no flock: that nobody else writes to the store is not checked")
        with os.fdopen(os.dup(self._file.fileno()), "rb") as file:
            head = read_head(file, self.path)
            if head is not None:
                head.schema.check_same(schema, str(self.path))
            if head is None or size < head.length:  # no record can be behind a head that is not complete
                if size:
                    notes.append(self._cut(file, 0, size))
                contents = Contents(self._begun(schema))
            else:
                contents = Contents(head)
                contents.read(file, size)
                notes += [str(damage) for damage in contents.damage]
                if contents.end < size:
                    notes.append(self._cut(file, contents.end, size))
        return contents, tuple(f"{self.path}: {note}" for note in notes)

    def _begun(self, schema: TrackSchema) -> Head:
        marker = os.urandom(MARKER)
        content = head_bytes(schema, marker)
        _write_all(self._file.fileno(), content, 0)
        sync(self._file.fileno())
        sync_folder(self.path)
        return Head(schema, marker, len(content))

    def _cut(self, file: BinaryIO, start: int, stop: int) -> str:
        """Move the last bytes of the file to one beside it, and say so.

        Its name tells them apart from others: after a crash in between they are moved once more, to it.
        """
        file.seek(start)
        rest = file.read(stop - start)
        aside = self.path.with_name(f"{self.path.name}.cut-{start}-{zlib.crc32(rest):08x}")
        write_atomically(aside, rest)
        sync_folder(aside)
        os.ftruncate(self._file.fileno(), start)
        sync(self._file.fileno())
        return (
            f"bytes {start} to {stop} are no whole record, as a crash while it was written leaves them: moved"
            f" to {aside.name}"
        )


def _opened(path: Path) -> FileIO:
    """A file for reading and writing, made where there is none; no device, folder or pipe."""
    try:
        if path.exists() and not path.is_file():
            raise FileError(f"{path}: is not a file; a store of tracks is one")
        handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666)
    except (OSError, ValueError) as error:
        raise FileError(
            f"{path}: cannot be opened for writing: {getattr(error, 'strerror', None) or error}"
        ) from None
    return FileIO(handle, "r+")


def _write_all(file: int, content: bytes, at: int) -> None:
    """Write at a place; the system may take less than all at once."""
    os.lseek(file, at, os.SEEK_SET)
    view = memoryview(content)
    while view:
        view = view[os.write(file, view) :]
