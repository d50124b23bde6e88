"""Scores of many decisions, each with a 95% interval."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from lcorpp.values import Array, Interval

Z95 = NormalDist().inv_cdf(0.975)


@dataclass(frozen=True, eq=False)
class Scores:
    """What a strategy achieved.

    counts: (V, V + 1) decisions of true value i that reported value j; the last column holds those
        without a report.
    cost: what the actions before the report cost. earned: the return, report reward minus cost, undiscounted.
    cost_sd: standard deviation of the cost over single decisions.
    """

    strategy: str
    counts: Array
    f1: Interval
    precision: Interval
    recall: Interval
    accuracy: Interval
    cost: Interval
    earned: Interval
    cost_sd: float


def scores(
    strategy: str, counts: Array, cost: Array, earned: Array, *, values: Sequence[str], positive: str | None
) -> Scores:
    """The scores of simulated decisions.

    Args:
        counts: (V, V + 1) as in `Scores`.
        cost, earned: (n,) one figure a decision.
        values: the V target values.
        positive: the value that F1, precision and recall are about; None averages them over all values
            (macro average), and their intervals' ends as well, which makes those wide rather than narrow.

    The intervals of accuracy, precision and recall are Wilson's. F1 = 2p / (1 + p) for the share p of true
    positives among all cases that are positive or called so, and grows with p: its interval is
    Wilson's for p, carried over. Those of cost and return are the normal ones for a mean.
    """
    confusion = _classification(counts, values, positive, wilson)
    return Scores(strategy, counts, *confusion, mean(cost), mean(earned), _sd(cost))


def exact_scores(
    strategy: str,
    joint: Array,
    cost: float,
    earned: float,
    cost_sd: float,
    *,
    values: Sequence[str],
    positive: str | None,
) -> Scores:
    """The scores of probabilities in place of counts: intervals of no width.

    Args:
        joint: (V, V + 1) probability of true value i and report j.
    """
    confusion = _classification(joint, values, positive, _ratio)
    return Scores(strategy, joint, *confusion, Interval.exact(cost), Interval.exact(earned), cost_sd)


def wilson(hits: float, total: float) -> Interval:
    """A share with Wilson's interval; nothing seen is 0 with the interval [0, 1]."""
    if total == 0:
        return Interval(0.0, 0.0, 1.0)
    p, z2 = hits / total, Z95**2 / total
    middle = (p + z2 / 2) / (1 + z2)
    half = float(np.sqrt(z2 * (p * (1 - p) + z2 / 4))) / (1 + z2)
    return Interval(p, min(p, max(0.0, middle - half)), max(p, min(1.0, middle + half)))


def mean(figures: Array) -> Interval:
    """The mean of figures (n,) with the normal interval."""
    middle = float(np.mean(figures))
    half = Z95 * _sd(figures) / float(np.sqrt(len(figures)))
    return Interval(middle, middle - half, middle + half)


def _sd(figures: Array) -> float:
    return float(np.std(figures, ddof=1)) if len(figures) > 1 else 0.0


def _ratio(hits: float, total: float) -> Interval:
    share = hits / total if total else 0.0
    return Interval.exact(share)


def _classification(
    counts: Array, values: Sequence[str], positive: str | None, share: Callable[[float, float], Interval]
) -> tuple[Interval, Interval, Interval, Interval]:
    """F1, precision, recall and accuracy."""
    rows = range(len(values)) if positive is None else [list(values).index(positive)]
    f1, precision, recall = [], [], []
    for i in rows:
        hit, called, meant = counts[i, i], counts[:, i].sum(), counts[i].sum()
        either = share(hit, called + meant - hit)
        f1.append(Interval(*(2 * p / (1 + p) for p in (either.estimate, either.low, either.high))))
        precision.append(share(hit, called))
        recall.append(share(hit, meant))
    square = counts[:, : len(values)]
    accuracy = share(float(np.trace(square)), float(counts.sum()))
    return _average(f1), _average(precision), _average(recall), accuracy


def _average(estimates: Sequence[Interval]) -> Interval:
    return Interval(
        float(np.mean([e.estimate for e in estimates])),
        float(np.mean([e.low for e in estimates])),
        float(np.mean([e.high for e in estimates])),
    )
