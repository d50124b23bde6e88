"""Intervals and tests of probabilities, on the log-odds scale."""

from __future__ import annotations

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


def compare_log_odds(
    stated: float | None, estimate: float, variance: float
) -> tuple[tuple[float, float], float]:
    """Return the 95 % interval of a probability, and the p-value of what is stated (1 if nothing is)."""
    spread = np.sqrt(variance) / (estimate * (1 - estimate))
    odds = estimate / (1 - estimate)
    low, high = (float(1 / (1 + np.exp(-side * Z95 * spread) / odds)) for side in (-1, 1))
    if stated is None:
        return (low, high), 1.0
    z = float(log(odds) - logit(bound_stated(np.array(stated)))) / spread
    return (low, high), float(chi2.sf(z * z, 1))


def match_chi_squared(weights: Array) -> tuple[float, float]:
    """Return the scale and the degrees of freedom of a chi-squared variable like a weighted sum of such.

    Each has one degree; mean and variance of the sum are matched.

    Source: Satterthwaite, "An approximate distribution of estimates of variance components", Biometrics
    Bulletin 2, 1946.
    """
    total, squares = float(weights.sum()), float((weights**2).sum())
    return squares / total, total**2 / squares
