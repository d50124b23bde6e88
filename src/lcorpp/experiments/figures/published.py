"""The paper's numbers as far as they are known, and how far ours are from them.

Source: the authors' plotting data of August 2019, before the camera-ready version; they agree with the prose
of the paper, but equality with the printed bars cannot be checked. Numbers are texts with the digits found.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from math import hypot, sqrt

from lcorpp.scoring.metrics import Scores
from lcorpp.values import Z95, Interval

TRIALS = 5000
"""Trials behind each published number."""

MAX_STANDARD_ERRORS = 3
"""Deviations of more standard errors need a reason; the report has them in bold type."""

STRATEGIES: Mapping[str, Mapping[str, str]] = {
    "L": {"f1": "0.66", "accuracy": "0.77"},
    "R": {"f1": "0.59", "accuracy": "0.71"},
    "P": {"f1": "0.87", "accuracy": "0.89", "cost": "10.93"},
    "L+R": {"f1": "0.70", "accuracy": "0.78"},
    "R+P": {"f1": "0.87", "accuracy": "0.90", "cost": "9.71"},
    "LCORPP": {"f1": "0.89", "accuracy": "0.92", "cost": "8.07"},
}
"""Strategy -> metric -> number: "comparison with five baselines"."""

COST_SD: Mapping[str, float] = {"P": 7.21, "R+P": 7.1, "LCORPP": 6.71}
"""Strategy -> standard deviation of the cost of a trial, in the comparison with five baselines."""

KNOWLEDGE: Mapping[str, Mapping[str, Mapping[str, str]]] = {
    "High": {
        "R": {"f1": "0.58"},
        "L+R": {"f1": "0.73"},
        "R+P": {"accuracy": "0.89", "cost": "9.8"},
        "LCORPP": {"accuracy": "0.91", "cost": "7.7"},
    },
    "Medium": {
        "R": {"f1": "0.34"},
        "L+R": {"f1": "0.61"},
        "R+P": {"accuracy": "0.87", "cost": "10.5"},
        "LCORPP": {"accuracy": "0.89", "cost": "9.2"},
    },
    "Low": {
        "R": {"f1": "0.29"},
        "L+R": {"f1": "0.39"},
        "R+P": {"accuracy": "0.81", "cost": "10.2"},
        "LCORPP": {"accuracy": "0.88", "cost": "10.4"},
    },
}
"""Knowledge -> strategy -> metric -> number: "inaccurate knowledge".

The values of R+P and LCORPP are called F1 there, but equal their accuracy digit for digit, so they are
compared with our accuracy.
"""

PARTIAL: Mapping[str, Mapping[str, str]] = {
    "L": {"quarter": "0.55", "whole": "0.65"},
    "L+R": {"quarter": "0.67", "whole": "0.72"},
    "LCORPP": {"quarter": "0.81", "whole": "0.83"},
}
"""Strategy -> part of the trajectory -> F1: "partial motion trajectories"."""

AUGMENTATION: Mapping[str, tuple[str, ...]] = {
    "f1": ("0.90", "0.93", "0.95"),
    "cost": ("42.6", "42.0", "38.5"),
}
"""Metric -> number of each batch: "active data augmentation", from a run of three batches."""

CONFUSION: Mapping[str, str] = {"interested": "0.76", "not_interested": "0.29"}
"""True class -> rate of the label `interested`: the confusion matrix of the LSTM."""

TRIAL = ("0.22", "0.717", "0.958", "0.989")
"""Belief in `interested` before and after the actions of the illustrative trial, in the authors' POMDP."""


@dataclass(frozen=True)
class Deviation:
    """One of our numbers beside the published one.

    setting: of our run, e.g. a preset. what: e.g. "LCORPP, F1".
    ours: our number with its 95 % interval. published: the number as found.
    standard_error: of the difference, the root of the sum of both variances, see `compute_standard_error`;
        0 where the published number is not a mean of trials.
    reason: why the two differ, "" where nothing is known.
    """

    setting: str
    what: str
    ours: Interval
    published: str
    standard_error: float
    reason: str = ""

    @property
    def difference(self) -> float:
        """Ours minus the published number."""
        return self.ours.estimate - float(self.published)

    @property
    def in_standard_errors(self) -> float | None:
        """The difference in standard errors of the difference; None where these are unknown."""
        return self.difference / self.standard_error if self.standard_error else None


def deviate(
    setting: str, what: str, ours: Interval, published: str, error: float, reason: str = ""
) -> Deviation:
    """Return the deviation of a mean from a published one.

    Args:
        error: the standard error of the published number; that of ours is taken from its interval.
        reason: given if the two differ by more than `MAX_STANDARD_ERRORS` standard errors.
    """
    total = hypot((ours.high - ours.low) / (2 * Z95), error)
    far = abs(ours.estimate - float(published)) > MAX_STANDARD_ERRORS * total
    return Deviation(setting, what, ours, published, total, reason if far else "")


def deviate_score(
    setting: str, scores: Scores, metric: str, published: str, *, sd: float | None = None, reason: str = ""
) -> Deviation:
    """Return the deviation of a score from a published number.

    Args:
        metric: "f1", "accuracy" or "cost".
        sd: as of `compute_standard_error`. reason: as of `deviate`.
    """
    error = compute_standard_error(scores, metric, published, sd)
    what = f"{scores.strategy}, {format_metric(metric)}"
    return deviate(setting, what, scores.metrics[metric], published, error, reason)


def format_metric(metric: str) -> str:
    """Return the name of a metric in a sentence."""
    return {"f1": "F1"}.get(metric, metric)


def find_published(numbers: Mapping[str, str], metric: str) -> float | None:
    """Return the number of a metric; None if it is not known."""
    return float(numbers[metric]) if metric in numbers else None


def compute_standard_error(
    scores: Scores, metric: str, published: str, sd: float | None = None, *, trials: int = TRIALS
) -> float:
    """Return the standard error of a published mean of n = `trials` trials.

    Args:
        scores: ours of the same strategy.
        sd: the published standard deviation of the cost of a trial; None takes ours.

    An accuracy p is a binomial proportion: p (1 - p) / n. F1 = 2p / (1 + p) grows with p, the share of true
    positives among the decisions that are positive or reported as positive; p is binomial given their
    number, which is taken from our counts of the same strategy, and dF1/dp = 2 / (1 + p)^2. A mean cost has
    the variance sd^2 / n. The variance of rounding to the last digit, 1/12 of its square, is added.
    """
    value, unit = float(published), 10.0 ** int(Decimal(published).as_tuple().exponent)
    if metric == "cost":
        variance = (scores.cost_sd if sd is None else sd) ** 2 / trials
    elif metric == "f1":
        p = value / (2 - value)
        variance = (2 / (1 + p) ** 2) ** 2 * p * (1 - p) / (trials * _compute_relevant_share(scores))
    else:
        variance = value * (1 - value) / trials
    return sqrt(variance + unit**2 / 12)


def _compute_relevant_share(scores: Scores) -> float:
    """Return the share of decisions that are positive or reported as positive.

    F1 = 2 hits / (2 hits + errors), as each error is a missed positive or a false report.
    """
    f1, errors = scores.f1.estimate, 1 - scores.accuracy.estimate
    hits = 1 - errors if f1 == 1 else errors * f1 / (2 * (1 - f1))
    return max(hits + errors, 1 / TRIALS)
