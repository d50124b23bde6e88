"""Scores of simulated decisions, and of the probabilities of all decisions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lcorpp.scoring.metrics import Scores
from lcorpp.values import Array, Indices, Interval, SharedValue

if TYPE_CHECKING:  # the scores of decisions do without
    from lcorpp.decision import Strategy
    from lcorpp.domains import Domain
    from lcorpp.scoring.episode_sums import EpisodeSums

NO_LIMITS: Mapping[str, Interval] = {}
"""Of a domain without limits."""

Proportion = Callable[..., Interval]
"""A function that returns hits / total with its interval: hits, total and those of an unknown part."""


def score_decisions(
    strategy: str,
    truth: Indices,
    reported: Indices,
    cost: Array,
    return_: Array,
    *,
    values: Sequence[SharedValue],
    positive: str | None,
    variables: Sequence[str] = (),
    gap: float | None = None,
    limits: Mapping[str, Interval] = NO_LIMITS,
) -> Scores:
    """Score n simulated decisions.

    Args:
        truth, reported: (n,) indices of the true and the reported values; V for no report.
        cost, return_: (n,) of each decision, as in `Scores`.
        values: the V shared values.
        positive: the positive class of F1, precision and recall; None takes the macro average over all
            values. The ends of the intervals are averaged as well, which makes them wide.
        variables: names of the shared variables; each value is a tuple if they are several.
        gap, limits: as in `Scores`.

    Accuracy, precision and recall have Wilson intervals. F1 = 2p / (1 + p) grows with p, the share of true
    positives among all decisions that are positive or reported as positive, so its interval is the
    transformed Wilson interval of p. Cost and return have normal intervals of the mean.
    """
    counts = np.zeros((len(values), len(values) + 1))
    np.add.at(counts, (truth, reported), 1)
    f1 = _linearise_f1(truth, reported, _find_classes(values, positive))
    return Scores(
        strategy,
        counts,
        **_score_reports(counts, values, positive, variables, _estimate_proportion),
        cost=Interval.from_sample(cost),
        return_=Interval.from_sample(return_),
        cost_sd=float(np.std(cost, ddof=min(1, len(cost) - 1))),  # one decision has no spread
        samples={"f1": f1, "cost": cost, "return": return_},
        gap=gap,
        limits=limits,
    )


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
    gap: float | None = None,
) -> Scores:
    """Score exact probabilities instead of decisions; the intervals have zero width.

    Args:
        joint: (V, V + 1) probability of true value i and reported value j.
        dropped: (V,) probability of each true value with an unknown report; the ends of the intervals are
            the scores if all of these decisions are wrong, and if all are right.
        gap: as in `Scores`.
    """
    reports = _score_reports(joint, values, positive, variables, _bound_proportion, dropped)
    return Scores(strategy, joint, **reports, cost=cost, return_=return_, cost_sd=cost_sd, gap=gap)


def score_sums(domain: Domain, strategy: Strategy, sums: EpisodeSums, gap: float | None) -> Scores:
    """Return the scores of a strategy from the sums over its episodes; gap: as in `Scores`."""
    return score_probabilities(
        strategy.name,
        sums.joint,
        sums.cost_bounds,
        sums.return_bounds,
        float(np.sqrt(max(sums.squared_cost - sums.cost**2, 0.0))),
        values=domain.values,
        positive=domain.positive,
        variables=domain.reasoning.shared,
        dropped=sums.dropped,
        gap=gap,
    )


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


def _score_reports(
    counts: Array,
    values: Sequence[SharedValue],
    positive: str | None,
    variables: Sequence[str],
    make_proportion: Proportion,
    dropped: Array | None = None,
) -> dict[str, Any]:
    """Return F1, precision, recall, accuracy and the accuracy of each of several variables, as in `Scores`.

    Args:
        counts: (V, V + 1) counts or probabilities, as in `Scores`.
        make_proportion: returns the proportion hits / total with its interval.
        dropped: (V,) probabilities of decisions with an unknown report.
    """
    unknown = np.zeros(len(values)) if dropped is None else dropped
    total, n_unknown = float(counts.sum()), float(unknown.sum())
    f1, precision, recall = [], [], []
    for i in _find_classes(values, positive):
        hits, reported, actual = counts[i, i], counts[:, i].sum(), counts[i].sum()
        others = n_unknown - float(unknown[i])
        jaccard = make_proportion(hits, reported + actual - hits, unknown[i], others)
        middle, low, high = (2 * p / (1 + p) for p in (jaccard.estimate, jaccard.low, jaccard.high))
        f1.append(Interval(middle, low, high, jaccard.confidence))
        precision.append(make_proportion(hits, reported, unknown[i], others))
        recall.append(make_proportion(hits, actual, unknown[i]))
    square = counts[:, : len(values)]
    parts = {}
    if len(variables) > 1:
        for name, column in zip(variables, np.array(values).T, strict=True):
            right = float(square[column[:, None] == column].sum())
            parts[name] = make_proportion(right, total, n_unknown)
    return {
        "f1": _average_intervals(f1),
        "precision": _average_intervals(precision),
        "recall": _average_intervals(recall),
        "accuracy": make_proportion(float(np.trace(square)), total, n_unknown),
        "variables": parts,
    }


def _find_classes(values: Sequence[SharedValue], positive: str | None) -> Sequence[int]:
    """Return the indices of the classes whose F1, precision and recall are averaged."""
    return range(len(values)) if positive is None else [list(values).index(positive)]


def _average_intervals(estimates: Sequence[Interval]) -> Interval:
    ends = np.array([(e.estimate, e.low, e.high) for e in estimates])
    middle, low, high = ends.mean(axis=0).tolist()
    return Interval(middle, low, high, min([e.confidence for e in estimates]))


def _linearise_f1(truth: Indices, reported: Indices, classes: Sequence[int]) -> Array:
    """Return a number for each of n decisions, whose mean is the F1 score and whose spread is that of F1.

    F1 = 2 sum(h) / sum(t + r), with h, t, r = 1 where a decision is a hit, truly positive, reported as
    positive. To first order it deviates as the mean of (2h - F1 (t + r)) / mean(t + r) does, the delta
    method, so that the interval of a mean is that of F1, and paired differences are those of means.

    Args:
        truth, reported: (n,) as in `score_decisions`. classes: the positive ones, over which F1 is averaged.
    """
    result = np.zeros(len(truth))
    for i in classes:
        is_true, is_reported = truth == i, reported == i
        hits, both = 2.0 * (is_true & is_reported), 1.0 * is_true + is_reported
        if both.any():
            f1 = hits.sum() / both.sum()
            result += f1 + (hits - f1 * both) / both.mean()
    return result / len(classes)
