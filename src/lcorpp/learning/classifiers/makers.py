"""Makers of the untrained classifiers of the table of learners, `LEARNERS`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from numbers import Integral, Real
from typing import Any

from sklearn.pipeline import Pipeline

from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.classifiers.learner_table import GAZE_RULE_FEATURES, KINDS
from lcorpp.learning.classifiers.pipelines import fast_pipeline, paper_pipeline
from lcorpp.learning.features.motion import ChannelStandardizer, Motion
from lcorpp.learning.features.rate import check_rate
from lcorpp.learning.features.segments import SegmentStatistics
from lcorpp.learning.features.summaries import SummaryFeatures
from lcorpp.values import Kind

TREES = 100
"""Trees of the forest: more do not change the second digit of its AUC."""

MAX_CASES = 25
"""More training tracks do not weaken the regularization of a logistic regression: people at another place
differ from those of the training by more than chance (benchmarks/results/learning.md)."""


@dataclass(frozen=True)
class LearnerConfig:
    """The settings of a learner.

    interval: seconds between two time points of the tracks. inputs: the channels of the tracks.
    features: the motion features that the classifier uses, see `Motion`.
    seed: seed of everything random. epochs: passes over the data; None is the learner's default.
    device: "cpu" or "cuda". kind: of the data, `Dataset.kind`. rate: points of motion per second.
    class_weight: "balanced": equal total weight of all classes; None: equal weight of all cases.
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
    class_weight: str | None = "balanced"

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
        if self.class_weight not in ("balanced", None):
            raise DataError(f"class_weight is {self.class_weight!r}; expected 'balanced' or None")
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


def make_lstm(config: LearnerConfig, pipeline: Callable[..., Pipeline] = paper_pipeline) -> Pipeline:
    arguments = {name: value for name, value in vars(config).items() if value is not None}
    kind, seed, _ = (arguments.pop(name) for name in ("kind", "seed", "new_places"))
    whole = pipeline(random_state=seed, **{**arguments, "class_weight": config.class_weight})
    return whole if kind == "motion" else whole[1:]  # without the step `Motion`


def make_fast_lstm(config: LearnerConfig) -> Pipeline:
    if config.kind == "motion":
        return make_lstm(config, fast_pipeline)
    # series are less ambiguous than people's motion: more updates, less dropout
    network = partial(fast_pipeline, min_updates=600, dropout=0.2, learning_rate=5e-3)
    return Pipeline([("segments", SegmentStatistics()), *make_lstm(config, network).steps])


def make_summaries(config: LearnerConfig) -> Pipeline:
    from lcorpp.learning.classifiers.logistic import QuadraticLogistic

    # of many summaries, each of which depends little on the class, none may get a large weight
    of_motion = {"max_cases": MAX_CASES if config.new_places else None}
    options: dict[str, Any] = {"table": {"C": 1.0}, "series": {}, "motion": of_motion}
    logistic = QuadraticLogistic(class_weight=config.class_weight, **options[config.kind])
    return config.summarize(("logistic", logistic))


def make_forest(config: LearnerConfig) -> Pipeline:
    from lcorpp.learning.classifiers.forest import Forest

    weight = None if config.class_weight is None else "balanced_subsample"
    forest = Forest(TREES, min_samples_leaf=5, class_weight=weight, random_state=config.seed)
    return config.summarize(("forest", forest))


def make_minirocket(config: LearnerConfig) -> Pipeline:
    from lcorpp.learning.classifiers.minirocket import MiniRocket

    rocket = MiniRocket(class_weight=config.class_weight, random_state=config.seed)
    return config.pipeline(("scaling", ChannelStandardizer()), ("minirocket", rocket))


def make_gaze_rule(config: LearnerConfig) -> Pipeline:
    from lcorpp.learning.classifiers.gaze_rule import GazeRule

    if config.features != GAZE_RULE_FEATURES:
        raise DataError(
            f"the learner 'gaze-rule' takes the feature {GAZE_RULE_FEATURES[0]} alone, not"
            f" {', '.join(config.features)}"
        )
    return config.pipeline(("rule", GazeRule()))
