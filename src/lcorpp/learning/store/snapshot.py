"""Read a store: all its intact records as of one moment, and a description of the damage to the others."""

from __future__ import annotations

import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError, FileError, expected_one_of
from lcorpp.learning.store import database
from lcorpp.learning.store.conversion import convert
from lcorpp.learning.store.records import (
    FLOAT64,
    SOURCES,
    Row,
    StoredTrack,
    TrackSchema,
    decode_label,
    decode_track,
    is_intact,
)
from lcorpp.notebook import html_table
from lcorpp.values import Array, Dataset


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


@dataclass(frozen=True, eq=False, repr=False)
class Snapshot:
    """The content of a store as of one moment; trajectories are read from the file when needed.

    path: the file. schema: what all its tracks have in common. tracks: in the order of their records.
    records: number of tracks and later labels. damage: damaged places; their records are lost.
    identity: 32 hexadecimal digits that no other store has.

    Examples:
        >>> from lcorpp.learning import NewTrack, Store, TrackSchema
        >>> with Store("snapshot.tracks", TrackSchema(["x", "y"], 0.1, ["no", "yes"])) as store:
        ...     _ = store.extend([NewTrack([[0.0, 0.1], [0.0, 0.0]], label) for label in ("no", "yes", None)])
        ...     snapshot = store.snapshot()
        >>> len(snapshot.tracks), snapshot.dataset().labels
        (3, ('no', 'yes'))
    """

    path: Path
    schema: TrackSchema
    tracks: tuple[StoredTrack, ...]
    records: int
    damage: tuple[Damage, ...]
    identity: str

    def __len__(self) -> int:
        return len(self.tracks)

    def __iter__(self) -> Iterator[StoredTrack]:
        return iter(self.tracks)

    def __repr__(self) -> str:
        damage = f"; damaged in {len(self.damage)} places" if self.damage else ""
        return f"Snapshot({str(self.path)!r}: {self.summary()}{damage})"

    def _repr_html_(self) -> str:
        rows = [(label or "(no label)", source, str(n)) for (label, source), n in self.counts().items()]
        return html_table(("label", "source", "tracks"), rows, caption=repr(self))

    def select(
        self,
        *,
        sources: Collection[str] = SOURCES,
        min_confidence: float = 0.0,
        labels: Collection[str] | None = None,
    ) -> tuple[StoredTrack, ...]:
        """Select labelled tracks, with a signal.

        Args:
            sources: the permitted sources of the valid label, "person" or "robot".
            min_confidence: minimum `LabelRecord.confidence`; a label without confidence passes only 0.
            labels: the permitted classes; None permits all.

        Raises:
            DataError: an unknown source or class, or `min_confidence` is not a probability.
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
            and track.points
            and track.source in sources
            and (min_confidence == 0 or track.label_record.confidence >= min_confidence)
            and (labels is None or track.label in labels)
        )

    def trajectories(
        self, tracks: Sequence[StoredTrack] | None = None, *, points: int | None = None
    ) -> Array:
        """(cases, channels, time points) the trajectories of some tracks of this snapshot; by default of all.

        Shorter ones are padded with NaN, as in `Dataset`; one without a signal is NaN. A table has features,
        (cases, features).

        Args:
            points: maximum number of time points of a track, its last ones; None for all.

        Raises:
            FileError: the file cannot be read, or was changed or damaged after the snapshot.
        """
        tracks = self.tracks if tracks is None else tracks
        longest = max((track.points for track in tracks), default=self.schema.points or 2)
        width = longest if points is None else min(points, longest)
        numbers = np.full((len(tracks), len(self.schema.channels), width), np.nan)
        for row, array in zip(numbers, self.iterate_trajectories(tracks), strict=True):
            kept = array.reshape(len(row), -1)[:, -width:]
            row[:, : kept.shape[1]] = kept
        return numbers[..., 0] if self.schema.is_table else numbers

    def iterate_trajectories(self, tracks: Sequence[StoredTrack]) -> Iterator[Array]:
        """Yield the trajectory of each track, (channels, time points) or (features,), after another check.

        One without a signal is (channels, 0) or (features, 0).

        Raises:
            FileError: as `trajectories`.
        """
        channels = len(self.schema.channels)
        try:
            with closing(database.connect_reader(self.path)) as connection:
                for track in tracks:
                    rows = database.find_tracks(connection, track.record)
                    row = next((row for row in rows if row[1] == track.id and is_intact(row)), None)
                    if row is None:
                        raise DataError(f"record {track.record} is not track {track.id!r} as it was")
                    numbers = np.frombuffer(row[-2], FLOAT64)
                    yield numbers if self.schema.is_table and track.points else numbers.reshape(channels, -1)
        except (sqlite3.Error, DataError) as error:
            raise FileError(
                f"{self.path}: a track can no longer be read; the file was changed or damaged: {error}"
            ) from None

    def dataset(self, tracks: Sequence[StoredTrack] | None = None, *, points: int | None = None) -> Dataset:
        """Return labelled tracks as a data set, in their order; its notes describe damage to the store.

        Args:
            tracks: from `select`; None takes all labelled tracks.
            points: cut longer tracks to their last `points` time points. None takes the tracks as they are.

        Raises:
            DataError: a track has no label, or `points` is below 2 or given for features.
            FileError: as `trajectories`.
        """
        tracks = self.select() if tracks is None else tracks
        if points is not None:
            if self.schema.is_table:
                raise DataError(f"{self.path}: has features, which have no time points to cut")
            if points < 2:
                raise DataError(f"tracks cut to {points} time points show no motion; at least 2 are needed")
        labels = []
        for track in tracks:
            if track.label is None:
                raise DataError(f"{self.path}: track {track.id!r} has no label to learn from")
            labels.append(track.label)
        return Dataset(
            self.trajectories(tracks, points=points),
            tuple(labels),
            tuple(track.group for track in tracks),
            source=str(self.path),
            notes=tuple(map(str, self.damage)),
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

    def counts(self) -> Mapping[tuple[str | None, str], int]:
        """(label, source) -> number of tracks, in the order of the classes."""
        counts = Counter((track.label, track.source) for track in self.tracks)
        order = product((*self.schema.classes, None), SOURCES)
        return {key: counts[key] for key in order if counts[key]}

    def summary(self) -> str:
        """Return the number of tracks by class and source, as a phrase."""
        counts = ", ".join(
            f"{count} {label} by {'a person' if source == 'person' else 'report'}"
            if label is not None
            else f"{count} without a label"
            for (label, source), count in self.counts().items()
        )
        return f"{len(self)} {self.schema.unit}" + (f" ({counts})" if counts else "")


def is_store(path: str | Path) -> bool:
    """Whether a file is a store, by its name, *.tracks, or its first bytes."""
    path = Path(path)
    try:
        return path.is_file() and (path.suffix == ".tracks" or bool(database.detect_version(path)))
    except (DataError, OSError):  # e.g. a name that is too long
        return False


@check_arguments
def read_store(path: str | Path) -> Snapshot:
    """Read a store; this does not disturb a process that writes to it.

    A store of version 1 is converted to SQLite first, with a warning in the log.

    Raises:
        FileError: the file is missing or unreadable.
        DataError: the file is not a store, has a newer version, or its header is damaged.

    Examples:
        >>> from lcorpp.learning import NewTrack, Store, TrackSchema, read_store
        >>> with Store("read.tracks", TrackSchema(["x", "y"], 0.1, ["no", "yes"])) as store:
        ...     _ = store.append(NewTrack([[0.0, 0.1], [0.0, 0.0]], "yes"))
        >>> snapshot = read_store("read.tracks")
        >>> snapshot.tracks[0].label, snapshot.trajectories().tolist()
        ('yes', [[[0.0, 0.1], [0.0, 0.0]]])
    """
    path = Path(path)
    version = database.detect_version(path)
    if version is None:
        raise FileError(f"{path}: cannot be read: no such file")
    if version == 0:
        raise DataError(f"{path}: an empty file; expected a store of tracks")
    if version == 1:
        with closing(database.acquire_lock(path)):
            if database.detect_version(path) == 1:  # no other process was faster
                convert(path)
    return load_snapshot(path)


def load_snapshot(path: Path) -> Snapshot:
    """Read and check all records of the SQLite file at `path`; errors: as `read_store`."""
    tracks, intact, damage = dict[int, StoredTrack](), set[int](), dict[int, Damage]()
    try:
        with closing(database.connect_reader(path)) as connection:
            identity, schema = database.read_schema(connection)
            faults = database.iterate_faults(connection, path)
            structure = [Damage("; ".join(fault.splitlines()), structural=True) for fault in faults]
            for table in ("track", "later_label"):
                for row in database.iterate_rows(connection, table):
                    try:
                        track = _decode(row, table, tracks, schema)
                    except (DataError, RecursionError) as error:  # the second: extra data of great depth
                        damage[row[0]] = Damage(f"record {row[0]}: {error}", 1)
                    else:
                        tracks[track.record] = track
                        intact.add(row[0])
            if structure and not intact:
                raise DataError(f"no record is readable: {structure[0]}")
            last = max(database.read_last_record(connection), *intact, 0)
    except sqlite3.OperationalError as error:
        raise FileError(f"{path}: cannot be read: {error}") from None
    except (sqlite3.Error, DataError, ValueError, RecursionError) as error:
        raise DataError(f"{path}: a store whose header is damaged: {error}") from None
    known = sorted({0, last + 1, *(record for record in intact | damage.keys() if record <= last)})
    for before, after in pairwise(known):
        first, final = before + 1, after - 1
        if first <= final:
            which = f"record {first} is" if first == final else f"records {first} to {final} are"
            damage[first] = Damage(f"{which} missing", final - first + 1)
    ordered = tuple(tracks[record] for record in sorted(tracks))
    places = *structure, *(damage[record] for record in sorted(damage))
    return Snapshot(path, schema, ordered, len(intact), places, identity)


def _decode(row: Row, table: str, tracks: Mapping[int, StoredTrack], schema: TrackSchema) -> StoredTrack:
    """Return the track of a row of `track`, or that of a row of `later_label` with the label added."""
    if not is_intact(row):
        raise DataError("its checksum is wrong")
    if table == "track":
        return decode_track(row, schema)
    if row[1] not in tracks:
        raise DataError(f"it labels record {row[1]}, which is lost")
    track = tracks[row[1]]
    return replace(track, label_history=(*track.label_history, decode_label(row[2:-1], schema)))
