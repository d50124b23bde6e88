"""Cases of hidden classes with answers about them: the expectation step that all estimates of rates share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.values import Array, Indices


@dataclass(frozen=True, eq=False)
class ExpectedCounts:
    """The expected numbers of cases of each of K classes, given all answers.

    classes: (n, K) P(class | context, answers) of each case. contexts: (X, K) cases in each context.
    answers: of each source (K, O) how often cases of the class got each answer. log_likelihood: of all cases.
    """

    classes: Array
    contexts: Array
    answers: tuple[Array, ...]
    log_likelihood: float


@dataclass(frozen=True, eq=False)
class LatentClasses:
    """n cases, each of one of K hidden classes, given which all answers are independent.

    log p(class, answers | context) = log pi[context, class] + sum over sources and answers o of
    counts[o] log P(o | class)

    contexts: (n,) index of each case's context. weights: (n,) how much each case counts.
    counts: of each source (n, O) how often each case got each answer.

    Source: Dawid and Skene, "Maximum likelihood estimation of observer error-rates using the EM algorithm",
    Applied Statistics 28(1), 1979.
    """

    contexts: Indices
    weights: Array
    counts: tuple[Array, ...]

    def compute_log_joint(self, log_pi: Array, log_rates: Sequence[Array]) -> Array:
        """Return (n, K) log p(class, answers | context) of each case.

        Args:
            log_pi: (X, K) of each context. log_rates: of each source (K, O).
        """
        logs: Array = log_pi[self.contexts]
        for counts, own in zip(self.counts, log_rates, strict=True):
            logs = logs + counts @ own.T
        return logs

    def expect(self, log_pi: Array, log_rates: Sequence[Array]) -> ExpectedCounts:
        """Return the expected counts under parameters as of `compute_log_joint`."""
        logs = self.compute_log_joint(log_pi, log_rates)
        classes = normalise_logs(logs)
        weighted = classes * self.weights[:, None]
        return ExpectedCounts(
            classes,
            sum_by_group(self.contexts, weighted, len(log_pi)),
            tuple(weighted.T @ counts for counts in self.counts),
            sum_log_likelihood(logs, self.weights),
        )


def sum_log_likelihood(logs: Array, weights: Array) -> float:
    """Return the log likelihood of cases with weights (n,) and logs (n, K) of `compute_log_joint`."""
    top = logs.max(axis=1)
    return float(weights @ (top + np.log(np.exp(logs - top[:, None]).sum(axis=1))))


def normalise(weights: Array) -> Array:
    """Return the distributions along the last axis that are proportional to weights."""
    normalised: Array = weights / weights.sum(axis=-1, keepdims=True)
    return normalised


def normalise_logs(logs: Array) -> Array:
    """Return the distributions along the last axis, from logarithms of weights."""
    return normalise(np.exp(logs - logs.max(axis=-1, keepdims=True)))


def sum_by_group(groups: Indices, rows: Array, n_groups: int) -> Array:
    """Return (n_groups, K) the sums of rows (n, K) by group (n,)."""
    n_columns = rows.shape[1]
    cells = (groups[:, None] * n_columns + np.arange(n_columns)).ravel()
    sums: Array = np.bincount(cells, rows.ravel(), n_groups * n_columns).astype(np.float64)
    return sums.reshape(n_groups, n_columns)


def index_counts(indices: Indices, n_answers: int) -> Array:
    """Return (n, n_answers) 1 for the answer of each case (n,), without answer for a negative index."""
    counts: Array = (indices[:, None] == np.arange(n_answers)).astype(np.float64)
    return counts
