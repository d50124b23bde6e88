"""What outlives a run of Algorithm 1: the store of tracks, and a checkpoint of every training.

A decision is in the store when its listener returns; a batch is in the checkpoint when it is saved. Whatever
ends a run in between, the next one goes on from there: the store is the truth, and a checkpoint that is lost
or damaged costs a training and nothing else.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self
from uuid import uuid4

import numpy as np

from lcorpp.decision import Batch, ResumePoint
from lcorpp.decision.lcorpp import ssub
from lcorpp.errors import DataError, FileError
from lcorpp.files import make_folder, read_bytes, read_text, sync_folder, write_atomically
from lcorpp.learning import SoftClassifier, TrainedClassifier, load_classifier, save_classifier
from lcorpp.learning.store import NewTrack, Snapshot, Store, StoredTrack, TrackSchema
from lcorpp.protocols import Classifier
from lcorpp.values import ConfusionMatrix, Dataset, Distribution, Episode, Instance, track_hash

FORMAT, VERSION = "lcorpp checkpoint", 1

Learn = Callable[[Dataset], tuple[Classifier, ConfusionMatrix]]
Rows = list[dict[str, float | int | str]]


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """What stood after a training.

    run: a name that all decisions since the first training share. number, confusion, change: see `Batch`.
    records: how many of the store were known then, apart from decisions of a batch not yet completed.
    rows: what the run has told of its batches. classifier: None where its kind cannot be stored.
    """

    run: str
    number: int
    confusion: ConfusionMatrix
    change: float
    records: int
    rows: Rows
    classifier: Classifier | None


class RunStore:
    """The store and the checkpoint beside it, in the folder `<store>.checkpoint`; one process at a time.

    store: open for writing. notes: what opening found, in words.
    """

    def __init__(
        self, path: str | Path, dataset: Dataset, classes: Sequence[str], settings: Mapping[str, Any]
    ):
        """Open the store at `path`, or make it, and see whether an earlier run can be gone on with.

        Args:
            dataset: the data to begin with; the store takes tracks of their kind.
            classes: the values of the target.
            settings: what else a training depends on, as JSON can hold it, e.g. the seed; a checkpoint of
                other settings is not used.

        Raises:
            FileError, DataError: as `Store`.
        """
        self.store = Store(path, TrackSchema.of(dataset, classes))
        self._initial = dataset
        self._settings = {**settings, "data": _digest(dataset)}
        self._folder = self.store.path.with_name(f"{self.store.path.name}.checkpoint")
        self.notes = list(self.store.notes)
        try:
            reading = self.store.snapshot()
            self._checkpoint = self._found(reading)
            self._run = self._checkpoint.run if self._checkpoint else uuid4().hex[:12]
            self._number = self._checkpoint.number if self._checkpoint else 0
            self.pending = tuple(stored for stored in reading if self._is_pending(stored))
            self.n_people = 1 + max((_whole(stored.extra.get("met")) for stored in reading), default=-1)
        except BaseException:
            self.store.close()
            raise

    @property
    def number(self) -> int | None:
        """The last batch that the run to go on with has completed; None where none is gone on with."""
        return self._checkpoint.number if self._checkpoint else None

    @property
    def rows(self) -> Rows:
        """What the run that is gone on with has told of its batches."""
        return list(self._checkpoint.rows) if self._checkpoint else []

    def dataset(self) -> Dataset:
        """The data to begin with and all that is stored with a label: Omega."""
        return self._extended(())

    def resume(self, learn: Learn) -> ResumePoint | None:
        """Where the earlier run ended; None where there is none to go on with.

        Args:
            learn: trains a classifier where the checkpoint holds none, or anew where persons have labelled
                tracks since.
        """
        checkpoint = self._checkpoint
        if checkpoint is None:
            return None
        since = self.store.last - len(self.pending) - checkpoint.records
        if since:
            self.notes.append(
                f"{since} records were added since, by persons or another run: trained anew"
                if since > 0
                else f"{-since} records that the last training knew are lost: trained anew"
            )
            classifier, confusion = learn(self.dataset())
            change = ssub(checkpoint.confusion.probabilities, confusion.probabilities)
            return ResumePoint(checkpoint.number, classifier, confusion, change, len(self.pending))
        trained = checkpoint.classifier
        if trained is None:
            trained, _ = learn(self._extended(self.pending))
        return ResumePoint(
            checkpoint.number, trained, checkpoint.confusion, checkpoint.change, len(self.pending)
        )

    def append_decision(
        self, instance: Instance, episode: Episode, belief: Distribution, extra: Mapping[str, Any]
    ) -> str:
        """Store a decision: the track, the reported label and the belief behind it; on the disk afterwards.

        Args:
            belief: over the target's values, when the robot reported.
            extra: what else to keep, e.g. what a simulation knows of the truth.

        Returns:
            Its id.
        """
        about = {"run": self._run, "batch": self._number + 1, "met": self.n_people, **extra}
        entry = NewTrack(
            instance.trajectory,
            episode.report,
            "robot",
            belief,
            instance.context,
            id=f"{self._run}-{self.n_people}",
            extra=about,
        )
        id = self.store.append(entry)
        self.n_people += 1
        return id

    def save_checkpoint(self, batch: Batch, rows: Rows) -> None:
        """Write the checkpoint of a batch: all of it or, after a crash, the one before.

        Raises:
            FileError: it cannot be written.
        """
        if batch.number != self._number:
            self._number, self.pending = batch.number, ()
        make_folder(self._folder)
        sync_folder(self._folder)
        content = {
            "format": FORMAT,
            "version": VERSION,
            "store": self.store.marker,
            "settings": self._settings,
            "run": self._run,
            "number": batch.number,
            "classes": batch.confusion.classes,
            "counts": batch.confusion.counts.tolist(),
            "change": batch.change,
            "records": self.store.last - len(self.pending),
            "rows": rows,
            "classifier": self._classifier_file(batch),
        }
        write_atomically(self._file, json.dumps(content, indent=1) + "\n")
        sync_folder(self._file)
        kept = {self._file.name, content["classifier"] and content["classifier"]["file"]}
        for (
            file
        ) in self._folder.iterdir():  # of earlier checkpoints, or half written when a process was killed
            if file.name not in kept and file.name.startswith(
                ("classifier-", ".classifier-", ".checkpoint.")
            ):
                file.unlink(missing_ok=True)

    def close(self) -> None:
        """Let another process write."""
        self.store.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def _file(self) -> Path:
        return self._folder / "checkpoint.json"

    def _extended(self, without: Sequence[StoredTrack]) -> Dataset:
        left = {stored.id for stored in without}
        reading = self.store.snapshot()
        chosen = [stored for stored in reading.select() if stored.id not in left]
        stored = reading.dataset(chosen)
        return self._initial.append(list(zip(stored.trajectories, stored.labels, strict=True)), stored.groups)

    def _is_pending(self, stored: StoredTrack) -> bool:
        return stored.extra.get("run") == self._run and stored.extra.get("batch") == self._number + 1

    def _classifier_file(self, batch: Batch) -> dict[str, Any] | None:
        """Write the classifier under a name of its own; None where its kind cannot be stored."""
        soft = isinstance(batch.classifier, SoftClassifier)
        trained = (
            batch.classifier.trained if isinstance(batch.classifier, SoftClassifier) else batch.classifier
        )
        if not isinstance(trained, TrainedClassifier):
            return None
        path = self._folder / f"classifier-{batch.number}-{uuid4().hex[:8]}.npz"
        try:
            save_classifier(trained, path)
        except DataError:
            return None  # trained once more at the next start
        sync_folder(path)
        return {"file": path.name, "crc32": zlib.crc32(read_bytes(path)), "soft": soft}

    def _found(self, reading: Snapshot) -> Checkpoint | None:
        """The checkpoint, if it is one of this store and these settings; what is wrong with it is noted."""
        if not self._file.exists():
            if len(reading):
                self.notes.append(f"{self._file}: no checkpoint; trained on all that is stored")
            return None
        try:
            content = json.loads(read_text(self._file))
            if (content["format"], content["version"]) != (FORMAT, VERSION):
                raise DataError(f"it is {content['format']!r}, version {content['version']!r}")
            if content["store"] != self.store.marker:
                raise DataError("it belongs to another store")
            for name, value in self._settings.items():
                if content["settings"].get(name) != value:
                    raise DataError(f"{name} was {content['settings'].get(name)}, and is {value} now")
            return Checkpoint(
                str(content["run"]),
                _number(content["number"]),
                ConfusionMatrix(tuple(content["classes"]), np.array(content["counts"])),
                float(content["change"]),
                _number(content["records"]),
                list(content["rows"]),
                self._classifier(content["classifier"]),
            )
        except (DataError, FileError) as error:
            why = str(error)
        except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
            why = f"it is damaged ({type(error).__name__}: {error})"
        self.notes.append(f"{self._file}: not used, {why}; trained on all that is stored")
        return None

    def _classifier(self, about: Mapping[str, Any] | None) -> Classifier | None:
        if about is None:
            return None
        path = self._folder / Path(about["file"]).name
        try:
            if zlib.crc32(read_bytes(path)) != about["crc32"]:
                raise DataError(f"{path}: is not as it was written")
            trained = load_classifier(path)
            return trained.soft() if about["soft"] else trained
        except (DataError, FileError) as error:
            self.notes.append(f"{error}; trained once more")
            return None


def _digest(dataset: Dataset) -> str:
    """A name that equal data sets share: the initial data are not stored, but made or read again."""
    labels = zlib.crc32("\n".join(dataset.labels).encode())
    return f"{len(dataset)} tracks, {track_hash(dataset.trajectories).removeprefix('track ')}-{labels:08x}"


def _number(value: Any) -> int:
    if type(value) is not int or value < 0:
        raise ValueError(f"{value!r} is no number of batches or records")
    return value


def _whole(value: Any) -> int:
    return value if type(value) is int else -1
