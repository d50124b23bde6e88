"""Snapshots of a store: its content as of one moment, readable while another process writes."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np

from lcorpp.errors import DataError, FileError, expected_one_of
from lcorpp.learning.data.tracks import Recording, Track
from lcorpp.learning.store.contents import DECODING_ERRORS, Contents, Damage, read_contents
from lcorpp.learning.store.conversion import convert
from lcorpp.learning.store.database import (
    acquire_lock,
    check_is_file,
    connect_reader,
    detect_version,
)
from lcorpp.learning.store.records import SOURCES, StoredTrack, decode_trajectory
from lcorpp.learning.store.schema import TrackSchema
from lcorpp.values import Array, Dataset


@dataclass(frozen=True, eq=False, repr=False)
class Snapshot:
    """The content of a store as of one moment; trajectories are read from the file when needed.

    path: the file. schema: what all its tracks have in common. tracks: in the order of their records.
    records: number of tracks and later labels. damage: damaged places; their records are lost.
    """

    path: Path
    schema: TrackSchema
    tracks: tuple[StoredTrack, ...]
    records: int
    damage: tuple[Damage, ...]

    @classmethod
    def from_contents(cls, path: Path, contents: Contents) -> Snapshot:
        """Return a snapshot of contents that were read from `path`."""
        return cls(path, contents.header.schema, contents.tracks, len(contents.readable), contents.damage)

    def __len__(self) -> int:
        return len(self.tracks)

    def __iter__(self) -> Iterator[StoredTrack]:
        return iter(self.tracks)

    def __repr__(self) -> str:
        damage = f"; damaged in {len(self.damage)} places" if self.damage else ""
        return f"Snapshot({str(self.path)!r}: {self.summary()}{damage})"

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{escape(str(label or '(no label)'))}</td><td>{source}</td><td>{count}</td></tr>"
            for (label, source), count in self.counts().items()
        )
        heading = "<tr><th>label</th><th>source</th><th>tracks</th></tr>"
        return f"<p>{escape(repr(self))}</p><table>{heading}{rows}</table>"

    def select(
        self,
        *,
        sources: Collection[str] = SOURCES,
        min_confidence: float = 0.0,
        labels: Collection[str] | None = None,
    ) -> tuple[StoredTrack, ...]:
        """Select labelled tracks.

        Args:
            sources: the permitted sources of the valid label, "person" or "robot".
            min_confidence: minimum `LabelRecord.confidence`; a label without confidence passes only 0.
            labels: the permitted classes; None permits all.

        Raises:
            DataError: an unknown source or class, or `min_confidence` is no probability.
        """
        for what, names, known in (
            ("source", sources, SOURCES),
            ("class", labels or (), self.schema.classes),
        ):
            for name in names:
                if name not in known:
                    raise DataError(f"unknown {what} {name!r}; {expected_one_of(known)}")
        if not 0 <= min_confidence <= 1:
            raise DataError(f"the minimum confidence is {min_confidence}; expected 0 to 1")
        return tuple(
            track
            for track in self.tracks
            if track.label is not None
            and track.source in sources
            and (min_confidence == 0 or track.label_record.confidence >= min_confidence)
            and (labels is None or track.label in labels)
        )

    def trajectories(self, tracks: Sequence[StoredTrack] | None = None) -> Array:
        """(cases, channels, time points) the trajectories of some tracks of this snapshot; by default of all.

        Raises:
            DataError: the tracks differ in their number of time points.
            FileError: the file cannot be read, or was changed or damaged after the snapshot.
        """
        tracks = self.tracks if tracks is None else tracks
        points = tracks[0].points if tracks else self.schema.points or 2
        for track in tracks:
            if track.points != points:
                raise DataError(
                    f"{self.path}: track {track.id!r} has {track.points} time points and {tracks[0].id!r}"
                    f" {points}; a data set needs an equal number: select tracks, or cut them with `points`"
                )
        numbers = np.empty((len(tracks), len(self.schema.channels), points))
        for row, array in zip(numbers, self._read_trajectories(tracks), strict=True):
            row[:] = array
        return numbers

    def dataset(self, tracks: Sequence[StoredTrack] | None = None, *, points: int | None = None) -> Dataset:
        """Return labelled tracks as a data set, in their order; its notes describe damage to the store.

        Args:
            tracks: from `select`; None takes all labelled tracks.
            points: cut each track to its last `points` time points and drop shorter tracks; the notes count
                them. None takes the tracks as they are.

        Raises:
            DataError: the tracks differ in their time points, one has no label, or `points` is below 2.
            FileError: as `trajectories`.
        """
        tracks = self.select() if tracks is None else tracks
        notes = tuple(str(damage) for damage in self.damage)
        if points is None:
            numbers = self.trajectories(tracks)
        elif points < 2:
            raise DataError(f"tracks cut to {points} time points show no motion; at least 2 are needed")
        else:
            long = [track for track in tracks if track.points >= points]
            if len(long) < len(tracks):
                notes += (f"{len(tracks) - len(long)} tracks of fewer than {points} time points left out",)
            tracks = long
            cut = [array[:, -points:] for array in self._read_trajectories(tracks)]
            numbers = np.reshape(cut, (len(tracks), len(self.schema.channels), points))
        labels = []
        for track in tracks:
            if track.label is None:
                raise DataError(f"{self.path}: track {track.id!r} has no label to learn from")
            labels.append(track.label)
        return Dataset(
            numbers,
            tuple(labels),
            tuple(track.group for track in tracks),
            source=str(self.path),
            notes=notes,
            interval=self.schema.interval,
            channels=self.schema.channels,
        )

    def weights(self, tracks: Sequence[StoredTrack] | None = None) -> Array:
        """(cases,) the confidence in each label, in the order of `dataset`; 1 if it is unknown.

        scikit-learn calls them `sample_weight`: a label with belief .5 counts half.
        """
        tracks = self.select() if tracks is None else tracks
        confidence = np.array([track.label_record.confidence for track in tracks], dtype=np.float64)
        return np.where(np.isnan(confidence), 1.0, confidence)

    def recording(self) -> Recording:
        """Return all tracks with their labels as a `Recording`, e.g. for `write_recording`.

        Raises:
            DataError: the tracks have no x or y. FileError: as `trajectories`.
        """
        tracks = [
            Track(
                stored.id,
                np.arange(float(stored.points)) * self.schema.interval,
                dict(zip(self.schema.channels, numbers, strict=True)),
                stored.label,
                stored.group,
            )
            for stored, numbers in zip(self.tracks, self._read_trajectories(self.tracks), strict=True)
        ]
        return Recording(tuple(tracks), str(self.path))

    def counts(self) -> Mapping[tuple[str | None, str], int]:
        """(label, source) -> number of tracks, in the order of the classes."""
        order = [(label, source) for label in (*self.schema.classes, None) for source in SOURCES]
        counts = dict.fromkeys(order, 0)
        for track in self.tracks:
            counts[track.label, track.source] += 1
        return {key: count for key, count in counts.items() if count}

    def summary(self) -> str:
        """Return the number of tracks by class and source, as a phrase."""
        counts = ", ".join(
            f"{count} {label} by {'a person' if source == 'person' else 'report'}"
            if label is not None
            else f"{count} without a label"
            for (label, source), count in self.counts().items()
        )
        return f"{len(self)} tracks" + (f" ({counts})" if counts else "")

    def _read_trajectories(self, tracks: Sequence[StoredTrack]) -> Iterator[Array]:
        """Yield the trajectory of each track, (channels, time points); its checksum is checked again."""
        if not tracks:
            return
        check_is_file(self.path)
        try:
            with closing(connect_reader(self.path)) as connection:
                for track in tracks:
                    row = connection.execute(
                        "SELECT * FROM track WHERE record = ?", (track.record,)
                    ).fetchone()
                    if row is None or row[1] != track.id:
                        raise DataError(f"record {track.record} is not track {track.id!r}")
                    yield decode_trajectory(row, self.schema)
        except (sqlite3.Error, *DECODING_ERRORS) as error:
            raise FileError(
                f"{self.path}: a track can no longer be read; the file was changed or damaged: {error}"
            ) from None


def read_store(path: str | Path) -> Snapshot:
    """Read a store; this does not disturb a process that writes to it.

    A store of version 1 is converted to SQLite first, with a warning in the log.

    Raises:
        FileError: the file is missing or unreadable.
        DataError: the file is not a store, has a newer version, or its header is damaged.
    """
    path = Path(path)
    check_is_file(path)
    version = detect_version(path)
    if version == 0:
        raise DataError(f"{path}: an empty file; expected a store of tracks")
    if version == 1:
        with closing(acquire_lock(path)):
            if detect_version(path) == 1:  # no other process was faster
                convert(path)
    return Snapshot.from_contents(path, load_contents(path))


def load_contents(path: Path) -> Contents:
    """Read all records of the SQLite file at `path`.

    Raises:
        DataError: its header is damaged. FileError: SQLite cannot open the file.
    """
    try:
        with closing(connect_reader(path)) as connection:
            return read_contents(connection)
    except sqlite3.OperationalError as error:
        raise FileError(f"{path}: cannot be read: {error}") from None
    except (sqlite3.Error, *DECODING_ERRORS) as error:
        raise DataError(f"{path}: a store whose header is damaged: {error}") from None


def is_store(path: str | Path) -> bool:
    """Whether a file is a store, by its name, *.tracks, or its first bytes."""
    path = Path(path)
    if not path.is_file():
        return False
    try:
        return path.suffix == ".tracks" or detect_version(path) > 0
    except DataError:
        return False
