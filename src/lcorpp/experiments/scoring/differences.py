"""Differences between strategies on the same people, with paired confidence intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lcorpp.decision import STRATEGIES
from lcorpp.experiments.scoring.metrics import Difference, Scores, compute_mean_interval
from lcorpp.values import Array, Interval, SharedValue

Indices = np.ndarray[Any, np.dtype[np.intp]]


def find_reference(names: Sequence[str]) -> str:
    """Return the strategy with which the others are compared: the one that uses most parts.

    That is the last one in the paper's table, LCORPP, or R+P in a domain without senses. Without any of the
    paper's strategies it is the last of `names`.
    """
    shipped = [row.name for row in STRATEGIES if row.name in names]
    return shipped[-1] if shipped else names[-1]


def add_differences(scores: Sequence[Scores], cost: Array, return_: Array, f1: Array) -> list[Scores]:
    """Return the scores with how much higher those of the reference strategy are than each of them.

    All strategies decide about the same people, so a difference is the mean of the differences of single
    people, and its interval is that of this mean: it is narrower than the intervals of the two means suggest.

    Args:
        scores: k strategies.
        cost, return_: (n, k) of n people.
        f1: (n, k) linearised F1 scores of n people, see `linearise_f1`.
    """

    def subtract(r: int, k: int) -> list[Interval]:
        return [compute_mean_interval(values[:, r] - values[:, k]) for values in (cost, return_, f1)]

    return _compare(scores, subtract)


def add_exact_differences(scores: Sequence[Scores]) -> list[Scores]:
    """Return exact scores with their differences to the reference strategy; those of bounds are bounds."""

    def subtract(r: int, k: int) -> list[Interval]:
        one, other = scores[r], scores[k]
        pairs = (one.cost, other.cost), (one.return_, other.return_), (one.f1, other.f1)
        return [
            Interval(a.estimate - b.estimate, a.low - b.high, a.high - b.low, min(a.confidence, b.confidence))
            for a, b in pairs
        ]

    return _compare(scores, subtract)


def _compare(scores: Sequence[Scores], subtract: Callable[[int, int], list[Interval]]) -> list[Scores]:
    """Add differences; `subtract` returns those between two strategies: of cost, return and F1."""
    if len(scores) < 2:
        return list(scores)
    names = [row.strategy for row in scores]
    reference = find_reference(names)
    r = names.index(reference)
    return [
        row if k == r else replace(row, difference=Difference(reference, *subtract(r, k)))
        for k, row in enumerate(scores)
    ]


def linearise_f1(
    truth: Indices, reported: Indices, values: Sequence[SharedValue], positive: str | None
) -> Array:
    """Return a number for each of n decisions, whose mean is the F1 score and whose spread is that of F1.

    F1 = 2 sum(h) / sum(t + r), with h, t, r = 1 where a decision is a hit, truly positive, reported as
    positive. To first order it deviates as the mean of (2h - F1 (t + r)) / mean(t + r) does, the delta
    method, so that the interval of a mean is that of F1, and paired differences are those of means.

    Args:
        truth, reported: (n,) indices of the true and the reported values.
        positive: the positive class; None takes the macro average over all values, as in `score_decisions`.
    """
    classes = range(len(values)) if positive is None else [list(values).index(positive)]
    result = np.zeros(len(truth))
    for i in classes:
        is_true, is_reported = truth == i, reported == i
        hits, both = 2.0 * (is_true & is_reported), 1.0 * is_true + is_reported
        if both.any():
            f1 = hits.sum() / both.sum()
            result += f1 + (hits - f1 * both) / both.mean()
    return result / len(classes)
