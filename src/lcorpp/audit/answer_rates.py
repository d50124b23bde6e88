"""Rates of classifiers and of the observation model with their uncertainty, without the knowledge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize
from scipy.special import softmax

from lcorpp.errors import TooLargeError
from lcorpp.trust.answers import AnswerModel, number_rows
from lcorpp.trust.cases import NO_LABEL, Cases
from lcorpp.values import Array

PRIOR_PEOPLE = 1.0
"""Weight of the stated distribution of each row, in people or answers: enough to keep rows off 0 and 1."""

MAX_CELLS = 4000
"""Maximum number of contexts times shared values: their covariance is computed as a whole."""

MIN_START_PROBABILITY = 0.01
"""Smallest probability at which the search begins."""

MIN_EIGENVALUE = 1e-9
"""Eigenvalues of an information matrix below this share of the largest count as 0."""


@dataclass(frozen=True, eq=False)
class Cells:
    """The cells of several distributions over observed outcomes, m in all; a distribution is a row.

    A case with value v has the log probability ``sum_j counts[j] * log p[j]`` over the cells j of v.

    row_of: (m,) the row of each cell. is_of_value: (V, m) 1 where a value uses the cell. counts: (n, m) how
    often the case has the cell's outcome. prior: (m,) pseudo-counts. outcome: (m,) index of the outcome.
    """

    row_of: npt.NDArray[np.intp]
    is_of_value: Array
    counts: Array
    prior: Array
    outcome: npt.NDArray[np.intp]

    @classmethod
    def of_table(cls, row_of_value: npt.NDArray[np.intp], stated: Array, counts: Array) -> Cells:
        """Return the cells of one table.

        Args:
            row_of_value: (V,) the row of each value. stated: (R, O). counts: (n, O) of each outcome, the same
                for all values.
        """
        n_rows, n_outcomes = stated.shape
        is_of_value = np.repeat(np.eye(n_rows)[row_of_value], n_outcomes, axis=1)
        row_of = np.repeat(np.arange(n_rows), n_outcomes)
        prior = PRIOR_PEOPLE * np.maximum(stated, MIN_START_PROBABILITY)
        used = np.tile(stated.any(axis=0), n_rows)  # the others are impossible
        outcome = np.tile(np.arange(n_outcomes), n_rows)
        counts = np.tile(counts, n_rows)
        return cls(row_of[used], is_of_value[:, used], counts[:, used], prior.ravel()[used], outcome[used])


class AnswerRates:
    """Maximum likelihood estimates of p(value | context), of the senses' rates and of the observation model.

    The model is that of `lcorpp.trust.LatentClassModel`, with free rows. The knowledge has no part in it, so
    that EM cannot explain answers that disagree with wrong knowledge as noise.

    cells: the cells of all tables, those of the contexts first, then of each sense, then of each kind of
    question. p: (m,) their estimated probabilities. covariance: (m, m) of log p, up to a constant of each
    row. tables: the slice of cells of each table. is_nuisance: (m,) whether the cell is not of the contexts.

    Args:
        n_contexts: X. rates: for each sense (V, L) the stated rates.

    Raises:
        TooLargeError: there are too many contexts.
    """

    def __init__(self, answers: AnswerModel, rates: Sequence[Array], cases: Cases, n_contexts: int) -> None:
        n_values, n_outcomes = answers.row_of.shape[1], answers.stated_rows.shape[1]
        if n_contexts * n_values > MAX_CELLS:
            raise TooLargeError(
                f"{n_contexts} different combinations of facts with {n_values} shared values;"
                f" an audit expects a product of at most {MAX_CELLS}"
            )
        uniform = np.full((n_contexts, n_values), 1 / n_values)
        parts = [_make_context_cells(uniform, cases.contexts)]
        for s, table in enumerate(rates):
            label = cases.labels[:, s]
            counts = np.where((label != NO_LABEL)[:, None], np.eye(table.shape[1])[label], 0.0)
            numbers, distinct = number_rows(table)
            parts.append(Cells.of_table(numbers, distinct, counts))
        answers_of = cases.answer_counts.reshape(cases.n, -1, n_outcomes)
        for k, row_of_value in enumerate(answers.row_of):
            rows, places = np.unique(row_of_value, return_inverse=True)
            parts.append(Cells.of_table(places, answers.stated_rows[rows], answers_of[:, k]))
        sizes = np.cumsum([0, *[len(part.row_of) for part in parts]])
        self.tables = [slice(start, end) for start, end in pairwise(sizes.tolist())]
        self.cells = _join(parts)
        self.weights = cases.weights
        self.is_nuisance = np.arange(sizes[-1]) >= sizes[1]
        self.p = self._maximise()

    def _normalise(self, logs: Array) -> Array:
        p = np.exp(logs)
        normalised: Array = p / np.bincount(self.cells.row_of, p)[self.cells.row_of]
        return normalised

    def _maximise(self) -> Array:
        prior, row_of, weights = self.cells.prior, self.cells.row_of, self.weights
        start = np.log(np.maximum(prior, MIN_START_PROBABILITY))

        def evaluate(logs: Array) -> tuple[float, Array]:
            p = self._normalise(logs)
            joint = (self.cells.counts * np.log(p)) @ self.cells.is_of_value.T
            top = joint.max(axis=1, keepdims=True)
            shares = np.exp(joint - top)
            total = shares.sum(axis=1, keepdims=True)
            expected = weights @ (self.cells.counts * ((shares / total) @ self.cells.is_of_value)) + prior
            gradient = expected - np.bincount(row_of, expected)[row_of] * p
            value = weights @ (top + np.log(total))[:, 0] + prior @ np.log(p)
            return -float(value) / weights.sum(), -gradient / weights.sum()

        found = minimize(
            evaluate,
            start,
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": 2000, "ftol": 1e-13, "gtol": 1e-7},
        )
        return self._normalise(found.x)

    @cached_property
    def likelihoods(self) -> Array:
        """(n, V) P(labels, answers | value), up to a factor for each case."""
        nuisance = self.is_nuisance
        log_p = self.cells.counts[:, nuisance] * np.log(self.p[nuisance])
        logs = log_p @ self.cells.is_of_value[:, nuisance].T
        likelihoods: Array = np.exp(logs - logs.max(axis=1, keepdims=True))
        return likelihoods

    def compute_scores(self, shares: Array) -> Array:
        """Compute (n, m) derivatives of each case's log likelihood by log p before normalisation.

        Args:
            shares: (n, V) the probability of each value, given the case.
        """
        expected = self.cells.counts * (shares @ self.cells.is_of_value)
        totals: Array = expected @ np.eye(int(self.cells.row_of.max()) + 1)[self.cells.row_of]
        scores: Array = expected - totals[:, self.cells.row_of] * self.p
        return scores

    @cached_property
    def scores(self) -> Array:
        """(n, m) the scores at the estimates."""
        joint = (self.cells.counts * np.log(self.p)) @ self.cells.is_of_value.T
        shares: Array = softmax(joint, axis=1)
        return self.compute_scores(shares)

    @cached_property
    def prior_information(self) -> Array:
        """(m, m) of the pseudo-counts."""
        row_of, p = self.cells.row_of, self.p
        totals = np.bincount(row_of, self.cells.prior)[row_of]
        information: Array = np.diag(totals * p) - (row_of[:, None] == row_of) * np.outer(totals * p, p)
        return information

    def list_rows(self, table: int) -> list[list[int]]:
        """List the cells of each row of a table of `tables`."""
        cells = range(len(self.p))[self.tables[table]]
        rows = dict.fromkeys(self.cells.row_of[cells].tolist())
        return [[j for j in cells if self.cells.row_of[j] == row] for row in rows]

    def describe_cell(self, cell: int, row: Sequence[int]) -> tuple[float, float, float]:
        """Return the probability of a cell of a row, its variance, and that of the pseudo-counts alone."""
        p = float(self.p[cell])
        slopes = p * ((np.array(row) == cell) - self.p[row])
        places = np.ix_(row, row)
        prior = slopes @ self.prior_covariance[places] @ slopes
        return p, float(slopes @ self.covariance[places] @ slopes), float(prior)

    @cached_property
    def covariance(self) -> Array:
        information = (self.scores * self.weights[:, None]).T @ self.scores + self.prior_information
        return invert(information)

    @cached_property
    def prior_covariance(self) -> Array:
        """As `covariance`, of the pseudo-counts alone."""
        return invert(self.prior_information)


def invert(information: Array) -> Array:
    """Invert a symmetric matrix along the directions that have information."""
    inverse = np.linalg.pinv(information, rcond=MIN_EIGENVALUE, hermitian=True)
    return np.asarray(inverse, dtype=np.float64)


def _make_context_cells(uniform: Array, contexts: npt.NDArray[np.intp]) -> Cells:
    """Return the cells of p(value | context): the outcome is the value itself."""
    n_contexts, n_values = uniform.shape
    counts = np.repeat(np.eye(n_contexts)[contexts], n_values, axis=1)
    is_of_value = np.tile(np.eye(n_values), n_contexts)
    row_of = np.repeat(np.arange(n_contexts), n_values)
    outcome = np.tile(np.arange(n_values), n_contexts)
    return Cells(row_of, is_of_value, counts, PRIOR_PEOPLE * uniform.ravel(), outcome)


def _join(parts: Sequence[Cells]) -> Cells:
    offsets = np.cumsum([0, *[part.row_of.max() + 1 for part in parts]])
    return Cells(
        np.concatenate([part.row_of + offset for part, offset in zip(parts, offsets, strict=False)]),
        np.hstack([part.is_of_value for part in parts]),
        np.hstack([part.counts for part in parts]),
        np.concatenate([part.prior for part in parts]),
        np.concatenate([part.outcome for part in parts]),
    )
