"""Storage of a trained classifier in one file of numbers and JSON; loading it executes nothing.

The file is a numpy archive (.npz). Its entry `classifier` is JSON: format and version, the kind and
parameters of each step of the pipeline, the confusion matrix, the calibration, the decision threshold, the
prediction sets and the names of the channels or features. The entries `<step>/<name>` are the fitted arrays
of the steps. Steps of other libraries, such as forests, are stored by skops if it is installed, see
`skops_storage`; pickles are neither written nor read.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy.typing as npt
from sklearn.pipeline import Pipeline

from lcorpp.archives import locate_damage, pack_archive, unpack_archive
from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError, expected_one_of
from lcorpp.files import read_bytes, write_atomically
from lcorpp.learning.classifiers.skops_storage import SKOPS, dump_step, load_step
from lcorpp.learning.classifiers.trained import TrainedClassifier
from lcorpp.learning.evaluation.calibration import Calibration
from lcorpp.learning.evaluation.prediction_sets import PredictionSets
from lcorpp.learning.evaluation.thresholds import DecisionThreshold
from lcorpp.learning.features.motion import ChannelStandardizer, Motion
from lcorpp.learning.features.segments import SegmentStatistics
from lcorpp.learning.features.summaries import SummaryFeatures
from lcorpp.learning.lstm import LstmClassifier
from lcorpp.values import ConfusionMatrix
from lcorpp.versioned_json import JsonFormat

FORMAT = JsonFormat("lcorpp classifier", 2)
CALLBACK = "progress"
"""The parameter that is a function and is not stored."""

STORED_NAMES = {"Motion": {"features": "channels"}, "QuadraticLogistic": {"C": "strength"}}
"""Kind of step -> parameter -> its name in files, if it has another one there."""


@check_arguments
def save_classifier(classifier: TrainedClassifier, path: str | Path) -> None:
    """Write a trained pipeline, e.g. of a `learner`, with its error rates, calibration, threshold and sets.

    Raises:
        DataError: the classifier is not a pipeline, is not trained, or has a step that cannot be stored
            safely.
        FileError: the file cannot be written.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import learner, load_classifier, save_classifier, train
        >>> data = Dataset([[0.1 * n] for n in range(20)], 10 * ["stands"] + 10 * ["walks"])  # speeds in m/s
        >>> classifier = train(learner("logistic", inputs=data.channels, kind=data.kind), data)
        >>> save_classifier(classifier, "walking.npz")
        >>> load_classifier("walking.npz").classify([1.3])
        'walks'
    """
    kinds = _native_kinds()
    names = {kind: name for name, kind in kinds.items()}
    steps: list[dict[str, Any]] = []
    arrays: dict[str, Any] = {}
    for name, step in _list_steps(classifier.estimator):
        kind = names.get(type(step), SKOPS)
        parameters: dict[str, Any] = {}
        if kind == SKOPS:
            arrays[f"{name}/{SKOPS}"] = dump_step(name, step, tuple(kinds))
        else:
            stored_names = STORED_NAMES.get(kind, {})
            for key, value in step.get_params().items():
                if key != CALLBACK:
                    parameters[stored_names.get(key, key)] = value
            try:
                arrays.update({f"{name}/{key}": value for key, value in step.to_arrays().items()})
            except (AttributeError, ValueError):  # scikit-learn's NotFittedError is both
                raise DataError(f"step {name!r} is not trained; nothing to store") from None
        steps.append({"name": name, "kind": kind, "parameters": parameters})
    matrix, threshold = classifier.confusion, classifier.threshold
    header: dict[str, Any] = {
        "steps": steps,
        "confusion": matrix and matrix.to_json(),
        "calibration": classifier.calibration and classifier.calibration.to_json(),
        "cut": threshold and [threshold.name, threshold.probability],
    }
    if classifier.prediction_sets is not None:
        header["sets"] = classifier.prediction_sets.to_json()
    if classifier.inputs:
        header["inputs"] = classifier.inputs
    write_atomically(path, pack_archive(FORMAT, header, arrays, compress=False))


@check_arguments
def load_classifier(path: str | Path) -> TrainedClassifier:
    """Read a file of `save_classifier`; the loaded classifier gives exactly the same probabilities.

    Raises:
        FileError: the file is missing or unreadable.
        DataError: the file is not a stored classifier, is damaged, of another version, or needs skops.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import learner, load_classifier, save_classifier, train
        >>> data = Dataset([[0.2], [0.3], [1.2], [1.3]], 2 * ["stands"] + 2 * ["walks"], channels=["speed"])
        >>> save_classifier(train(learner("logistic", inputs=data.channels), data), "walking.npz")
        >>> classifier = load_classifier("walking.npz")
        >>> classifier.inputs, classifier.classes
        (('speed',), ('stands', 'walks'))
    """
    content = read_bytes(path)
    with locate_damage(path, "classifier"):
        header, arrays = unpack_archive(FORMAT, content)
        steps = [(step["name"], _load_step(step, arrays)) for step in header["steps"]]
        matrix = header["confusion"]
        confusion = matrix and ConfusionMatrix.from_json(matrix)
        classes = tuple(str(name) for name in getattr(steps[-1][1], "classes_", ()))
        if not classes or (confusion and confusion.classes != classes):
            raise DataError(
                f"the classes of its last step are {classes or 'missing'}, those of its matrix {matrix}"
            )
        calibration = header["calibration"] and Calibration.from_json(header["calibration"])
        cut = header["cut"]
        threshold = cut and DecisionThreshold(str(cut[0]), float(cut[1]))
        sets = PredictionSets.from_json(header["sets"]) if header.get("sets") else None
        if any(part and part.classes != classes for part in (calibration, sets)) or (
            threshold and threshold.name not in classes
        ):
            raise DataError(
                f"the classes of its last step are {', '.join(classes)}; its prediction sets, calibration or"
                " threshold is for others"
            )
        inputs = tuple(map(str, header.get("inputs", ())))
        return TrainedClassifier(Pipeline(steps), confusion, calibration, threshold, inputs, sets)


def _native_kinds() -> dict[str, Any]:
    """The natively stored steps by their name in files, which does not change with the class name."""
    from lcorpp.learning.classifiers.gaze_rule import GazeRule
    from lcorpp.learning.classifiers.logistic import QuadraticLogistic
    from lcorpp.learning.classifiers.minirocket import MiniRocket

    return {
        "Motion": Motion,
        "Scaling": ChannelStandardizer,
        "LstmClassifier": LstmClassifier,
        "Summaries": SummaryFeatures,
        "QuadraticLogistic": QuadraticLogistic,
        "MiniRocket": MiniRocket,
        "SegmentStatistics": SegmentStatistics,
        "GazeRule": GazeRule,
    }


def _list_steps(estimator: Any) -> list[tuple[str, Any]]:
    if not isinstance(estimator, Pipeline):
        raise DataError(f"only a pipeline can be stored, not {type(estimator).__name__}")
    return list(estimator.steps)


def _load_step(step: dict[str, Any], arrays: dict[str, npt.NDArray[Any]]) -> Any:
    kinds, kind = _native_kinds(), step["kind"]
    prefix = f"{step['name']}/"
    own = {name.removeprefix(prefix): value for name, value in arrays.items() if name.startswith(prefix)}
    if kind == SKOPS:
        return load_step(step["name"], own[SKOPS])
    if kind not in kinds:
        raise DataError(f"step of unknown kind {kind!r}; {expected_one_of(list(kinds))}")
    parameters = {  # JSON has no tuples
        key: tuple(value) if isinstance(value, list) else value for key, value in step["parameters"].items()
    }
    for name, stored in STORED_NAMES.get(kind, {}).items():
        parameters[name] = parameters.pop(stored)
    return kinds[kind](**parameters).restore_arrays(own)


def check_storable(estimator: Any) -> None:
    """Reject an unfitted estimator that `save_classifier` cannot store once it is fitted.

    Raises:
        DataError: the estimator is not a pipeline, or has a step that cannot be stored safely.
    """
    kinds = _native_kinds()
    for name, step in _list_steps(estimator):
        if type(step) not in kinds.values():
            dump_step(name, step, tuple(kinds))
