"""Intervals and tests of probabilities, on the log-odds scale."""

from __future__ import annotations

from collections.abc import Sequence
from math import log

import numpy as np
from scipy.special import logit
from scipy.stats import chi2

from lcorpp.fitting.uncertainty import Z95
from lcorpp.values import Array
from lcorpp.values.probabilities import MIN_CREDIBLE


def bound_stated(stated: Array) -> Array:
    """Return stated probabilities, bounded by `MIN_CREDIBLE`."""
    bounded: Array = np.clip(stated, MIN_CREDIBLE, 1 - MIN_CREDIBLE)
    return bounded


def find_spread(estimate: float, variance: float) -> float:
    """Return the standard error of the log odds of an estimated probability."""
    return float(np.sqrt(variance)) / (estimate * (1 - estimate))


def compare_log_odds(
    stated: float | None, estimate: float, variance: float, limits: tuple[float, float] = (-Z95, Z95)
) -> tuple[tuple[float, float], float]:
    """Return the 95 % interval of a probability, and the p-value of what is stated (1 if nothing is).

    Args:
        limits: 95 % of the errors of the log odds lie between them, in standard errors.
    """
    spread = find_spread(estimate, variance)
    odds = estimate / (1 - estimate)
    low, high = (float(1 / (1 + np.exp(error * spread) / odds)) for error in reversed(limits))
    if stated is None:
        return (low, high), 1.0
    z = float(log(odds) - logit(bound_stated(np.array(stated)))) / spread
    return (low, high), float(chi2.sf(z * z, 1))


def find_limits(errors: Sequence[float]) -> tuple[float, float]:
    """Return limits between which 95 % of errors like these lie, see `compare_log_odds`.

    Source: Davison and Hinkley, "Bootstrap Methods and their Application", 1997, section 5.2 (the bootstrap t
    method); the k-th of n is the quantile k / (n + 1).
    """
    low, high = np.quantile(errors, [0.025, 0.975], method="weibull")
    return float(low), float(high)


def match_chi_squared(weights: Array) -> tuple[float, float]:
    """Return the scale and the degrees of freedom of a chi-squared variable like a weighted sum of such.

    Each has one degree; mean and variance of the sum are matched.

    Source: Satterthwaite, "An approximate distribution of estimates of variance components", Biometrics
    Bulletin 2, 1946.
    """
    total, squares = float(weights.sum()), float((weights**2).sum())
    return squares / total, total**2 / squares
