"""Metrics of probabilities, one class against the rest: AUC, Brier score, expected calibration error.

Every metric takes `weights` (resamples, cases), the number of times each case counts, and returns one value
per row: a row of ones gives the metric itself, `cluster_bootstrap_weights` its bootstrap distribution.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import betaincinv

from lcorpp.values import Array, Flags, Interval

BOOTSTRAP_REPLICATES = 1000
"""Bootstrap resamples; with another seed the ends of an interval move by about .02 of its width."""

N_BINS = 10
"""Bins of a reliability diagram, each with equally many cases."""

N_SIMULATIONS = 400
"""Simulated label vectors for the calibration error of perfectly calibrated probabilities."""


def cluster_bootstrap_weights(
    groups: Sequence[str], *, count: int = BOOTSTRAP_REPLICATES, seed: int = 0
) -> Array:
    """(count, cases) the number of times each case is drawn if whole groups are drawn with replacement.

    Cases of one person are not independent, so a resample contains all of them or none.

    Args:
        groups: (cases,) the group, e.g. the person, of each case.
        seed: seed of the resamples; the same resamples serve for all metrics.

    Source: Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapter 8.
    """
    names, index = np.unique(np.array(groups), return_inverse=True)
    rng = np.random.default_rng(seed)
    draws = rng.multinomial(len(names), np.full(len(names), 1 / len(names)), size=count)
    return np.asarray(draws[:, index], dtype=np.float64)


def bootstrap_interval(value: float, resampled: Array) -> Interval:
    """The 95 % percentile interval of a metric from its values on resamples (count,); NaN is ignored."""
    known = resampled[np.isfinite(resampled)]
    if not len(known) or not np.isfinite(value):
        return Interval(float("nan"), float("nan"), float("nan"))
    low, high = np.quantile(known, [0.025, 0.975])
    return Interval(float(value), float(min(low, value)), float(max(high, value)))


def jeffreys_interval(count: float, cases: float, *, level: float = 0.95, smoothing: float = 0.5) -> Interval:
    """The fraction count / cases with its Beta interval.

    The lower end is 0 if `count` is 0, the upper end 1 if it is `cases`, as is usual for Jeffreys' intervals.

    Args:
        level: the posterior probability of the interval.
        smoothing: parameter of the Beta prior: 1/2 gives Jeffreys' interval, 1 that of a uniform prior.

    Source: Brown, Cai and DasGupta, Statistical Science 16, 2001.
    """
    a, b, tail = count + smoothing, cases - count + smoothing, (1 - level) / 2
    low = float(betaincinv(a, b, tail)) if count else 0.0
    high = float(betaincinv(a, b, 1 - tail)) if count < cases else 1.0
    return Interval(count / cases if cases else 0.0, low, high, level)


def compute_auc(scores: Array, positive: Flags, weights: Array) -> Array:
    """(n,) the area under the ROC curve, of one score with n weights or of n scores; ties count half.

    Args:
        scores, positive: (cases,) or (n, cases). weights: (n, cases) or (1, cases).

    The AUC without both positive and negative cases is NaN.

    Source: Hanley and McNeil, Radiology 143, 1982.
    """
    scores, positive = np.atleast_2d(scores, positive)
    order = np.argsort(scores, axis=1, kind="stable")
    rises = np.diff(np.take_along_axis(scores, order, axis=1), axis=1) > 0
    sorted_weights = weights[:, order[0]] if len(order) == 1 else np.take_along_axis(weights, order, axis=1)
    positives = sorted_weights * np.take_along_axis(positive, order, axis=1)
    negatives = sorted_weights - positives
    sums = np.cumsum(negatives, axis=1)
    below, at_most = sums - negatives, sums  # of negative cases, for each case
    if not rises.all():
        edge = np.ones((len(scores), 1), dtype=bool)
        is_first, is_last = np.hstack([edge, rises]), np.hstack([rises, edge])  # of the cases of one score
        below = np.maximum.accumulate(np.where(is_first, below, 0), axis=1)
        at_most = np.minimum.accumulate(np.where(is_last, sums, np.inf)[:, ::-1], axis=1)[:, ::-1]
    pairs = positives.sum(axis=1) * negatives.sum(axis=1)
    wins = np.einsum("nc,nc->n", positives, below + at_most) / 2
    return np.asarray(np.divide(wins, pairs, out=np.full(len(pairs), np.nan), where=pairs > 0))


def brier(scores: Array, positive: Flags, weights: Array) -> Array:
    """(resamples,) the Brier score: mean squared error of the probabilities; constant .5 scores .25.

    Source: Brier, Monthly Weather Review 78, 1950.
    """
    return np.asarray(weights @ (scores - positive) ** 2 / weights.sum(axis=1))


def expected_calibration_error(scores: Array, positive: Flags, weights: Array) -> Array:
    """(resamples,) the expected calibration error (ECE): mean of |frequency - probability| over the bins.

    The bins contain equally many cases; bins of equal width would leave most cases in one or two. The ECE is
    never negative and above 0 even for perfect probabilities: compare `expected_ece_if_calibrated`.

    Source: Naeini, Cooper and Hauskrecht, AAAI 2015; Nixon et al., CVPR workshops 2019.
    """
    membership = _bin_membership(scores)
    gaps = (weights * (positive - scores)) @ membership
    return np.asarray(np.abs(gaps).sum(axis=1) / weights.sum(axis=1))


def expected_ece_if_calibrated(scores: Array, *, seed: int = 0) -> float:
    """The mean ECE of the probabilities (cases,) if labels are drawn from them."""
    rng = np.random.default_rng(seed)
    membership = _bin_membership(scores)
    labels = rng.random((N_SIMULATIONS, len(scores))) < scores
    return float((np.abs((labels - scores) @ membership).sum(axis=1) / len(scores)).mean())


@dataclass(frozen=True)
class ReliabilityBin:
    """A bin of a reliability diagram.

    predicted: mean predicted probability. observed: fraction of positives with its 95 % interval. cases:
        number.
    """

    predicted: float
    observed: Interval
    cases: int


def reliability(scores: Array, positive: Flags) -> tuple[ReliabilityBin, ...]:
    """The reliability diagram: at most `N_BINS` bins of equally many cases, with Jeffreys' intervals.

    Source: DeGroot and Fienberg, The Statistician 32, 1983.
    """
    bins = []
    for member in _bin_membership(scores).T.astype(bool):
        cases, positives = int(member.sum()), int(positive[member].sum())
        bins.append(ReliabilityBin(float(scores[member].mean()), jeffreys_interval(positives, cases), cases))
    return tuple(bins)


def _bin_membership(scores: Array) -> Array:
    """(cases, bins) 1 if a case is in a bin; equal scores share a bin."""
    edges = np.unique(np.quantile(scores, np.linspace(0, 1, N_BINS + 1)[1:-1]))
    _, index = np.unique(np.searchsorted(edges, scores, side="left"), return_inverse=True)
    return np.eye(index.max() + 1)[index]
