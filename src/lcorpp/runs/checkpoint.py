"""Checkpoints of Algorithm 1: the state after a training, in a folder beside the store of the run."""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from lcorpp.decision import TrainedSense
from lcorpp.errors import DataError, FileError
from lcorpp.files import make_folder, read_bytes, read_text, sync_folder, write_atomically
from lcorpp.learning import SoftClassifier, TrainedClassifier, load_classifier, save_classifier
from lcorpp.protocols import Classifier
from lcorpp.values import ConfusionMatrix, EvidenceKind
from lcorpp.versioned_json import JsonFormat

FORMAT = JsonFormat("lcorpp checkpoint", 3, older=(1, 2))
"""Version 1 was of one sense, whose values were not in a table `senses`; 2 had no previous counts."""

Json = Mapping[str, Any]
Rows = list[dict[str, Any]]


@dataclass(frozen=True, eq=False)
class SenseCheckpoint:
    """The state of a sense after a training.

    confusion, previous, against_reports: as in `TrainedSense`.
    records: number of records in its store, without the decisions of an incomplete batch.
    classifier: None if its type cannot be stored.
    """

    confusion: ConfusionMatrix
    previous: ConfusionMatrix
    records: int
    classifier: Classifier | None
    against_reports: ConfusionMatrix | None = None


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """The state of a run after a training.

    run: a name shared by all decisions since the first training. number: as in `Batch`.
    rows: results of the batches. senses: the senses that learn.
    session: name -> state of what learns from people, see `LearningSession.state`; None without such.
    """

    run: str
    number: int
    rows: Rows
    senses: Mapping[str, SenseCheckpoint]
    session: Json | None = None


