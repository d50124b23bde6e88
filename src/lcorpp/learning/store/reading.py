"""What a store holds, as of one moment: any number of processes read while one writes."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lcorpp.errors import DataError, FileError, expected_one_of
from lcorpp.learning.store.contents import Contents, Damage, opened, read_head
from lcorpp.learning.store.frames import frame_at
from lcorpp.learning.store.layout import MAGIC, TrackSchema
from lcorpp.learning.store.tracks import SOURCES, StoredTrack, trajectory
from lcorpp.values import Array, Dataset

if TYPE_CHECKING:
    from lcorpp.learning.data.tracks import Recording


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A store as of one moment.

    path: the file. schema: what all its tracks have in common.
    tracks: those stored, in their order. records: tracks and later judgements about them.
    damage: places in the file that are not as they were written; the records there are lost.
    tail: bytes behind the last record: one that is being written, or was when its writer came to its end.
    """

    path: Path
    schema: TrackSchema
    tracks: tuple[StoredTrack, ...]
    records: int
    damage: tuple[Damage, ...]
    tail: int
    marker: bytes

    def __len__(self) -> int:
        return len(self.tracks)

    def __iter__(self) -> Iterator[StoredTrack]:
        return iter(self.tracks)

    def select(
        self,
        *,
        sources: Collection[str] = SOURCES,
        min_confidence: float = 0.0,
        labels: Collection[str] | None = None,
    ) -> tuple[StoredTrack, ...]:
        """The labelled tracks that may be trusted.

        Args:
            sources: who must have said the label that holds, "person" or "robot".
            min_confidence: minimum `LabelRecord.confidence`; a label without one passes only 0.
            labels: the classes to choose; None takes all.

        Raises:
            DataError: a source or class that there is not, or `above` is no probability.
        """
        for what, given, known in (
            ("source", sources, SOURCES),
            ("class", labels or (), self.schema.classes),
        ):
            for name in given:
                if name not in known:
                    raise DataError(f"unknown {what} {name!r}; {expected_one_of(known)}")
        if not 0 <= min_confidence <= 1:
            raise DataError(f"the trust asked for is {min_confidence}; expected 0 to 1")
        return tuple(
            track
            for track in self.tracks
            if track.label is not None
            and track.source in sources
            and (min_confidence == 0 or track.judgement.confidence >= min_confidence)
            and (labels is None or track.label in labels)
        )

    def trajectories(self, tracks: Sequence[StoredTrack] | None = None) -> Array:
        """(cases, channels, time points) the numbers of some tracks of this reading, of all by default.

        Raises:
            DataError: they do not all have the same number of time points.
            FileError: the file cannot be read, or has been changed or damaged since.
        """
        tracks = self.tracks if tracks is None else tracks
        points = tracks[0].points if tracks else self.schema.points or 2
        for track in tracks:
            if track.points != points:
                raise DataError(
                    f"{self.path}: track {track.id!r} has {track.points} time points and {tracks[0].id!r}"
                    f" {points}; a data set needs one number of them: choose, or cut them with `points`"
                )
        numbers = np.empty((len(tracks), len(self.schema.channels), points))
        for row, array in zip(numbers, self._arrays(tracks), strict=True):
            row[:] = array
        return numbers

    def dataset(self, tracks: Sequence[StoredTrack] | None = None, *, points: int | None = None) -> Dataset:
        """Labelled tracks as data to learn from, in their order; damage to the store is told in the notes.

        Args:
            tracks: from `chosen`; None takes all that have a label.
            points: the last so many time points of each track; shorter tracks are left out, and counted in
                the notes. None takes the tracks as they are.

        Raises:
            DataError: the tracks differ in their time points, one has no label, or `points` is below 2.
            FileError: the file cannot be read, or has been changed or damaged since.
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
            cut = [array[:, -points:] for array in self._arrays(tracks)]
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
        """(cases,) the trust in each label, in the order of `dataset`; 1 where nothing is known of it.

        They are what scikit-learn calls `sample_weight`: a label that the robot half believed counts half.
        """
        tracks = self.select() if tracks is None else tracks
        trust = np.array([track.judgement.confidence for track in tracks], dtype=np.float64)
        return np.where(np.isnan(trust), 1.0, trust)

    def recording(self) -> Recording:
        """All tracks with their labels as the tools for recordings take them, e.g. `write_recording`.

        Raises:
            DataError: the tracks have no x or y. FileError: as `dataset`.
        """
        from lcorpp.learning.data.tracks import Recording, Track

        tracks = [
            Track(
                stored.id,
                np.arange(float(stored.points)) * self.schema.interval,
                dict(zip(self.schema.channels, numbers, strict=True)),
                stored.label,
                stored.group,
            )
            for stored, numbers in zip(self.tracks, self._arrays(self.tracks), strict=True)
        ]
        return Recording(tuple(tracks), str(self.path))

    def counts(self) -> Mapping[tuple[str | None, str], int]:
        """(label, source) -> how many tracks, in the order of the classes."""
        order = [(label, source) for label in (*self.schema.classes, None) for source in SOURCES]
        counts = dict.fromkeys(order, 0)
        for track in self.tracks:
            counts[track.label, track.source] += 1
        return {key: count for key, count in counts.items() if count}

    def summary(self) -> str:
        """What is there, in words: tracks, classes and who said them."""
        counts = ", ".join(
            f"{count} {label} by {'a person' if source == 'person' else 'report'}"
            if label is not None
            else f"{count} without a label"
            for (label, source), count in self.counts().items()
        )
        return f"{len(self)} tracks" + (f" ({counts})" if counts else "")

    def _arrays(self, tracks: Sequence[StoredTrack]) -> Iterator[Array]:
        """The numbers of each track, (channels, time points), checked once more as they are read."""
        with opened(self.path) as file:
            size = os.fstat(file.fileno()).st_size
            for track in tracks:
                frame = frame_at(file, self.marker, track.place, size)
                if frame is None:
                    raise FileError(
                        f"{self.path}: track {track.id!r} is no longer at byte {track.place}: the file has"
                        " been changed or damaged since it was read"
                    )
                yield trajectory(frame, self.schema)


def read_store(path: str | Path) -> Snapshot:
    """What is in a store now; a process that writes to it is not disturbed.

    Raises:
        FileError: the file is missing or unreadable.
        DataError: it is no store, is of another version, or both copies of its head are damaged.
    """
    path = Path(path)
    with opened(path) as file:
        stop = os.fstat(file.fileno()).st_size
        head = read_head(file, path)
        if head is None:
            raise DataError(f"{path}: {stop} bytes of a store whose head is not complete; it has no records")
        contents = Contents(head)
        contents.read(file, stop)
    return reading(path, contents, stop)


def reading(path: Path, contents: Contents, stop: int) -> Snapshot:
    """The contents of the first `stop` bytes of a file, as they are now."""
    return Snapshot(
        path,
        contents.head.schema,
        tuple(contents.tracks.values()),
        contents.records,
        tuple(contents.damage),
        max(0, stop - contents.end),
        contents.head.marker,
    )


def is_store(path: str | Path) -> bool:
    """Whether a file looks like a store: by its name, *.tracks, or its beginning."""
    path = Path(path)
    if not path.is_file():
        return False
    with opened(path) as file:
        return path.suffix == ".tracks" or file.read(len(MAGIC)) == MAGIC
