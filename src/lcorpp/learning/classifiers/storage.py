"""A trained classifier in one file: numbers and JSON, nothing that runs when it is loaded.

The file is a numpy archive (.npz). Its entry `classifier` is JSON: format and version, the steps of the
pipeline with their kind and parameters, the confusion matrix, the calibration and the cut. The entries
`<step>/<name>` are what the steps have learnt. Steps of other kinds, such as forests, are kept by skops where
that is installed, see `foreign`; a pickle is neither written nor read.
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

from lcorpp.errors import DataError, expected_one_of
from lcorpp.files import read_bytes, write_atomically
from lcorpp.learning.classifiers.skops_storage import FOREIGN, pack, unpack
from lcorpp.learning.classifiers.trained import TrainedClassifier
from lcorpp.learning.evaluation.calibration import Calibration
from lcorpp.learning.evaluation.thresholds import Cut
from lcorpp.learning.features.motion import Motion, Scaling
from lcorpp.values import ConfusionMatrix

FORMAT, VERSION = "lcorpp classifier", 2
NOT_KEPT = "progress"
"""The one parameter that is a function, and not part of what was learnt."""

DAMAGED = (
    *(ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RuntimeError, MemoryError),
    *(EOFError, OSError, zipfile.BadZipFile, zlib.error, struct.error),
    *(SyntaxError, tokenize.TokenError),  # numpy reads the heads of arrays as Python
)
"""What numpy, zipfile, json and torch raise when bytes are not what they seem."""


def save_classifier(classifier: TrainedClassifier, path: str | Path) -> None:
    """Write a pipeline such as `learner` makes, trained, with its confusion matrix and calibration.

    Raises:
        DataError: the classifier is no pipeline, is not trained, or has a step that cannot be stored safely.
        FileError: the file cannot be written.
    """
    if not isinstance(classifier.estimator, Pipeline):
        raise DataError(f"only a pipeline can be stored, not {type(classifier.estimator).__name__}")
    kinds = _kinds()
    steps: list[dict[str, Any]] = []
    arrays: dict[str, Any] = {}
    for name, step in classifier.estimator.steps:
        kind = type(step).__name__
        if kinds.get(kind) is not type(step):
            steps.append({"name": name, "kind": FOREIGN, "parameters": {}})
            arrays[f"{name}/{FOREIGN}"] = pack(name, step, tuple(kinds))
            continue
        parameters = {key: value for key, value in step.get_params().items() if key != NOT_KEPT}
        steps.append({"name": name, "kind": kind, "parameters": parameters})
        try:
            arrays.update({f"{name}/{key}": value for key, value in step.to_arrays().items()})
        except (AttributeError, ValueError):  # scikit-learn's NotFittedError is both
            raise DataError(f"step {name!r} is not trained; nothing to store") from None
    matrix = classifier.confusion
    confusion = matrix and {"classes": list(matrix.classes), "counts": matrix.counts.tolist()}
    head = {
        "format": FORMAT,
        "version": VERSION,
        "steps": steps,
        "confusion": confusion,
        "calibration": classifier.calibration and classifier.calibration.to_json(),
        "cut": classifier.cut and [classifier.cut.name, classifier.cut.probability],
    }
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
        calibration = head["calibration"] and Calibration.from_json(head["calibration"])
        cut = head["cut"] and Cut(str(head["cut"][0]), float(head["cut"][1]))
        if (calibration and calibration.classes != classes) or (cut and cut.name not in classes):
            raise DataError(
                f"its last step tells {', '.join(classes)} apart, its calibration or cut does not"
            )
        return TrainedClassifier(Pipeline(steps), confusion, calibration, cut)
    except DataError as error:
        raise DataError(f"{path}: not a classifier that can be used: {error}") from None
    except DAMAGED as error:
        raise DataError(f"{path}: not a stored classifier, or a damaged one: {error}") from None


def _kinds() -> dict[str, Any]:
    """The steps a stored pipeline may have, by name; only here does loading need torch."""
    from lcorpp.learning.classifiers.logistic import QuadraticLogistic
    from lcorpp.learning.features.summaries import Summaries
    from lcorpp.learning.lstm import LstmClassifier

    known = (Motion, Scaling, LstmClassifier, Summaries, QuadraticLogistic)
    return {kind.__name__: kind for kind in known}


def _step(step: dict[str, Any], arrays: dict[str, npt.NDArray[Any]]) -> Any:
    kinds = _kinds()
    mine = f"{step['name']}/"
    own = {name.removeprefix(mine): value for name, value in arrays.items() if name.startswith(mine)}
    if step["kind"] == FOREIGN:
        return unpack(step["name"], own[FOREIGN])
    if step["kind"] not in kinds:
        raise DataError(f"step of unknown kind {step['kind']!r}; {expected_one_of(list(kinds))}")
    parameters = {  # JSON has no tuples
        key: tuple(value) if isinstance(value, list) else value for key, value in step["parameters"].items()
    }
    return kinds[step["kind"]](**parameters).from_arrays(own)


def check_storable(estimator: Any) -> None:
    """Reject an unfitted estimator that `save_classifier` cannot store once it is fitted.

    Raises:
        DataError: the estimator is no pipeline, or has a step that cannot be stored safely.
    """
    if not isinstance(estimator, Pipeline):
        raise DataError(f"only a pipeline can be stored, not {type(estimator).__name__}")
    kinds = _kinds()
    for name, step in estimator.steps:
        if kinds.get(type(step).__name__) is not type(step):
            pack(name, step, tuple(kinds))