class CheckpointFolder:
    """The folder of a checkpoint, with the classifiers.

    Args:
        path: the folder; it need not exist.
        identity: of the store to which the checkpoint belongs.
        settings: what a training depends on; a checkpoint with other settings is not used.
    """

    def __init__(self, path: Path, identity: str, settings: Mapping[str, Any]) -> None:
        self._path, self._identity, self._settings = path, identity, settings
        self._file = path / "checkpoint.json"

    def write(
        self,
        run: str,
        number: int,
        rows: Rows,
        senses: Mapping[str, TrainedSense],
        records: Mapping[str, int],
        session: Json | None = None,
    ) -> None:
        """Write a checkpoint, whole or not at all. Arguments: as the fields of `Checkpoint`.

        Raises:
            FileError: it cannot be written.
        """
        make_folder(self._path)
        sync_folder(self._path)
        described = {
            name: {
                **sense.confusion.to_json(),
                "previous": sense.previous.counts.tolist(),
                "previous_effective_cases": sense.previous.to_json().get("effective_cases"),
                "against_reports": sense.against_reports and sense.against_reports.counts.tolist(),
                "records": records[name],
                "classifier": self._write_classifier(sense.classifier, number),
            }
            for name, sense in senses.items()
        }
        content = {
            **FORMAT.header,
            "store": self._identity,
            "settings": self._settings,
            "run": run,
            "number": number,
            "rows": rows,
            "senses": described,
            **({} if session is None else {"session": session}),
        }
        write_atomically(self._file, json.dumps(content, indent=1) + "\n")
        sync_folder(self._file)
        files = [sense["classifier"]["file"] for sense in described.values() if sense["classifier"]]
        current, prefixes = {self._file.name, *files}, ("classifier-", ".classifier-", ".checkpoint.")
        for file in self._path.iterdir():  # remove the files of earlier checkpoints, or of a killed process
            if file.name not in current and file.name.startswith(prefixes):
                file.unlink(missing_ok=True)

    def read(self, names: Iterable[str], has_records: bool, note: Callable[[str], None]) -> Checkpoint | None:
        """Return the checkpoint if it fits the store, the settings and the senses; otherwise note the reason.

        Args:
            names: of the senses that learn. has_records: whether the store contains anything.
        """
        if not self._file.exists():
            if has_records:
                note(f"{self._file}: no checkpoint; trained on all that is stored")
            return None
        try:
            return self._decode(FORMAT.read(read_text(self._file)), list(names), note)
        except (DataError, FileError) as error:
            why = str(error)
        except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError) as error:
            why = f"it is damaged ({type(error).__name__}: {error})"
        note(f"{self._file}: not used, {why}; trained on all that is stored")
        return None

    def _decode(
        self, content: Mapping[str, Any], names: list[str], note: Callable[[str], None]
    ) -> Checkpoint:
        """Return the checkpoint that the content of its file describes; errors: as `read` catches them."""
        if content["store"] != self._identity:
            raise DataError("it belongs to another store")
        before = {"labels": "hard"} | content["settings"]  # checkpoints of older versions have no labels
        for name, value in self._settings.items():
            if before.get(name) != value:
                raise DataError(f"{name} was {before.get(name)}, and is {value} now")
        senses = content["senses"] if content["version"] != 1 else {names[0]: content}
        if list(senses) != names:
            raise DataError(f"the senses that learn were {', '.join(senses)}, and are {', '.join(names)} now")
        return Checkpoint(
            str(content["run"]),
            _check_count(content["number"]),
            list(content["rows"]),
            {
                name: SenseCheckpoint(
                    _read_matrix(sense, "counts"),
                    _read_matrix(sense, "previous" if "previous" in sense else None),
                    _check_count(sense["records"]),
                    self._read_classifier(sense["classifier"], note),
                    _read_matrix(sense, "against_reports") if sense.get("against_reports") else None,
                )
                for name, sense in senses.items()
            },
            _check_states(content.get("session")),
        )

    def _write_classifier(self, classifier: Classifier, number: int) -> dict[str, Any] | None:
        """Write the classifier to a file of a new name and describe it; None if its type cannot be stored."""
        trained = classifier.trained if isinstance(classifier, SoftClassifier) else classifier
        if not isinstance(trained, TrainedClassifier):
            return None
        path = self._path / f"classifier-{number}-{uuid4().hex[:8]}.npz"
        try:
            save_classifier(trained, path)
        except DataError:
            return None  # it is trained again at the next start
        sync_folder(path)
        kind = classifier.evidence if isinstance(classifier, SoftClassifier) else EvidenceKind()
        return {"file": path.name, "crc32": zlib.crc32(read_bytes(path)), "evidence": kind.name}

    def _read_classifier(
        self, about: Mapping[str, Any] | None, note: Callable[[str], None]
    ) -> Classifier | None:
        """Load the classifier that the checkpoint describes; None, with a note, if its file is unusable."""
        if about is None:
            return None
        path = self._path / Path(about["file"]).name
        try:
            if zlib.crc32(read_bytes(path)) != about["crc32"]:
                raise DataError(f"{path}: differs from the file that was written")
            trained = load_classifier(path)
            former = "soft" if about.get("soft") else "hard"  # of older versions
            return trained.as_evidence(EvidenceKind(about.get("evidence", former)))
        except (DataError, FileError) as error:
            note(f"{error}; trained again")
            return None


def _read_matrix(sense: Mapping[str, Any], name: str | None) -> ConfusionMatrix:
    """Return a matrix of a sense, without counts if it has no name."""
    counts = sense[name] if name else np.zeros_like(np.array(sense["counts"]))
    prefix = "previous_" if name == "previous" else ""
    cases = None if name == "against_reports" else sense.get(f"{prefix}effective_cases")
    return ConfusionMatrix.from_json(
        {"classes": sense["classes"], "counts": counts, "effective_cases": cases}
    )


def _check_states(session: dict[str, Any] | None) -> Json | None:
    if session is not None and not all(isinstance(state, dict) for state in session.values()):
        raise ValueError("the session has no states")
    return session


def _check_count(value: Any) -> int:
    if type(value) is not int or value < 0:
        raise ValueError(f"{value!r} is not a number of batches or records")
    return value
