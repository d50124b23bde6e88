"""Scores of many decisions, each with a 95 % confidence interval."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from lcorpp.notebook import html_table
from lcorpp.values import Z95, Array, Interval, SharedValue

Proportion = Callable[..., Interval]
"""A function that returns hits / total with its interval: hits, total and those of an unknown part."""

METRICS = ("f1", "precision", "recall", "accuracy", "cost", "return")
"""The names of the scores in tables and files."""


@dataclass(frozen=True)
class Difference:
    """How much higher the scores of a reference strategy are than another's, with paired intervals.

    reference: its name. cost, return_, f1: the reference's minus the other's, as in `Scores`.
    """

    reference: str
    cost: Interval
    return_: Interval
    f1: Interval


@dataclass(frozen=True, eq=False)
class Scores:
    """The scores of a strategy.

    counts: (V, V + 1) counts[i, j] decisions with true value i and reported value j; the last column counts
        decisions without a report.
    cost: mean cost of the actions before the report.
    return_: mean return: reward of the report minus cost, undiscounted.
    cost_sd: standard deviation of the cost of single decisions.
    variables: with several shared variables, the accuracy of each; `accuracy` is that of all together.
    difference: to the reference strategy on the same people; None for the reference itself.
    """

    strategy: str
    counts: Array
    f1: Interval
    precision: Interval
    recall: Interval
    accuracy: Interval
    cost: Interval
    return_: Interval
    cost_sd: float
    variables: Mapping[str, Interval] = field(default_factory=dict)
    difference: Difference | None = None

    @property
    def metrics(self) -> dict[str, Interval]:
        """The scores by their names in tables, `METRICS`."""
        scores = (self.f1, self.precision, self.recall, self.accuracy, self.cost, self.return_)
        return dict(zip(METRICS, scores, strict=True))

    @property
    def cells(self) -> dict[str, float]:
        """The scores of a row of a file, with the ends of the intervals: NAME, NAME_low, NAME_high.

        With several shared variables, accuracy_NAME is the accuracy of each.
        """
        parts = {f"accuracy_{name}": accuracy for name, accuracy in self.variables.items()}
        rows = (make_cells(name, interval) for name, interval in (self.metrics | parts).items())
        return {name: value for cells in rows for name, value in cells.items()}

    @property
    def columns(self) -> dict[str, Interval]:
        """The scores of a table: of several variables the accuracy of each and of all together.

        Precision and recall of single combinations of values say little there.
        """
        if not self.variables:
            return {"F1": self.f1} | {name: self.metrics[name] for name in METRICS[1:]}
        return {**self.variables, "all": self.accuracy, "cost": self.cost, "return": self.return_}

    def __repr__(self) -> str:
        return (
            f"<Scores {self.strategy}: F1 {self.f1:.3f}, accuracy {self.accuracy:.3f}, cost {self.cost:.2f},"
            f" return {self.return_:.2f}>"
        )

    def _repr_html_(self) -> str:
        return scores_to_html([self])


def make_cells(name: str, interval: Interval) -> dict[str, float]:
    """Return the three cells of a quantity with its interval."""
    return {name: interval.estimate, f"{name}_low": interval.low, f"{name}_high": interval.high}


def score_decisions(
    strategy: str,
    counts: Array,
    cost: Array,
    return_: Array,
    *,
    values: Sequence[SharedValue],
    positive: str | None,
    variables: Sequence[str] = (),
) -> Scores:
    """Score simulated decisions.

    Args:
        counts: (V, V + 1) as in `Scores`.
        cost, return_: (n,) one number per decision.
        values: the V shared values.
        positive: the positive class of F1, precision and recall; None takes the macro average over all
            values. The ends of the intervals are averaged as well, which makes them wide.
        variables: names of the shared variables; each value is a tuple if they are several.

    Accuracy, precision and recall have Wilson intervals. F1 = 2p / (1 + p) grows with p, the share of true
    positives among all decisions that are positive or reported as positive, so its interval is the
    transformed Wilson interval of p. Cost and return have normal intervals of the mean.
    """
    shares = _score_classification(counts, values, positive, _estimate_proportion)
    means = compute_mean_interval(cost), compute_mean_interval(return_)
    parts = _score_variables(counts, values, variables, _estimate_proportion)
    return Scores(strategy, counts, *shares, *means, _compute_sd(cost), parts)


def score_probabilities(
    strategy: str,
    joint: Array,
    cost: Interval,
    return_: Interval,
    cost_sd: float,
    *,
    values: Sequence[SharedValue],
    positive: str | None,
    variables: Sequence[str] = (),
    dropped: Array | None = None,
) -> Scores:
    """Score exact probabilities instead of counts; the intervals have zero width.

    Args:
        joint: (V, V + 1) probability of true value i and reported value j.
        dropped: (V,) probability of each true value with an unknown report; the ends of the intervals are
            the scores if all of these decisions are wrong, and if all are right.
    """
    shares = _score_classification(joint, values, positive, _bound_proportion, dropped)
    parts = _score_variables(joint, values, variables, _bound_proportion, dropped)
    return Scores(strategy, joint, *shares, cost, return_, cost_sd, parts)


def _estimate_proportion(hits: float, total: float, _hits: float = 0.0, _misses: float = 0.0) -> Interval:
    """Return the proportion with its Wilson interval; counts have no unknown part."""
    return Interval.from_count(hits, total)


def _bound_proportion(hits: float, total: float, more_hits: float = 0.0, misses: float = 0.0) -> Interval:
    """Return the proportion of exact probabilities.

    Args:
        more_hits: of the unknown part, what belongs to the total and may be hits.
        misses: of the unknown part, what may be misses or not belong to the total.
    """
    if not more_hits + misses:
        return Interval.exact(hits / total if total else 0.0)
    low, high = hits / (total + more_hits + misses), (hits + more_hits) / (total + more_hits)
    return Interval(hits / total if total else low, low, high, confidence=1.0)


def compute_mean_interval(numbers: Array) -> Interval:
    """Return the mean of numbers (n,) with the normal interval."""
    middle = float(np.mean(numbers))
    half = Z95 * _compute_sd(numbers) / float(np.sqrt(len(numbers)))
    return Interval(middle, middle - half, middle + half)


def _compute_sd(numbers: Array) -> float:
    return float(np.std(numbers, ddof=1)) if len(numbers) > 1 else 0.0


def _score_classification(
    counts: Array,
    values: Sequence[SharedValue],
    positive: str | None,
    make_proportion: Proportion,
    dropped: Array | None = None,
) -> tuple[Interval, Interval, Interval, Interval]:
    """Return F1, precision, recall and accuracy.

    Args:
        counts: (V, V + 1) counts or probabilities, as in `Scores`.
        positive: the positive class, None for macro averages.
        make_proportion: returns the proportion hits / total with its interval.
        dropped: (V,) probabilities of decisions with an unknown report.
    """
    unknown = np.zeros(len(values)) if dropped is None else dropped
    rows = range(len(values)) if positive is None else [list(values).index(positive)]
    f1, precision, recall = [], [], []
    for i in rows:
        hits, reported, actual = counts[i, i], counts[:, i].sum(), counts[i].sum()
        others = float(unknown.sum() - unknown[i])
        jaccard = make_proportion(hits, reported + actual - hits, unknown[i], others)
        middle, low, high = (2 * p / (1 + p) for p in (jaccard.estimate, jaccard.low, jaccard.high))
        f1.append(Interval(middle, low, high, jaccard.confidence))
        precision.append(make_proportion(hits, reported, unknown[i], others))
        recall.append(make_proportion(hits, actual, unknown[i]))
    square = counts[:, : len(values)]
    accuracy = make_proportion(float(np.trace(square)), float(counts.sum()), float(unknown.sum()))
    return _average_intervals(f1), _average_intervals(precision), _average_intervals(recall), accuracy


def _score_variables(
    counts: Array,
    values: Sequence[SharedValue],
    variables: Sequence[str],
    make_proportion: Proportion,
    dropped: Array | None = None,
) -> dict[str, Interval]:
    """Return the accuracy of each of several shared variables; arguments as of `_score_classification`."""
    if len(variables) < 2:
        return {}
    square, total = counts[:, : len(values)], float(counts.sum())
    unknown = 0.0 if dropped is None else float(dropped.sum())
    accuracies = {}
    for name, column in zip(variables, np.array(values).T, strict=True):
        hits = float(square[column[:, None] == column].sum())
        accuracies[name] = make_proportion(hits, total, unknown)
    return accuracies


def _average_intervals(estimates: Sequence[Interval]) -> Interval:
    ends = np.array([(e.estimate, e.low, e.high) for e in estimates])
    middle, low, high = ends.mean(axis=0).tolist()
    return Interval(middle, low, high, min([e.confidence for e in estimates]))


def scores_to_html(scores: Sequence[Scores]) -> str:
    """Return the scores of several strategies as an HTML table, intervals included."""
    rows = [
        (row.strategy, *(format(cell, get_format(name)) for name, cell in row.columns.items()))
        for row in scores
    ]
    return html_table(("strategy", *(scores[0].columns if scores else METRICS)), rows)


def get_format(name: str) -> str:
    """Return the format of the numbers of a score: two digits for rewards, three for proportions."""
    return ".2f" if name in ("cost", "return") else ".3f"
