"""The records of a store, gathered frame by frame from its file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

from lcorpp.errors import DataError, FileError
from lcorpp.learning.store.frames import Frame, Gap, frames
from lcorpp.learning.store.layout import LONGEST_HEAD, MAGIC, Head, begun_head, parse_head
from lcorpp.learning.store.tracks import StoredTrack, decoded


@dataclass(frozen=True)
class Damage:
    """A place in the file that is not as it was written, and what that costs.

    start, stop: its bytes, counted from 0. what: in words.
    lost: how many records; None where only the next one, which is not there yet, could tell.
    """

    start: int
    stop: int
    what: str
    lost: int | None = None

    def __str__(self) -> str:
        cost = "" if self.lost is None else f"; {self.lost} record{'s' * (self.lost != 1)} lost"
        return f"bytes {self.start} to {self.stop}: {self.what}{cost}"


class Contents:
    """The records of a store, gathered frame by frame: what a reader finds, and a writer goes on from."""

    def __init__(self, head: Head) -> None:
        self.head = head
        self.tracks: dict[str, StoredTrack] = {}
        self.records = 0
        self.last = 0
        self.end = head.length
        self.damage: list[Damage] = []
        if not head.whole:
            self.damage.append(Damage(0, head.length, "one copy of the head is damaged, the other serves", 0))

    def read(self, file: BinaryIO, stop: int) -> None:
        """Take in what lies between the last record known, which ends at `end`, and byte `stop`."""
        gap: Gap | None = None
        for piece in frames(file, self.head.marker, self.end, stop):
            if isinstance(piece, Gap):
                gap = piece
            else:
                self.add(piece, gap)
                gap = None

    def add(self, frame: Frame, gap: Gap | None = None) -> None:
        """Take in the next whole frame, `gap` being what lies between it and the one before."""
        self.end = frame.stop
        try:
            number, about, judgement, stored = decoded(frame, self.head.schema)
            if stored is not None and about in self.tracks:
                raise DataError(f"there is another track {about!r}")
        except DataError as error:
            if gap is not None:
                self.damage.append(Damage(gap.start, gap.stop, "not a record"))
            self.damage.append(Damage(frame.start, frame.stop, f"a record that is not used: {error}"))
            return
        lost = max(0, number - self.last - 1)
        if gap is not None:
            self.damage.append(Damage(gap.start, gap.stop, f"not a record (before record {number})", lost))
        elif lost:
            what = f"nothing where records before {number} were"
            self.damage.append(Damage(frame.start, frame.start, what, lost))
        elif number <= self.last:
            what = f"record {number} after record {self.last}; used all the same"
            self.damage.append(Damage(frame.start, frame.stop, what, 0))
        self.last, self.records = max(number, self.last), self.records + 1
        if stored is not None:
            self.tracks[about] = stored
        elif about in self.tracks:
            known = self.tracks[about]
            self.tracks[about] = replace(known, label_history=(*known.label_history, judgement))
        else:
            self.damage.append(
                Damage(frame.start, frame.stop, f"record {number} labels {about!r}, which is lost", 0)
            )


def read_head(file: BinaryIO, path: Path) -> Head | None:
    """The head of an open file; None where nothing but the beginning of one has been written.

    Raises:
        DataError: it is no store, is of another version, or both copies of its head are damaged.
    """
    file.seek(0)
    content = file.read(LONGEST_HEAD + 1)
    try:
        head = parse_head(content)
    except DataError as error:
        raise DataError(f"{path}: {error}") from None
    if head is None and not (len(content) <= LONGEST_HEAD and begun_head(content)):
        what = "a store whose head is damaged" if MAGIC in content[:LONGEST_HEAD] else "not a store of tracks"
        raise DataError(f"{path}: {what}; expected a file that begins with {MAGIC.decode()!r}")
    return head


def opened(path: Path) -> BinaryIO:
    """A file to be read, not a folder or device; the caller closes it.

    Raises:
        FileError: there is none, or it cannot be read.
    """
    try:
        if path.exists() and not path.is_file():
            raise FileError(f"{path}: is not a file; a store of tracks is one")
        return path.open("rb", buffering=2**18)
    except (OSError, ValueError) as error:
        raise FileError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
