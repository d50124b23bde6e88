"""A trained classifier in one file: numbers and JSON, nothing that runs when it is loaded.

The file is a numpy archive (.npz). Its entry `classifier` is JSON: format and version, the steps of the
pipeline with their kind and parameters, and the confusion matrix. The entries `<step>/<name>` are what the
steps have learnt.
"""

from __future__ import annotations

import io
import json
import struct
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from sklearn.pipeline import Pipeline

from lcorpp.errors import DataError, expected
from lcorpp.files import read_bytes, write_atomically
from lcorpp.learning.classifier import TrainedClassifier
from lcorpp.learning.motion import Motion, Scaling
from lcorpp.values import ConfusionMatrix

FORMAT, VERSION = "lcorpp classifier", 1
NOT_KEPT = "progress"
"""The one parameter that is a function, and not part of what was learnt."""

DAMAGED = (
    *(ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError, MemoryError),
    *(EOFError, OSError, zipfile.BadZipFile, zlib.error, struct.error),
    *(SyntaxError, tokenize.TokenError),  # numpy reads the heads of arrays as Python
)
"""What numpy, zipfile, json and torch raise when bytes are not what they seem."""


def save_classifier(classifier: TrainedClassifier, path: str | Path) -> None:
    """Write a pipeline such as `paper_pipeline` makes, trained, with its confusion matrix.

    Raises:
        DataError: the classifier has a step of another kind, or is not trained.
        FileError: the file cannot be written.
    """
    if not isinstance(classifier.estimator, Pipeline):
        raise DataError(f"only a pipeline can be stored, not {type(classifier.estimator).__name__}")
    kinds = _kinds()
    steps, arrays = [], {}
    for name, step in classifier.estimator.steps:
        kind = type(step).__name__
        if kinds.get(kind) is not type(step):
            raise DataError(f"step {name!r} of kind {kind} cannot be stored; {expected(list(kinds))}")
        parameters = {key: value for key, value in step.get_params().items() if key != NOT_KEPT}
        steps.append({"name": name, "kind": kind, "parameters": parameters})
        try:
            arrays.update({f"{name}/{key}": value for key, value in step.to_arrays().items()})
        except (AttributeError, ValueError):  # scikit-learn's NotFittedError is both
            raise DataError(f"step {name!r} is not trained; nothing to store") from None
    matrix = classifier.confusion
    confusion = matrix and {"classes": list(matrix.classes), "counts": matrix.counts.tolist()}
    head = {"format": FORMAT, "version": VERSION, "steps": steps, "confusion": confusion}
    buffer = io.BytesIO()
    np.savez(buffer, classifier=np.array(json.dumps(head)), **arrays)
    write_atomically(path, buffer.getvalue())


def load_classifier(path: str | Path) -> TrainedClassifier:
    """Read what `save_classifier` wrote; it classifies exactly as the one that was saved.

    Raises:
        FileError: the file is missing or unreadable.
        DataError: it is not such a file, is damaged, of a newer version, or torch is not installed.
    """
    content = read_bytes(path)
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        head = json.loads(str(arrays.pop("classifier")))
        if head["format"] != FORMAT:
            raise DataError(f"its format is {head['format']!r}; expected {FORMAT!r}")
        if head["version"] != VERSION:
            raise DataError(f"its version is {head['version']!r}; this lcorpp reads version {VERSION}")
        steps = [(step["name"], _step(step, arrays)) for step in head["steps"]]
        matrix = head["confusion"]
        confusion = matrix and ConfusionMatrix(tuple(matrix["classes"]), np.array(matrix["counts"]))
        classes = tuple(str(name) for name in getattr(steps[-1][1], "classes_", ()))
        if not classes or (confusion and confusion.classes != classes):
            raise DataError(f"its last step tells {classes or 'no classes'} apart, its matrix {matrix}")
        return TrainedClassifier(Pipeline(steps), confusion)
    except DataError as error:
        raise DataError(f"{path}: not a classifier that can be used: {error}") from None
    except DAMAGED as error:
        raise DataError(f"{path}: not a stored classifier, or a damaged one: {error}") from None


def _kinds() -> dict[str, Any]:
    """The steps a stored pipeline may have, by name; only here does loading need torch."""
    from lcorpp.learning.lstm import LstmClassifier

    return {"Motion": Motion, "Scaling": Scaling, "LstmClassifier": LstmClassifier}


def _step(step: dict[str, Any], arrays: dict[str, npt.NDArray[Any]]) -> Any:
    kinds = _kinds()
    if step["kind"] not in kinds:
        raise DataError(f"step of unknown kind {step['kind']!r}; {expected(list(kinds))}")
    mine = f"{step['name']}/"
    own = {name.removeprefix(mine): value for name, value in arrays.items() if name.startswith(mine)}
    return kinds[step["kind"]](**step["parameters"]).from_arrays(own)
