"""Learners by name: a table of classifiers of tracks or features, and classifiers supplied by the user.

learner("lstm", interval=dataset.interval, inputs=dataset.channels)   -> a scikit-learn Pipeline
learner("logistic", inputs=dataset.channels, kind=dataset.kind)
learner("my_models.py:tuned", seed=3)                                 -> the result of your function

Every learner follows scikit-learn's contract on arrays (cases, channels, time points), or (cases, features),
and contains its preprocessing, so that cross-validation estimates both from training folds only.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.classifiers import makers
from lcorpp.learning.classifiers.makers import LearnerConfig
from lcorpp.learning.classifiers.plugin import load_learner_plugin
from lcorpp.learning.classifiers.table import LEARNERS, PAPER_FEATURES, RENAMED, default_features
from lcorpp.learning.contract import accepts_weights, report_failure
from lcorpp.learning.features.resampling import RATE
from lcorpp.notebook import join_some
from lcorpp.values import CHANNELS, Kind

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

    Returns:
        An estimator with `fit`, `predict_proba` and `get_params`.

    Raises:
        DataError: the learner is unknown, the function fails or does not return a classifier, learns from
            another kind of data, `epochs`, `device`, `features` or `rate` is given to a learner without that
            option, or an argument has another type.
    """
    if kind is None:
        kind = "motion" if set(inputs) <= set(CHANNELS) else "series"
        if name in LEARNERS and kind not in LEARNERS[name].kinds:
            kind = LEARNERS[name].kinds[0]
    chosen = default_features(name) if features is None else features
    config = LearnerConfig(
        interval, tuple(inputs), tuple(chosen), seed, epochs, device, kind, rate, new_places
    )
    if ":" in name:
        defaults = {"features": PAPER_FEATURES, "epochs": None, "device": "cpu", "rate": RATE}
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
