"""Hidden classes of cases and error rates of the answers about them, estimated together: Dawid and Skene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError
from lcorpp.latent_classes import LatentClasses, normalise
from lcorpp.learning.label_noise.answer_source import AnswerSource
from lcorpp.learning.label_noise.rate_samples import sample_rates
from lcorpp.values import Array, Indices
from lcorpp.values.probabilities import MIN_LOGARITHM

CONTEXT_WEIGHT = 10.0
"""The classes of all cases count in each context like this many cases of it."""

TOLERANCE, MAX_STEPS = 1e-6, 5000
"""The estimation ends when no probability of a class changes by more than this, or after the steps."""


@dataclass(frozen=True, eq=False)
class ClassEstimate:
    """The classes of cases, and the error rates that were estimated along with them.

    posteriors: (N, K) P(class | context, all answers) of each case.
    matrices: (R, O) of each source, P(answer | class) by row.
    counts: (R, O) of each source, the expected number of the answers by row, without pseudo-counts.
    samples: (S, R, O) of each source, samples of its matrix from the posterior, see `sample_rates`.
    """

    posteriors: Array
    matrices: tuple[Array, ...]
    counts: tuple[Array, ...]
    samples: tuple[Array, ...]


@check_arguments
def estimate_classes(
    sources: Sequence[AnswerSource], contexts: Indices, n_classes: int, weights: Array | None = None
) -> ClassEstimate:
    """Estimate the class of each case and the error rates of each source by expectation-maximisation.

    Given the class, all answers are independent of each other and of the context. Which questions were asked,
    and when the asking ended, may depend on the answers before.

    Args:
        sources: with the answers about the same N cases.
        contexts: (N,) the number of each case's context, e.g. of its place and time; the classes of a context
            have a distribution of their own, shrunk towards that of all cases.
        n_classes: K.
        weights: (N,) how much each case counts; None counts all alike.

    Raises:
        DataError: a source is not about N cases of K classes, or there is not a weight above 0 for each case.

    Source: Dawid and Skene, Maximum likelihood estimation of observer error-rates using the EM algorithm,
    Applied Statistics 28 (1979), here with Dirichlet priors and a distribution of the classes by context.
    """
    N, K = len(contexts), n_classes
    for source in sources:
        if (len(source.counts), len(source.rows)) != (N, K):
            raise DataError(
                f"a source is about {len(source.counts)} cases of {len(source.rows)} classes;"
                f" expected {N} of {K}"
            )
    weights = np.ones(N) if weights is None else np.asarray(weights, dtype=np.float64)
    if weights.shape != (N,) or not ((weights > 0) & np.isfinite(weights)).all():
        raise DataError(f"{N} cases need as many weights, finite and above 0, not {weights}")
    kinds, kind_of, cases, sources = _join_equal_cases(sources, contexts, weights)
    weights = np.asarray(np.bincount(kind_of, weights, len(kinds)), dtype=np.float64)
    matrices = [normalise(source.pseudo_counts) for source in sources]
    priors, posteriors = np.full((int(kinds.max(initial=-1)) + 1, K), 1 / K), np.zeros((len(kinds), K))
    classes = LatentClasses(kinds, weights, tuple(source.counts for source in sources))
    for _ in range(MAX_STEPS):
        before, logs = posteriors, [_log(own)[s.rows] for own, s in zip(matrices, sources, strict=True)]
        found = classes.expect(_log(priors), logs)
        posteriors = found.classes
        expected = [s.count_by_row(own) for own, s in zip(found.answers, sources, strict=True)]
        matrices = [normalise(own + s.pseudo_counts) for own, s in zip(expected, sources, strict=True)]
        overall = found.contexts.sum(axis=0) / max(weights.sum(), MIN_LOGARITHM)
        priors = normalise(CONTEXT_WEIGHT * overall + found.contexts)
        if np.abs(posteriors - before).max(initial=0) <= TOLERANCE:
            break
    samples = sample_rates(sources, kinds, cases, weights / cases, CONTEXT_WEIGHT, matrices, priors)
    return ClassEstimate(posteriors[kind_of], tuple(matrices), tuple(expected), samples)


def _join_equal_cases(
    sources: Sequence[AnswerSource], contexts: Indices, weights: Array
) -> tuple[Indices, Indices, Indices, list[AnswerSource]]:
    """Return the kinds of cases with equal answers and weights in equal contexts: they share one posterior.

    Returns:
        The number of each kind's context, from 0; the kind of each case; the number of cases of each kind;
        and the sources with the answers of each kind.
    """
    numbers = np.unique(contexts, return_inverse=True)[1]
    columns = np.column_stack([numbers, *(source.counts for source in sources), weights])
    kinds, kind_of, cases = np.unique(columns, axis=0, return_inverse=True, return_counts=True)
    ends = np.cumsum([1, *(source.counts.shape[1] for source in sources)])
    parts = np.split(kinds, ends, axis=1)[1:-1]
    joined = [AnswerSource(c, s.rows, s.pseudo_counts) for c, s in zip(parts, sources, strict=True)]
    return np.asarray(kinds[:, 0], dtype=np.intp), kind_of.ravel(), cases, joined


def _log(probabilities: Array) -> Array:
    return np.asarray(np.log(np.maximum(probabilities, MIN_LOGARITHM)))
