"""When Algorithm 1 stops: the change of a confusion matrix, with its confidence interval."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.errors import DecisionError
from lcorpp.values import Array, ConfusionMatrix, Interval

N_DRAWS = 20_000
"""Draws from the posteriors of the rates; with another seed the width of an interval differs by about 1 %."""

EPSILON_PER_CLASS = 0.09
"""Default epsilon, for each class. Each of two rates then is within about .05 when Algorithm 1 stops."""


@check_arguments
def check_stopping(epsilon: float | None = None, confidence: float = 0.0) -> None:
    """Raise a DecisionError for an epsilon below 0, or a confidence that is not from 0 and below 1."""
    if epsilon is not None and not epsilon >= 0:
        raise DecisionError(f"the threshold epsilon must be at least 0, not {epsilon}")
    if not 0 <= confidence < 1:
        raise DecisionError(f"the confidence must be at least 0 and below 1, not {confidence}")


@check_arguments
def choose_epsilon(epsilon: float | None, n_classes: int) -> float:
    """Return epsilon, or its default: SSUB adds up the changes of all classes, so that it grows with them.

    Raises:
        DecisionError: epsilon is negative or NaN, or there are no classes.
    """
    check_stopping(epsilon)
    if n_classes < 1:
        raise DecisionError(f"{n_classes} classes; expected at least one")
    return EPSILON_PER_CLASS * n_classes if epsilon is None else epsilon


@check_arguments
def compute_change(before: ConfusionMatrix, after: ConfusionMatrix, confidence: float) -> Interval:
    """Return by how much the rates of two confusion matrices differ, with the interval of the true change.

    The estimate is SSUB of the smoothed rates. The true rates differ from their estimates, too: by at most r,
    in SSUB and with the given confidence. As SSUB is a norm, the true change is then at most r from the
    estimate. With confidence 0 the interval is the estimate, which makes the comparison that of the paper.

    The posterior of each row is Dirichlet's with Jeffreys' prior, so that its mean is the smoothed rates. The
    two matrices count as independent. Those of successive batches share most cases, so that their errors
    partly cancel; ignoring it makes the interval wider. That is intended: of two almost equal sets of cases
    the rates are almost equal, however few cases there are, and the batch size would decide when to stop.

    Args:
        before, after: of the same classes. A matrix without counts has uniform rates and the
            widest interval.
        confidence: from 0, below 1.

    Raises:
        DecisionError: the classes differ, or the confidence is out of range.

    Source: SSUB is from the paper's Algorithm 1; Jeffreys' prior as in `ConfusionMatrix.rates`.
    """
    if before.classes != after.classes:
        raise DecisionError(f"matrices of {before.classes} and {after.classes}; expected the same classes")
    check_stopping(confidence=confidence)
    estimate = compute_ssub(before.probabilities, after.probabilities)
    if confidence == 0:
        return Interval(estimate, estimate, estimate, 0.0)
    counts = tuple(tuple(_find_row_counts(own).ravel().tolist()) for own in (before, after))
    radius = _find_radius(counts[0], counts[1], len(before.classes), confidence)
    highest = 2.0 * len(before.classes)
    return Interval(estimate, max(0.0, estimate - radius), min(highest, estimate + radius), confidence)


def _find_row_counts(confusion: ConfusionMatrix) -> Array:
    """Return counts (n, n) of known classes whose rates have the same mean variance in each row."""
    own, others = np.moveaxis(confusion.effective_counts, 2, 0)
    cases = np.maximum(own + others, np.finfo(float).tiny)
    shares = own / cases
    spread = shares * (1 - shares)  # of one case: the variance of a rate is spread / cases
    known = (spread / cases).sum(axis=1) > 0
    by_row = np.divide(spread.sum(axis=1), (spread / cases).sum(axis=1), out=cases.min(axis=1), where=known)
    return np.asarray(shares * by_row[:, None])


@check_arguments
def compute_ssub(first: Array, second: Array) -> float:
    """Return the sum of absolute differences of two matrices of equal shape: SSUB of Algorithm 1.

    Raises:
        DecisionError: the shapes differ.
    """
    if np.shape(first) != np.shape(second):
        raise DecisionError(
            f"matrices of shapes {np.shape(first)} and {np.shape(second)}; expected equal ones"
        )
    return float(np.abs(np.subtract(first, second)).sum())


@lru_cache
def _find_radius(
    before: tuple[float, ...], after: tuple[float, ...], n_classes: int, confidence: float
) -> float:
    """Return the quantile of SSUB between the errors of the rates of two matrices of counts, row by row."""
    rng = np.random.default_rng(0)
    errors = []
    for counts in (before, after):
        weights = np.reshape(counts, (n_classes, n_classes)) + 0.5
        gammas = rng.standard_gamma(weights, size=(N_DRAWS, *weights.shape))
        rates = gammas / gammas.sum(axis=2, keepdims=True)
        errors.append(rates - weights / weights.sum(axis=1, keepdims=True))
    sums = np.abs(errors[1] - errors[0]).sum(axis=(1, 2))
    return float(np.quantile(sums, confidence))
