"""Learners by name: a table of classifiers of tracks or features, and classifiers supplied by the user.

learner("lstm", interval=dataset.interval, inputs=dataset.channels)   -> a scikit-learn Pipeline
learner("logistic", inputs=dataset.channels, kind=dataset.kind)
learner("my_models.py:tuned", seed=3)                                 -> the result of your function

Every learner follows scikit-learn's contract on arrays (cases, channels, time points), or (cases, features),
and contains its preprocessing, so that cross-validation estimates both from training folds only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from numbers import Integral, Real
from typing import Any

from sklearn.pipeline import Pipeline

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.classifiers.pipelines import (
    OWN_FEATURES,
    PAPER_FEATURES,
    fast_pipeline,
    paper_pipeline,
)
from lcorpp.learning.classifiers.plugin import load_learner_plugin
from lcorpp.learning.contract import accepts_weights, report_failure
from lcorpp.learning.features.motion import ChannelStandardizer, Motion
from lcorpp.learning.features.resampling import RATE, check_rate
from lcorpp.learning.features.segments import SegmentStatistics
from lcorpp.learning.features.summaries import SummaryFeatures
from lcorpp.notebook import join_some
from lcorpp.values import CHANNELS, Kind

TREES = 100
"""Trees of the forest: more do not change the second digit of its AUC."""

RENAMED = {"fast": "lstm-fast"}

_DESCRIPTIONS = {
    "motion": "tracks over time",
    "series": "channels over time",
    "table": "features without time",
}

KINDS: tuple[Kind, ...] = ("motion", "series", "table")

MAX_CASES = 25
"""More training tracks do not weaken the regularization of a logistic regression: people at another place
differ from those of the training by more than chance (docs/learning.md has the measurements)."""


@dataclass(frozen=True)
class LearnerConfig:
    """The settings of a learner.

    interval: seconds between two time points of the tracks. inputs: the channels of the tracks.
    features: the motion features that the classifier uses, see `Motion`.
    seed: seed of everything random. epochs: passes over the data; None is the learner's default.
    device: "cpu" or "cuda". kind: of the data, `Dataset.kind`. rate: points of motion per second.
    """

    interval: float
    inputs: tuple[str, ...]
    features: tuple[str, ...]
    seed: int
    epochs: int | None
    device: str

    kind: Kind
    rate: float
    new_places: bool

    def __post_init__(self) -> None:
        interval = self.interval
        if not isinstance(interval, Real) or isinstance(interval, bool) or not 0 < interval < float("inf"):
            raise DataError(f"interval must be a finite number of seconds above 0, not {interval!r}")
        for name, lowest in (("seed", 0), ("epochs", 1)):
            number = getattr(self, name)
            is_whole = isinstance(number, Integral) and not isinstance(number, bool)
            if not (is_whole and number >= lowest) and (name, number) != ("epochs", None):
                raise DataError(f"{name} must be a whole number of at least {lowest}, not {number!r}")
        if self.kind not in KINDS:
            raise DataError(f"unknown kind of data {self.kind!r}; {expected_one_of(KINDS)}")
        if not isinstance(self.rate, Real) or isinstance(self.rate, bool):
            raise DataError(f"rate must be a number of points per second, not {self.rate!r}")
        check_rate(self.rate)

    def pipeline(self, *steps: tuple[str, Any]) -> Pipeline:
        """Return these steps, for tracks after `Motion`."""
        if self.kind != "motion":
            return Pipeline(list(steps))
        motion = Motion(rate=self.rate, interval=self.interval, inputs=self.inputs, features=self.features)
        return Pipeline([("motion", motion), *steps])

    def summarize(self, *steps: tuple[str, Any]) -> Pipeline:
        """Return `pipeline` of summary features and these steps; features of a table need no summary."""
        if self.kind == "table":
            return self.pipeline(*steps)
        is_path = self.kind == "motion" and self.features[:2] == ("x", "y")
        summaries = SummaryFeatures(rate=self.rate if is_path else None)
        return self.pipeline(("summaries", summaries), *steps)


@dataclass(frozen=True)
class Learner:
    """A row of the table.

    iterative: the learner takes `epochs` and `device`. kinds: the data that it learns from.
    features: of motion, if none are chosen.
    """

    about: str
    make: Callable[[LearnerConfig], Any]
    iterative: bool = False
    kinds: tuple[Kind, ...] = ("motion", "series")
    features: tuple[str, ...] = PAPER_FEATURES


def _lstm(config: LearnerConfig, pipeline: Callable[..., Pipeline] = paper_pipeline) -> Pipeline:
    arguments = {name: value for name, value in vars(config).items() if value is not None}
    kind, seed, _ = (arguments.pop(name) for name in ("kind", "seed", "new_places"))
    whole = pipeline(random_state=seed, **arguments)
    return whole if kind == "motion" else whole[1:]  # without the step `Motion`


def _fast_lstm(config: LearnerConfig) -> Pipeline:
    if config.kind == "motion":
        return _lstm(config, fast_pipeline)
    # series are less ambiguous than people's motion: more updates, less dropout
    network = partial(fast_pipeline, min_updates=600, dropout=0.2, learning_rate=5e-3)
    return Pipeline([("segments", SegmentStatistics()), *_lstm(config, network).steps])


def _summaries(config: LearnerConfig) -> Pipeline:
    from lcorpp.learning.classifiers.logistic import QuadraticLogistic

    # of many summaries, each of which depends little on the class, none may get a large weight
    of_motion = {"max_cases": MAX_CASES if config.new_places else None}
    options: dict[str, Any] = {"table": {"C": 1.0}, "series": {}, "motion": of_motion}
    return config.summarize(("logistic", QuadraticLogistic(**options[config.kind])))


def _forest(config: LearnerConfig) -> Pipeline:
    from lcorpp.learning.classifiers.forest import Forest

    forest = Forest(TREES, min_samples_leaf=5, class_weight="balanced_subsample", random_state=config.seed)
    return config.summarize(("forest", forest))


def _minirocket(config: LearnerConfig) -> Pipeline:
    from lcorpp.learning.classifiers.minirocket import MiniRocket

    steps = ("scaling", ChannelStandardizer()), ("minirocket", MiniRocket(random_state=config.seed))
    return config.pipeline(*steps)


LEARNERS: Mapping[str, Learner] = {
    "lstm": Learner("the paper's LSTM", _lstm, iterative=True),
    "lstm-fast": Learner(
        "the LSTM, trained in a tenth of the time", _fast_lstm, iterative=True, features=OWN_FEATURES
    ),
    "summaries": Learner(
        "logistic regression on summaries of the motion", _summaries, kinds=KINDS, features=OWN_FEATURES
    ),
    "forest": Learner(
        "a random forest on summaries of the motion", _forest, kinds=KINDS, features=OWN_FEATURES
    ),
    "logistic": Learner("logistic regression on a table of features", _summaries, kinds=("table",)),
    "minirocket": Learner("MiniRocket: a ridge classifier on ten thousand convolutions", _minirocket),
}
"""The learners by name."""

DEFAULTS: Mapping[Kind, str] = {"motion": "lstm", "series": "minirocket", "table": "logistic"}
"""The learner of each kind of data if none is chosen; for motion that of the paper."""

RECOMMENDED: Mapping[Kind, tuple[str, str]] = {
    "motion": (
        "summaries",
        "none has a higher AUC on 1600 simulated tracks, and it trains fastest (docs/learning.md)",
    ),
    "series": (
        "minirocket",
        "it has the highest mean accuracy on nine public sets of short or few series (docs/learning.md)",
    ),
    "table": ("logistic", "features without time need no summary"),
}
"""The learner that is best for each kind of data by our measurements, with the reason."""


def default_features(name: str) -> tuple[str, ...]:
    """Return the motion features that a learner uses if none are chosen."""
    return LEARNERS[name].features if name in LEARNERS else PAPER_FEATURES


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
    return row.make(config)


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
