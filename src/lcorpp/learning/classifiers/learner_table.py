"""The table of learners; their makers load on first use, so that a command can list the names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # loads the class of data sets, which most decisions do without
    from lcorpp.values import Kind

PAPER_FEATURES = ("x", "y")
"""The motion features of the paper, which learners of time series use if none are chosen."""

OWN_FEATURES = ("velocity", "acceleration", "turn_rate")
"""Motion features that depend on the person alone, which the other learners use if none are chosen."""

GAZE_RULE_FEATURES = ("social_engagement",)
"""The motion features of the rule of ROS4HRI."""

RENAMED = {"fast": "lstm-fast"}

KINDS: tuple[Kind, ...] = ("motion", "series", "table")


@dataclass(frozen=True)
class Learner:
    """A row of the table.

    maker: the function of `lcorpp.learning.classifiers.makers` that returns the untrained classifier.
    iterative: the learner takes `epochs` and `device`. kinds: the data that it learns from.
    features: of motion, if none are chosen. has_fixed_features: whether it takes no others.
    """

    about: str
    maker: str
    iterative: bool = False
    kinds: tuple[Kind, ...] = ("motion", "series")
    features: tuple[str, ...] = PAPER_FEATURES
    has_fixed_features: bool = False


LEARNERS: Mapping[str, Learner] = {
    "lstm": Learner("the paper's LSTM", "make_lstm", iterative=True),
    "lstm-fast": Learner(
        "the LSTM, trained in a tenth of the time", "make_fast_lstm", iterative=True, features=OWN_FEATURES
    ),
    "summaries": Learner(
        "logistic regression on summaries of the motion", "make_summaries", kinds=KINDS, features=OWN_FEATURES
    ),
    "forest": Learner(
        "a random forest on summaries of the motion", "make_forest", kinds=KINDS, features=OWN_FEATURES
    ),
    "logistic": Learner("logistic regression on a table of features", "make_summaries", kinds=("table",)),
    "minirocket": Learner("MiniRocket: a ridge classifier on ten thousand convolutions", "make_minirocket"),
    "gaze-rule": Learner(
        "the rule of ROS4HRI: mutual gaze over distance, to compare with",
        "make_gaze_rule",
        kinds=("motion",),
        features=GAZE_RULE_FEATURES,
        has_fixed_features=True,
    ),
}
"""The learners by name."""

DEFAULTS: Mapping[Kind, str] = {"motion": "lstm", "series": "minirocket", "table": "logistic"}
"""The learner of each kind of data if none is chosen; for motion that of the paper."""

RECOMMENDED: Mapping[Kind, tuple[str, str]] = {
    "motion": (
        "summaries",
        "none has a higher AUC on 1600 simulated tracks, and it trains fastest "
        "(docs/guides/learning/learners.md)",
    ),
    "series": (
        "minirocket",
        "it has the highest mean accuracy on nine public sets of short or few series "
        "(docs/guides/learning/learners.md)",
    ),
    "table": ("logistic", "features without time need no summary"),
}
"""The learner that is best for each kind of data by our measurements, with the reason."""


def default_features(name: str) -> tuple[str, ...]:
    """Return the motion features that a learner uses if none are chosen."""
    return LEARNERS[name].features if name in LEARNERS else PAPER_FEATURES
