"""Run store: the tracks of a run of Algorithm 1 and a checkpoint of every training, to resume it.

`append_decision` returns when the decision is on the disk, `save_checkpoint` when the batch is. After an
interruption of any kind the next run resumes there. The store is authoritative: without a usable checkpoint
the classifier is trained again, and nothing else is lost.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self
from uuid import uuid4

import numpy as np

from lcorpp.decision import Batch, ResumePoint
from lcorpp.decision.lcorpp import compute_ssub
from lcorpp.errors import DataError, FileError
from lcorpp.files import make_folder, read_bytes, read_text, sync_folder, write_atomically
from lcorpp.learning import SoftClassifier, TrainedClassifier, load_classifier, save_classifier
from lcorpp.learning.store import NewTrack, Snapshot, Store, StoredTrack, TrackSchema
from lcorpp.protocols import Classifier
from lcorpp.values import Array, ConfusionMatrix, Dataset, Distribution, track_hash

FORMAT, VERSION = "lcorpp checkpoint", 1

Train = Callable[[Dataset], tuple[Classifier, ConfusionMatrix]]
Rows = list[dict[str, float | int | str]]


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """The state of a run after a training.

    run: a name shared by all decisions since the first training. number, confusion, change: as in `Batch`.
    records: number of records in the store, without the decisions of an incomplete batch.
    rows: results of the batches. classifier: None if its type cannot be stored.
    """

    run: str
    number: int
    confusion: ConfusionMatrix
    change: float
    records: int
    rows: Rows
    classifier: Classifier | None


class RunStore:
    """The store of a run and its checkpoint in the folder `<store>.checkpoint`; for one process at a time.

    store: open for writing. notes: warnings from opening the store and reading its checkpoint, as sentences.
    pending: the stored decisions since the last training.
    n_people: number of people that the run has drawn so far, in all batches.
    """

    def __init__(
        self, path: str | Path, dataset: Dataset, classes: Sequence[str], settings: Mapping[str, Any]
    ):
        """Open or create the store at `path` and read the checkpoint of an earlier run.

        Args:
            dataset: the initial data; the tracks of the store have the same schema.
            classes: the classes of the sense that learns.
            settings: everything else that a training depends on, as JSON can represent it, e.g. the seed; a
                checkpoint with other settings is not used.

        Raises:
            FileError, DataError: as `Store`.
        """
        self.store = Store(path, TrackSchema.from_dataset(dataset, classes))
        self._initial = dataset
        self._settings = {**settings, "data": _compute_digest(dataset)}
        self._folder = self.store.path.with_name(f"{self.store.path.name}.checkpoint")
        self.notes = list(self.store.notes)
        try:
            snapshot = self.store.snapshot()
            self._checkpoint = self._read_checkpoint(snapshot)
            self._run = self._checkpoint.run if self._checkpoint else uuid4().hex[:12]
            self._number = self._checkpoint.number if self._checkpoint else 0
            batch = self._run, self._number + 1
            self.pending = tuple(
                stored for stored in snapshot if (stored.extra.get("run"), stored.extra.get("batch")) == batch
            )
            met = [stored.extra.get("met") for stored in snapshot]
            self.n_people = 1 + max((number for number in met if type(number) is int), default=-1)
        except BaseException:
            self.store.close()
            raise

    @property
    def number(self) -> int | None:
        """The last completed batch of the resumed run; None for a new run."""
        return self._checkpoint.number if self._checkpoint else None

    @property
    def rows(self) -> Rows:
        """Batch results reported by the resumed run."""
        return list(self._checkpoint.rows) if self._checkpoint else []

    def dataset(self, without: Sequence[StoredTrack] = ()) -> Dataset:
        """Return Omega: the initial data and the labelled tracks of the store, but for those in `without`."""
        excluded = {track.id for track in without}
        snapshot = self.store.snapshot()
        added = snapshot.dataset([track for track in snapshot.select() if track.id not in excluded])
        return self._initial.append(list(zip(added.trajectories, added.labels, strict=True)), added.groups)

    def resume(self, train: Train) -> ResumePoint | None:
        """Return the state in which the earlier run ended; None for a new run.

        Args:
            train: trains a classifier if the checkpoint has none, or if people have labelled tracks since.
        """
        checkpoint = self._checkpoint
        if checkpoint is None:
            return None
        since = self.store.last_record - len(self.pending) - checkpoint.records
        if since:
            self.notes.append(
                f"{since} records were added by persons or another run: trained again"
                if since > 0
                else f"{-since} records that the last training used are lost: trained again"
            )
            classifier, confusion = train(self.dataset())
            change = compute_ssub(checkpoint.confusion.probabilities, confusion.probabilities)
            return ResumePoint(checkpoint.number, classifier, confusion, change, len(self.pending))
        trained = checkpoint.classifier
        if trained is None:
            trained, _ = train(self.dataset(without=self.pending))
        return ResumePoint(
            checkpoint.number, trained, checkpoint.confusion, checkpoint.change, len(self.pending)
        )

    def append_decision(
        self,
        signal: Array,
        context: Mapping[str, str],
        label: str | None,
        belief: Distribution,
        extra: Mapping[str, Any],
    ) -> str:
        """Store a decision: the signal, the reported class and the belief behind it.

        The decision is on the disk when this method returns.

        Args:
            label: the class by the robot's report, None without a report.
            belief: over the classes, when the robot reported.
            extra: further data to store, e.g. the simulated truth.

        Returns:
            The id of the track.
        """
        track = NewTrack(
            signal,
            label,
            belief=belief,
            context=context,
            id=f"{self._run}-{self.n_people}",
            extra={"run": self._run, "batch": self._number + 1, "met": self.n_people, **extra},
        )
        id = self.store.append(track)
        self.n_people += 1
        return id

    def save_checkpoint(self, batch: Batch, rows: Rows) -> None:
        """Write the checkpoint of a batch, whole or not at all.

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
            "store": self.store.identity,
            "settings": self._settings,
            "run": self._run,
            "number": batch.number,
            "classes": batch.confusion.classes,
            "counts": batch.confusion.counts.tolist(),
            "change": batch.change,
            "records": self.store.last_record - len(self.pending),
            "rows": rows,
            "classifier": self._write_classifier(batch),
        }
        write_atomically(self._file, json.dumps(content, indent=1) + "\n")
        sync_folder(self._file)
        current = {self._file.name, content["classifier"] and content["classifier"]["file"]}
        prefixes = ("classifier-", ".classifier-", ".checkpoint.")
        for file in self._folder.iterdir():  # remove the files of earlier checkpoints, or of a killed process
            if file.name not in current and file.name.startswith(prefixes):
                file.unlink(missing_ok=True)

    def __repr__(self) -> str:
        state = "new run" if self.number is None else f"resumed after batch {self.number}"
        return f"RunStore({str(self.store.path)!r}, {state}, {len(self.pending)} decisions since)"

    def close(self) -> None:
        """Close the store, so that another process can write to it."""
        self.store.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    @property
    def _file(self) -> Path:
        return self._folder / "checkpoint.json"

    def _write_classifier(self, batch: Batch) -> dict[str, Any] | None:
        """Write the classifier to a file of a new name and describe it; None if its type cannot be stored."""
        classifier = batch.classifier
        trained = classifier.trained if isinstance(classifier, SoftClassifier) else classifier
        if not isinstance(trained, TrainedClassifier):
            return None
        path = self._folder / f"classifier-{batch.number}-{uuid4().hex[:8]}.npz"
        try:
            save_classifier(trained, path)
        except DataError:
            return None  # it is trained again at the next start
        sync_folder(path)
        return {"file": path.name, "crc32": zlib.crc32(read_bytes(path)), "soft": trained is not classifier}

    def _read_checkpoint(self, snapshot: Snapshot) -> Checkpoint | None:
        """Return the checkpoint if it fits this store and these settings; otherwise note the reason."""
        if not self._file.exists():
            if len(snapshot):
                self.notes.append(f"{self._file}: no checkpoint; trained on all that is stored")
            return None
        try:
            content = json.loads(read_text(self._file))
            if (content["format"], content["version"]) != (FORMAT, VERSION):
                raise DataError(f"it is {content['format']!r}, version {content['version']!r}")
            if content["store"] != self.store.identity:
                raise DataError("it belongs to another store")
            for name, value in self._settings.items():
                if content["settings"].get(name) != value:
                    raise DataError(f"{name} was {content['settings'].get(name)}, and is {value} now")
            return Checkpoint(
                str(content["run"]),
                _check_count(content["number"]),
                ConfusionMatrix(tuple(content["classes"]), np.array(content["counts"])),
                float(content["change"]),
                _check_count(content["records"]),
                list(content["rows"]),
                self._read_classifier(content["classifier"]),
            )
        except (DataError, FileError) as error:
            why = str(error)
        except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
            why = f"it is damaged ({type(error).__name__}: {error})"
        self.notes.append(f"{self._file}: not used, {why}; trained on all that is stored")
        return None

    def _read_classifier(self, about: Mapping[str, Any] | None) -> Classifier | None:
        """Load the classifier that the checkpoint describes; None, with a note, if its file is unusable."""
        if about is None:
            return None
        path = self._folder / Path(about["file"]).name
        try:
            if zlib.crc32(read_bytes(path)) != about["crc32"]:
                raise DataError(f"{path}: differs from the file that was written")
            trained = load_classifier(path)
            return trained.soft() if about["soft"] else trained
        except (DataError, FileError) as error:
            self.notes.append(f"{error}; trained again")
            return None


def _compute_digest(dataset: Dataset) -> str:
    """Return a text that only equal data sets share; it identifies the initial data, which are not stored."""
    labels = zlib.crc32("\n".join(dataset.labels).encode())
    return f"{len(dataset)} tracks, {track_hash(dataset.trajectories).removeprefix('track ')}-{labels:08x}"


def _check_count(value: Any) -> int:
    if type(value) is not int or value < 0:
        raise ValueError(f"{value!r} is no number of batches or records")
    return value
