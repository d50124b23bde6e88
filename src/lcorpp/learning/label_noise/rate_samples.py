"""Samples of the rates of a model with hidden classes: how uncertain its estimated rates are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lcorpp.latent_classes import normalise, normalise_logs
from lcorpp.learning.label_noise.answer_source import AnswerSource
from lcorpp.values import Array, Indices
from lcorpp.values.probabilities import MIN_LOGARITHM

N_BURN_IN, N_SWEEPS = 60, 80
"""Sweeps of each chain that are left out, as it starts at the mode, and those that count."""

MIN_CHAINS, MAX_CHAINS, MAX_CELLS = 4, 16, 50_000
"""Bounds of the number of chains; with many kinds of cases and classes there are fewer, up to these cells."""


def sample_rates(
    sources: Sequence[AnswerSource],
    contexts: Indices,
    cases: Indices,
    weights: Array,
    context_weight: float,
    matrices: Sequence[Array],
    priors: Array,
) -> tuple[Array, ...]:
    """Sample the rates of each source of answers from their posterior, by Gibbs sampling with a fixed seed.

    Each sweep samples the classes of all cases given the rates, then the rates given the classes.

    Args:
        sources: with the answers about each of U kinds of cases of K classes.
        contexts: (U,) of each kind of cases.
        cases: (U,) their number.
        weights: (U,) how much each case of the kind counts.
        context_weight: the classes of all cases count in each context like this many cases.
        matrices, priors: (R, O) of each source and (contexts, K), where the chains start.

    Returns:
        (S, R, O) samples of the matrix of each source.

    Source: Tanner and Wong, The calculation of posterior distributions by data augmentation, JASA 82 (1987).
    """
    rng = np.random.default_rng(0)
    K = priors.shape[1]
    n_chains = int(np.clip(MAX_CELLS // max(len(cases) * K, 1), MIN_CHAINS, MAX_CHAINS))
    row_of = [np.eye(len(source.pseudo_counts))[source.rows] for source in sources]  # (K, R) of each source
    context_of = np.eye(len(priors))[contexts]
    rates = [np.repeat(matrix[np.newaxis], n_chains, axis=0) for matrix in matrices]
    shares = np.repeat(priors[np.newaxis], n_chains, axis=0)
    samples: list[list[Array]] = [[] for _ in sources]
    for sweep in range(N_BURN_IN + N_SWEEPS):
        logs = np.log(np.maximum(shares, MIN_LOGARITHM))[:, contexts]
        for source, own in zip(sources, rates, strict=True):
            logs += source.counts @ np.log(np.maximum(own, MIN_LOGARITHM))[:, source.rows].swapaxes(1, 2)
        classes = rng.multinomial(cases, normalise_logs(logs)) * weights[:, np.newaxis]  # (chains, U, K)
        for i, source in enumerate(sources):
            counts = row_of[i].T @ (classes.swapaxes(1, 2) @ source.counts)  # (chains, R, O)
            rates[i] = _sample_dirichlet(rng, counts + source.pseudo_counts)
            if sweep >= N_BURN_IN:
                samples[i].append(rates[i])
        by_context = context_of.T @ classes
        overall = _sample_dirichlet(rng, by_context.sum(axis=1) + 1 / K)
        shares = _sample_dirichlet(rng, by_context + context_weight * overall[:, np.newaxis])
    return tuple(np.concatenate(own) for own in samples)


def _sample_dirichlet(rng: np.random.Generator, counts: Array) -> Array:
    """Return distributions along the last axis."""
    return normalise(np.maximum(rng.standard_gamma(counts), MIN_LOGARITHM))
