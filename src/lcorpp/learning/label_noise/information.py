"""Observed information of a model with hidden classes: how uncertain its estimated rates are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from lcorpp.values import Array, Indices

MIN_INFORMATION = 1e-9
"""Smaller information, also below 0 by rounding, is raised to this: the rate is unknown."""


@dataclass(frozen=True, eq=False)
class RateTable:
    """Rates of a model with hidden classes, one distribution a row: P(answer | class), or P(class | context).

    rates: (R, O) the estimates.
    totals: (R,) the expected number of outcomes of each row, with pseudo-counts.
    rows: (K, N) the row that applies to each case if it is of each class.
    counts: (K, N, O) the outcomes of each case if it is of each class.
    """

    rates: Array
    totals: Array
    rows: Indices
    counts: Array

    def compute_scores(self, k: int) -> Array:
        """(N, R * O) derivatives of each case's log-probability in class k by the logits of the rates."""
        rows, counts = self.rows[k], self.counts[k]
        scores = np.zeros((len(rows), *self.rates.shape))
        scores[np.arange(len(rows)), rows] = counts - counts.sum(axis=1, keepdims=True) * self.rates[rows]
        return scores.reshape(len(rows), self.rates.size)

    def compute_slopes(self) -> Array:
        """(R, O, O) derivatives of the rates of each row by their logits."""
        return np.asarray(self.rates[:, :, None] * (np.eye(self.rates.shape[1]) - self.rates[:, None]))


def compute_variances(tables: Sequence[RateTable], posteriors: Array, weights: Array) -> tuple[Array, ...]:
    """Return the variances (R, O) of the rates of each table at the maximum of their posterior density.

    The covariance of the logits is the inverse of the observed information: what the cases and pseudo-counts
    would show of the rates if the classes were known, less the variance of the scores of a case over its
    possible classes. The rates of all tables are unknown together.

    Args:
        posteriors: (N, K) of the classes of each case.
        weights: (N,) how much each case counts.

    Source: Louis, Finding the observed information matrix when using the EM algorithm, JRSS B 44 (1982).
    """
    slopes = [table.compute_slopes() for table in tables]
    # equal changes of all logits of a row change no rate: the ones make the information invertible
    complete = [
        total * slope + np.ones_like(slope)
        for table, own in zip(tables, slopes, strict=True)
        for slope, total in zip(own, table.totals, strict=True)
    ]
    information = block_diag(*complete)
    mean = np.zeros((len(posteriors), len(information)))
    for k, shares in enumerate(posteriors.T):
        scores = np.concatenate([table.compute_scores(k) for table in tables], axis=1)
        weighted = scores * shares[:, None]
        information -= scores.T @ (weighted * weights[:, None])
        mean += weighted
    information += mean.T @ (mean * weights[:, None])
    values, vectors = np.linalg.eigh(information)
    roots = vectors / np.sqrt(np.maximum(values, MIN_INFORMATION))  # (logits, logits) of the covariance
    variances, start = [], 0
    for table, own in zip(tables, slopes, strict=True):
        end = start + table.rates.size
        by_row = roots[start:end].reshape(*table.rates.shape, len(information))
        variances.append(((own @ by_row) ** 2).sum(axis=2))
        start = end
    return tuple(variances)
