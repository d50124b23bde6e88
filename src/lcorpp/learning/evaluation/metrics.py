"""How good scores are, one class against the rest: order (AUC), distance (Brier), calibration (ECE).

Every function takes `weights` (resamples, cases), how often each case counts, and gives one figure for each
row: with one row of ones it is the figure itself, with `intervals.resampled` its resamples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import betaincinv

from lcorpp.values import Array

Flags = npt.NDArray[np.bool_]

BINS = 10
"""Parts of a reliability curve, with as many cases each."""

CHANCES = 400
"""Draws for the calibration error that right probabilities show by chance."""


def auc(scores: Array, positive: Flags, weights: Array) -> Array:
    """(resamples,) the chance that a positive case has a higher score than another one, ties counting half.

    Args:
        scores: (cases,). positive: (cases,). weights: (resamples, cases).

    A resample without a case of each kind gives NaN.

    Source: Hanley and McNeil, Radiology 143, 1982.
    """
    order = np.argsort(scores, kind="stable")
    first = np.flatnonzero(np.r_[True, np.diff(scores[order]) > 0])  # where each distinct score begins
    sorted_weights, is_positive = weights[:, order], positive[order]
    hits = np.add.reduceat(sorted_weights * is_positive, first, axis=1)
    others = np.add.reduceat(sorted_weights * ~is_positive, first, axis=1)
    below = np.cumsum(others, axis=1) - others
    pairs = hits.sum(axis=1) * others.sum(axis=1)
    wins = (hits * (below + others / 2)).sum(axis=1)
    return np.asarray(np.divide(wins, pairs, out=np.full(len(weights), np.nan), where=pairs > 0))


def brier(scores: Array, positive: Flags, weights: Array) -> Array:
    """(resamples,) the mean squared distance of the probability from 1 and 0; .25 is saying .5 of everybody.

    Source: Brier, Monthly Weather Review 78, 1950.
    """
    return np.asarray(weights @ (scores - positive) ** 2 / weights.sum(axis=1))


def calibration_error(scores: Array, positive: Flags, weights: Array) -> Array:
    """(resamples,) the expected calibration error: mean distance of share and probability over the bins.

    The bins hold equally many cases, as bins of equal width would leave most cases in one or two. It is
    never negative, so right probabilities show one too: compare `error_by_chance`.

    Source: Naeini, Cooper and Hauskrecht, AAAI 2015; Nixon et al., CVPR workshops 2019.
    """
    member = _members(scores)
    gaps = (weights * (positive - scores)) @ member
    return np.asarray(np.abs(gaps).sum(axis=1) / weights.sum(axis=1))


def error_by_chance(scores: Array, *, seed: int = 0) -> float:
    """The mean calibration error of these probabilities (cases,) if they were exactly right."""
    rng = np.random.default_rng(seed)
    member = _members(scores)
    drawn = rng.random((CHANCES, len(scores))) < scores
    return float((np.abs((drawn - scores) @ member).sum(axis=1) / len(scores)).mean())


@dataclass(frozen=True)
class Bin:
    """A part of the reliability curve: cases of about one probability.

    said: the mean probability. share: how many of them are positive. low, high: its 95 % interval.
    """

    said: float
    share: float
    low: float
    high: float
    cases: int


def reliability(scores: Array, positive: Flags) -> tuple[Bin, ...]:
    """The reliability curve in at most `BINS` parts of equally many cases, with Jeffreys' intervals.

    Source: DeGroot and Fienberg, The Statistician 32, 1983.
    """
    bins = []
    for member in _members(scores).T.astype(bool):
        cases, hits = int(member.sum()), int(positive[member].sum())
        ends = [betaincinv(hits + 0.5, cases - hits + 0.5, tail) for tail in (0.025, 0.975)]
        low, high = (float(ends[0]) if hits else 0.0), (float(ends[1]) if hits < cases else 1.0)
        bins.append(Bin(float(scores[member].mean()), hits / cases, low, high, cases))
    return tuple(bins)


def _members(scores: Array) -> Array:
    """(cases, bins) 1 where a case is in a bin; equal scores are in one bin."""
    edges = np.unique(np.quantile(scores, np.linspace(0, 1, BINS + 1)[1:-1]))
    _, index = np.unique(np.searchsorted(edges, scores, side="left"), return_inverse=True)
    return np.eye(index.max() + 1)[index]
