"""The learners by name: a table of classifiers of tracks, and any classifier of your own.

learner("lstm", interval=dataset.interval, inputs=dataset.channels)   -> a scikit-learn Pipeline
learner("my_models.py:tuned", seed=3)                                 -> what your function returns

Every learner keeps scikit-learn's contract on arrays (cases, channels, time points) and stands in a pipeline
with its preprocessing, so that whatever is estimated is estimated from training folds alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sklearn.pipeline import Pipeline

from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.classifiers.contract import Scored, with_probabilities
from lcorpp.learning.classifiers.plugin import own_learner
from lcorpp.learning.classifiers.trained import paper_pipeline
from lcorpp.learning.features.motion import Motion

TREES = 100
"""Trees of the forest: more no longer change its AUC in the second digit."""


@dataclass(frozen=True)
class Setting:
    """What a learner is made for.

    interval: seconds between two time points of the tracks. inputs: what their channels are.
    channels: what the classifier sees, see `Motion`.
    seed: of everything that is drawn. epochs: passes over the data, None for the learner's own.
    device: "cpu" or "cuda".
    """

    interval: float
    inputs: tuple[str, ...]
    channels: tuple[str, ...]
    seed: int
    epochs: int | None
    device: str

    def motion(self) -> Motion:
        """The first step of every learner."""
        return Motion(interval=self.interval, inputs=self.inputs, channels=self.channels)


@dataclass(frozen=True)
class Learner:
    """A row of the table. trained: whether it makes passes over the data, and computes on a device."""

    about: str
    make: Callable[[Setting], Any]
    trained: bool = False


def _lstm(setting: Setting) -> Pipeline:
    return paper_pipeline(**_network(setting))


def _fast(setting: Setting) -> Pipeline:
    from lcorpp.learning.classifiers.trained import fast_pipeline

    return fast_pipeline(**_network(setting))


def _network(setting: Setting) -> dict[str, Any]:
    return {
        "interval": setting.interval,
        "inputs": setting.inputs,
        "channels": setting.channels,
        "random_state": setting.seed,
        "device": setting.device,
        **({} if setting.epochs is None else {"epochs": setting.epochs}),
    }


def _summaries(setting: Setting) -> Pipeline:
    from lcorpp.learning.classifiers.logistic import QuadraticLogistic
    from lcorpp.learning.features.summaries import Summaries

    steps = [("motion", setting.motion()), ("summaries", Summaries()), ("logistic", QuadraticLogistic())]
    return Pipeline(steps)


def _forest(setting: Setting) -> Pipeline:
    from sklearn.ensemble import RandomForestClassifier

    from lcorpp.learning.features.summaries import Summaries

    forest = RandomForestClassifier(
        TREES, min_samples_leaf=5, class_weight="balanced_subsample", random_state=setting.seed
    )
    return Pipeline([("motion", setting.motion()), ("summaries", Summaries()), ("forest", forest)])


def _minirocket(setting: Setting) -> Pipeline:
    import numpy as np
    from sklearn.linear_model import RidgeClassifierCV

    try:
        from aeon.classification.convolution_based import MiniRocketClassifier
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "aeon":
            raise
        raise DataError("minirocket needs aeon, which is not installed: pip install 'lcorpp[aeon]'") from None
    # MiniRocket's own choice of classifier; by itself it would say 0 and 1 only
    ridge = Scored(RidgeClassifierCV(np.logspace(-3, 3, 10), class_weight="balanced"))
    rocket = MiniRocketClassifier(estimator=ridge, random_state=setting.seed)
    return Pipeline([("motion", setting.motion()), ("minirocket", rocket)])


LEARNERS: Mapping[str, Learner] = {
    "lstm": Learner("the paper's LSTM", _lstm, trained=True),
    "fast": Learner("the LSTM, trained in a tenth of the time", _fast, trained=True),
    "summaries": Learner("logistic regression on summaries of the motion", _summaries),
    "forest": Learner("a random forest on summaries of the motion", _forest),
    "minirocket": Learner("aeon's MiniRocket, random convolutions of the motion", _minirocket),
}
"""What learns to classify, by name."""


def learner(
    name: str,
    *,
    interval: float = 0.033,
    inputs: Sequence[str] = ("x", "y"),
    channels: Sequence[str] = ("x", "y"),
    seed: int = 0,
    epochs: int | None = None,
    device: str = "cpu",
) -> Any:
    """A classifier, not yet trained.

    Args:
        name: one of `LEARNERS`, or a function of your own as ``module:function`` or ``file.py:function``; it
            returns a classifier, and is given those of the arguments below that it has.
        interval: seconds between two time points of the tracks, `Dataset.interval`.
        inputs: what the channels of the tracks are, `Dataset.channels`.
        channels: what the classifier sees of them, see `Motion`.
        seed: of everything that is drawn; parameters called random_state that are None get it, too.
        epochs: passes over the data; None takes the learner's own number.
        device: "cpu", or "cuda" for the LSTM.

    Returns:
        An estimator with `fit`, `predict_proba` and `get_params`.

    Raises:
        DataError: there is no such learner, a package that it needs is missing, the function fails or returns
            no classifier, or `epochs`, `device` or `channels` is given to a learner that has none.
    """
    setting = Setting(interval, tuple(inputs), tuple(channels), seed, epochs, device)
    if ":" in name:
        usual = {"channels": ("x", "y"), "epochs": None, "device": "cpu"}
        wanted = [key for key, value in usual.items() if getattr(setting, key) != value]
        return _seeded(with_probabilities(own_learner(name, vars(setting), wanted)), seed)
    if name not in LEARNERS:
        raise DataError(
            f"unknown learner {name!r}; {expected_one_of([*LEARNERS])}, or one of your own as MODULE:FUNCTION"
            " or FILE.py:FUNCTION"
        )
    row = LEARNERS[name]
    if not row.trained:
        those = ", ".join(known for known, other in LEARNERS.items() if other.trained)
        if epochs is not None:
            raise DataError(f"learner {name!r} makes no passes over the data; epochs are for {those}")
        if device != "cpu":
            raise DataError(f"learner {name!r} computes on the cpu alone; device {device!r} is for {those}")
    return row.make(setting)


def _seeded(estimator: Any, seed: int) -> Any:
    """The estimator with `seed` for every random_state that was left open, so that runs can be repeated."""
    open_states = {
        key: seed
        for key, value in estimator.get_params().items()
        if key.split("__")[-1] == "random_state" and value is None
    }
    return estimator.set_params(**open_states) if open_states else estimator
