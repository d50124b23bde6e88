"""Learners by name: a table of classifiers of tracks or features, and classifiers supplied by the user.

learner("lstm", interval=dataset.interval, inputs=dataset.channels)   -> a scikit-learn Pipeline
learner("logistic", inputs=dataset.channels, kind=dataset.kind)
learner("my_models.py:tuned", seed=3)                                 -> the result of your function

Every learner follows scikit-learn's contract on arrays (cases, channels, time points), or (cases, features),
and contains its preprocessing, so that cross-validation estimates both from training folds only.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.classifiers import makers
from lcorpp.learning.classifiers.learner_table import LEARNERS, PAPER_FEATURES, RENAMED, default_features
from lcorpp.learning.classifiers.makers import LearnerConfig
from lcorpp.learning.contract import (
    Origin,
    accepts_weights,
    ensure_predict_proba,
    report_failure,
    with_origin,
)
from lcorpp.learning.features.rate import RATE
from lcorpp.notebook import join_some
from lcorpp.user_code import UserFile, describe_functions, load_file
from lcorpp.values import CHANNELS, Kind

try:  # joblib's own copy, if it has one, because joblib ignores modules registered with another
    from joblib.externals.cloudpickle import register_pickle_by_value
except ModuleNotFoundError:
    from cloudpickle import register_pickle_by_value


def load_learner_plugin(name: str, arguments: Mapping[str, Any], required: Collection[str] = ()) -> Any:
    """Call the user's function and return its classifier, which names the function in errors.

    Args:
        name: ``module:function``, the module importable, or ``path/to/file.py:function``.
        arguments: the arguments available; the function receives those that are among its parameters.
        required: arguments that must be among its parameters, because the user has set them.

    Raises:
        DataError: the module or file does not exist or fails, it has no such function, the function fails,
            needs another argument, lacks a required parameter, or returns no classifier.
    """
    place, _, function_name = name.rpartition(":")
    if not place or not function_name:
        raise DataError(f"learner {name!r}: expected MODULE:FUNCTION or FILE.py:FUNCTION")
    if place.endswith(".py"):
        path = Path(place)
        module = load_file(path, f"lcorpp_learner_{path.stem}", DataError, importable=True)
        register_pickle_by_value(module)  # worker processes cannot import it by name
    else:
        module = _import_module(place)
    function = getattr(module, function_name, None)
    if not callable(function):
        raise DataError(f"{place} has no function {function_name!r}; {describe_functions(module)}")
    parameters = inspect.signature(function).parameters.values()
    mandatory = [
        p.name for p in parameters if p.default is p.empty and p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
    ]
    for key in mandatory:
        if key not in arguments:
            raise DataError(f"{name} needs the argument {key!r}; {expected_one_of(list(arguments))}")
    passed = {p.name: arguments[p.name] for p in parameters if p.name in arguments}
    for key in required:
        if key not in passed:
            raise DataError(f"{key} is set, but {name} has no parameter of that name")
    file = UserFile.of(place, module)
    location = file.locate(function)
    with file.locate_failures(f"{function_name}()", DataError):
        estimator = function(**passed)
    try:
        return with_origin(ensure_predict_proba(estimator), Origin(name, file, location))
    except DataError as error:
        raise DataError(f"{location}: the learner {name}: {error}") from None


def _import_module(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise DataError(f"learner module {name!r}: {error}; a file is written FILE.py:FUNCTION") from None
    except (Exception, SystemExit) as error:
        raise DataError(
            f"learner module {name!r} cannot be loaded: {type(error).__name__}: {error}"
        ) from error


_DESCRIPTIONS = {
    "motion": "tracks over time",
    "series": "channels over time",
    "table": "features without time",
}


@check_arguments
def learner(
    name: str,
    *,
    interval: float = 0.033,
    inputs: Sequence[str] = ("x", "y"),
    features: Sequence[str] | None = None,
    seed: int = 0,
    epochs: int | None = None,
    device: str = "cpu",
    kind: Kind | None = None,
    rate: float = RATE,
    new_places: bool = True,
    class_weight: str | None = "balanced",
) -> Any:
    """Return an unfitted classifier.

    Args:
        name: one of `LEARNERS`, or a function of your own as ``module:function`` or ``file.py:function`` that
            returns a classifier; it receives those of the arguments below that are among its parameters.
        interval: seconds between two time points of the tracks, `Dataset.interval`.
        inputs: the channels of the tracks, or the features of a table, `Dataset.channels`.
        features: the motion features that the classifier uses, see `Motion`; None takes `default_features`.
        seed: seed of everything random; it also sets parameters called random_state that are None.
        epochs: passes over the data; None is the learner's default.
        device: "cpu", or "cuda" for the LSTM.
        kind: of the data, `Dataset.kind`: other channels than those of motion are used as they are. None is
            motion if `inputs` are channels of motion, a series otherwise, and a table for learners that need
            one.
        rate: points of motion per second, see `Motion`.
        new_places: whether the people to be classified may be at other places than those of the training.
            If not, the learner "summaries" regularizes the less the more tracks of motion there are.
        class_weight: "balanced": equal total weight of all classes in the training, so that rare ones count;
            None: equal weight of all cases.

    Returns:
        An estimator with `fit`, `predict_proba` and `get_params`.

    Raises:
        DataError: the learner is unknown, the function fails or does not return a classifier, learns from
            another kind of data, an argument from `features` to `class_weight` is given to a learner without
            that option, or an argument has another type.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import learner, train
        >>> walks = [np.outer([speed, 0], np.arange(30) / 10) for speed in (0.2, 0.3, 0.4, 1.1, 1.2, 1.3)]
        >>> data = Dataset(walks, 3 * ["slow"] + 3 * ["fast"], interval=0.1)
        >>> classifier = train(learner("summaries", interval=data.interval, inputs=data.channels), data)
        >>> classifier.classify_many(walks)
        ['slow', 'slow', 'slow', 'fast', 'fast', 'fast']
    """
    if kind is None:
        kind = "motion" if set(inputs) <= set(CHANNELS) else "series"
        if name in LEARNERS and kind not in LEARNERS[name].kinds:
            kind = LEARNERS[name].kinds[0]
    chosen = default_features(name) if features is None else features
    config = LearnerConfig(
        interval, tuple(inputs), tuple(chosen), seed, epochs, device, kind, rate, new_places, class_weight
    )
    if ":" in name:
        defaults = {"features": PAPER_FEATURES, "epochs": None, "device": "cpu", "rate": RATE}
        defaults["class_weight"] = "balanced"
        required = [key for key, value in defaults.items() if getattr(config, key) != value]
        return _set_seed(load_learner_plugin(name, vars(config), required), seed)
    if name in RENAMED:
        raise DataError(f"learner {name!r} is now called {RENAMED[name]!r}")
    if name not in LEARNERS:
        raise DataError(
            f"unknown learner {name!r}; {expected_one_of([*LEARNERS])}, or one of your own as"
            " MODULE:FUNCTION or FILE.py:FUNCTION"
        )
    row = LEARNERS[name]
    if not row.iterative:
        iterative = ", ".join(known for known, other in LEARNERS.items() if other.iterative)
        if epochs is not None:
            raise DataError(f"learner {name!r} makes no passes over the data; epochs are for {iterative}")
        if device != "cpu":
            raise DataError(f"learner {name!r} runs on the cpu only; device {device!r} is for {iterative}")
    if config.kind not in row.kinds:
        suitable = ", ".join(known for known, other in LEARNERS.items() if config.kind in other.kinds)
        needs, given = (_DESCRIPTIONS[some] for some in (row.kinds[0], config.kind))
        raise DataError(
            f"learner {name!r} needs {needs}; the data are {given}: {join_some(inputs)}; {given} are for"
            f" {suitable}, or a learner of your own"
        )
    if config.kind != "motion" and (features is not None or rate != RATE):
        raise DataError(
            f"{'features are' if rate == RATE else 'points at a rate are'} computed from motion; the data are"
            f" {_DESCRIPTIONS[config.kind]}: {join_some(inputs)}"
        )
    return getattr(makers, row.maker)(config)


def check_weighted(name: str, estimator: Any) -> None:
    """Check that a learner's estimator can be trained on weighted cases.

    Raises:
        DataError: its `fit` has no `sample_weight`; the message names the learners that have it.
    """
    if not accepts_weights(estimator):
        raise DataError(
            f"learner {name!r} cannot learn from weighted cases: its fit has no sample_weight;"
            f" {expected_one_of([*LEARNERS])}"
        )


def _set_seed(estimator: Any, seed: int) -> Any:
    """Set every random_state that is None to `seed`, so that runs can be repeated."""
    with report_failure(estimator, "get_params", "an __init__ whose arguments are attributes"):
        unset = {
            key: seed
            for key, value in estimator.get_params().items()
            if key.split("__")[-1] == "random_state" and value is None
        }
        return estimator.set_params(**unset) if unset else estimator
