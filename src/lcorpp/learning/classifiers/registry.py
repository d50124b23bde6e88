"""Learners by name: a table of classifiers of tracks, and classifiers supplied by the user.

learner("lstm", interval=dataset.interval, inputs=dataset.channels)   -> a scikit-learn Pipeline
learner("my_models.py:tuned", seed=3)                                 -> the result of your function

Every learner follows scikit-learn's contract on arrays (cases, channels, time points) and contains its
preprocessing, so that cross-validation estimates both from training folds only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sklearn.pipeline import Pipeline

from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.classifiers.pipelines import fast_pipeline, paper_pipeline
from lcorpp.learning.classifiers.plugin import load_learner_plugin
from lcorpp.learning.contract import SigmoidScores, ensure_predict_proba
from lcorpp.learning.features.motion import Motion

TREES = 100
"""Trees of the forest: more do not change the second digit of its AUC."""

RENAMED = {"fast": "lstm-fast"}


@dataclass(frozen=True)
class LearnerConfig:
    """The settings of a learner.

    interval: seconds between two time points of the tracks. inputs: the channels of the tracks.
    features: the motion features that the classifier uses, see `Motion`.
    seed: seed of everything random. epochs: passes over the data; None is the learner's default.
    device: "cpu" or "cuda".
    """

    interval: float
    inputs: tuple[str, ...]
    features: tuple[str, ...]
    seed: int
    epochs: int | None
    device: str

    def motion(self) -> Motion:
        """Return the first step of every learner."""
        return Motion(interval=self.interval, inputs=self.inputs, features=self.features)

    def lstm_arguments(self) -> dict[str, Any]:
        """Return the arguments of `paper_pipeline`."""
        return {
            "interval": self.interval,
            "inputs": self.inputs,
            "features": self.features,
            "random_state": self.seed,
            "device": self.device,
            **({} if self.epochs is None else {"epochs": self.epochs}),
        }


@dataclass(frozen=True)
class Learner:
    """A row of the table. iterative: the learner takes `epochs` and `device`."""

    about: str
    make: Callable[[LearnerConfig], Any]
    iterative: bool = False


def _summaries(config: LearnerConfig) -> Pipeline:
    from lcorpp.learning.classifiers.logistic import QuadraticLogistic
    from lcorpp.learning.features.summaries import SummaryFeatures

    return Pipeline(
        [("motion", config.motion()), ("summaries", SummaryFeatures()), ("logistic", QuadraticLogistic())]
    )


def _forest(config: LearnerConfig) -> Pipeline:
    from sklearn.ensemble import RandomForestClassifier

    from lcorpp.learning.features.summaries import SummaryFeatures

    forest = RandomForestClassifier(
        TREES, min_samples_leaf=5, class_weight="balanced_subsample", random_state=config.seed
    )
    return Pipeline([("motion", config.motion()), ("summaries", SummaryFeatures()), ("forest", forest)])


def _minirocket(config: LearnerConfig) -> Pipeline:
    import numpy as np
    from sklearn.linear_model import RidgeClassifierCV

    try:
        from aeon.classification.convolution_based import MiniRocketClassifier
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "aeon":
            raise
        raise DataError("minirocket needs aeon, which is not installed: pip install 'lcorpp[aeon]'") from None
    # MiniRocket's default classifier, which alone would give the probabilities 0 and 1 only
    ridge = SigmoidScores(RidgeClassifierCV(np.logspace(-3, 3, 10), class_weight="balanced"))
    rocket = MiniRocketClassifier(estimator=ridge, random_state=config.seed)
    return Pipeline([("motion", config.motion()), ("minirocket", rocket)])


LEARNERS: Mapping[str, Learner] = {
    "lstm": Learner("the paper's LSTM", lambda c: paper_pipeline(**c.lstm_arguments()), iterative=True),
    "lstm-fast": Learner(
        "the LSTM, trained in a tenth of the time",
        lambda c: fast_pipeline(**c.lstm_arguments()),
        iterative=True,
    ),
    "summaries": Learner("logistic regression on summaries of the motion", _summaries),
    "forest": Learner("a random forest on summaries of the motion", _forest),
    "minirocket": Learner("aeon's MiniRocket, random convolutions of the motion", _minirocket),
}
"""The learners by name."""


def learner(
    name: str,
    *,
    interval: float = 0.033,
    inputs: Sequence[str] = ("x", "y"),
    features: Sequence[str] = ("x", "y"),
    seed: int = 0,
    epochs: int | None = None,
    device: str = "cpu",
) -> Any:
    """Return an unfitted classifier.

    Args:
        name: one of `LEARNERS`, or a function of your own as ``module:function`` or ``file.py:function`` that
            returns a classifier; it receives those of the arguments below that are among its parameters.
        interval: seconds between two time points of the tracks, `Dataset.interval`.
        inputs: the channels of the tracks, `Dataset.channels`.
        features: the motion features that the classifier uses, see `Motion`.
        seed: seed of everything random; it also sets parameters called random_state that are None.
        epochs: passes over the data; None is the learner's default.
        device: "cpu", or "cuda" for the LSTM.

    Returns:
        An estimator with `fit`, `predict_proba` and `get_params`.

    Raises:
        DataError: the learner is unknown, a package that it needs is missing, the function fails or does not
            return a classifier, or `epochs`, `device` or `features` is given to a learner without that
            option.
    """
    config = LearnerConfig(interval, tuple(inputs), tuple(features), seed, epochs, device)
    if ":" in name:
        defaults = {"features": ("x", "y"), "epochs": None, "device": "cpu"}
        required = [key for key, value in defaults.items() if getattr(config, key) != value]
        return _set_seed(ensure_predict_proba(load_learner_plugin(name, vars(config), required)), seed)
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
    return row.make(config)


def _set_seed(estimator: Any, seed: int) -> Any:
    """Set every random_state that is None to `seed`, so that runs can be repeated."""
    unset = {
        key: seed
        for key, value in estimator.get_params().items()
        if key.split("__")[-1] == "random_state" and value is None
    }
    return estimator.set_params(**unset) if unset else estimator
