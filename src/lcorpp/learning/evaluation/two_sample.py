"""Two-sample tests: do two sets of signals, or two counts of successes, come from one distribution?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.distance import cdist
from scipy.stats import hypergeom

from lcorpp.arguments import check_arguments
from lcorpp.learning.features.summaries import SummaryFeatures
from lcorpp.values import Array, stack_signals

MAX_CASES = 500
"""Cases of each sample that are compared; of more, a random subset."""

MAX_PERMUTATIONS, MAX_EXTREME = 9999, 20
"""Maximum number of permutations; sampling ends before if `MAX_EXTREME` are as extreme as the samples."""

PERMUTATIONS_AT_ONCE = 250


@check_arguments
def compare_signals(first: Sequence[Array], second: Sequence[Array], rng: np.random.Generator) -> float:
    """Return the p-value of the hypothesis that two samples of signals have one distribution.

    The statistic is the energy distance between summaries of the signals, each summary in units of its
    standard deviation. Its distribution under the hypothesis is that of random permutations of the cases, so
    that a p-value of at most p has at most the probability p, whatever the signals are.

    Args:
        first, second: signals of a sense, one at least in each: tracks (channels, time points) of any length,
            or features (features,).

    Source: Székely and Rizzo, Testing for equal distributions in high dimension, InterStat 5 (2004); for the
    number of permutations Besag and Clifford, Sequential Monte Carlo p-values, Biometrika 78 (1991).
    """
    samples = [_choose(signals, rng) for signals in (first, second)]
    cases = _describe(stack_signals([*samples[0], *samples[1]]))
    distances = cdist(cases, cases)
    members = np.zeros((1, len(cases)))
    members[0, : len(samples[0])] = 1
    observed = _compute_energy(distances, members)[0]
    extreme, done = 0, 0
    while done < MAX_PERMUTATIONS:
        n = min(PERMUTATIONS_AT_ONCE, MAX_PERMUTATIONS - done)
        permuted = rng.permuted(np.repeat(members, n, axis=0), axis=1)
        # equal cases give equal energies, but for rounding
        is_extreme = _compute_energy(distances, permuted) >= observed - 1e-9 * abs(observed)
        hits = extreme + np.cumsum(is_extreme)
        if hits[-1] >= MAX_EXTREME:
            return MAX_EXTREME / float(done + np.searchsorted(hits, MAX_EXTREME) + 1)
        extreme, done = int(hits[-1]), done + n
    return (extreme + 1) / (done + 1)


@check_arguments
def compare_rates(before: tuple[int, int], after: tuple[int, int]) -> float:
    """Return the p-value of the hypothesis that the probability of success has not decreased.

    Args:
        before, after: the number of successes, and that of all cases.

    Source: Fisher's exact test, one-sided.
    """
    (k, n), (k_after, n_after) = before, after
    return float(hypergeom.cdf(k_after, n + n_after, k + k_after, n_after))


def _choose(signals: Sequence[Array], rng: np.random.Generator) -> list[Array]:
    if len(signals) <= MAX_CASES:
        return list(signals)
    return [signals[i] for i in rng.choice(len(signals), MAX_CASES, replace=False)]


def _describe(signals: Array) -> Array:
    """(cases, features) features, or summaries of tracks, in units of their standard deviations."""
    features = signals if signals.ndim == 2 else SummaryFeatures(rate=None).fit_transform(signals)
    spread = features.std(axis=0)
    varies = spread > 1e-12 * np.abs(features).max(axis=0, initial=0)
    return np.asarray(features[:, varies] / spread[varies])


def _compute_energy(distances: Array, members: Array) -> Array:
    """(permutations,) the energy distances. members: (permutations, cases) 1 in the first sample, else 0."""
    first = (members @ distances * members).sum(axis=1)  # sums of the distances within the first sample,
    all_of_first = members @ distances.sum(axis=1)  # from its cases to all,
    across = all_of_first - first
    second = distances.sum() - all_of_first - across
    n = members[0].sum()
    m = len(distances) - n
    return np.asarray(2 * across / (n * m) - first / n**2 - second / m**2)
