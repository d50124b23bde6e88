"""Rates of classifiers and of the observation model with their uncertainty, without the knowledge."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize
from scipy.stats import chi2

from lcorpp.errors import TooLargeError
from lcorpp.latent_classes import ExpectedCounts, LatentClasses, index_counts, sum_by_group
from lcorpp.trust.answers import AnswerModel, number_rows
from lcorpp.trust.cases import Cases
from lcorpp.values import Array

PRIOR_PEOPLE = 1.0
"""Weight of the stated distribution of each row, in people or answers: enough to keep rows off 0 and 1."""

MAX_CELLS = 4000
"""Maximum number of contexts times shared values: their covariance is computed as a whole."""

MIN_START_PROBABILITY = 0.01
"""Smallest probability at which the search begins."""

CONFIDENCE = 0.95
"""Of the region of rates that are credible without the knowledge."""

MIN_GIVEN_PROBABILITY = 1e-12
"""Given probabilities of values are bounded by this."""

MIN_EIGENVALUE = 1e-9
"""Eigenvalues of an information matrix below this share of the largest count as 0."""


@dataclass(frozen=True, eq=False)
class RateTable:
    """P(outcome | value) of a sense or a kind of question.

    counts: (n, O) how often each case has each outcome that some value makes possible. row_of: (V,) the row
    of each value. prior: (R, O) pseudo-counts. outcomes: (O,) their indices.
    """

    counts: Array
    row_of: npt.NDArray[np.intp]
    prior: Array
    outcomes: npt.NDArray[np.intp]

    @classmethod
    def of_stated(cls, row_of: npt.NDArray[np.intp], stated: Array, counts: Array) -> RateTable:
        """Return the table of stated rows (R, O), with the counts (n, O) of all outcomes."""
        possible = np.flatnonzero(stated.any(axis=0))
        prior = PRIOR_PEOPLE * np.maximum(stated[:, possible], MIN_START_PROBABILITY)
        return cls(counts[:, possible], row_of, prior, possible)


class AnswerRates:
    """Maximum likelihood estimates of p(value | context), of the senses' rates and of the observation model.

    The model is that of `lcorpp.trust.LatentClassModel`, with free rows. The knowledge has no part in it, so
    that EM cannot explain answers that disagree with wrong knowledge as noise.

    The probabilities are m cells, a distribution in each row: of the contexts, of each sense, of each kind of
    question. p: (m,) the estimates. covariance: (m, m) of log p, up to a constant of each row.
    tables: the slice of cells of each table. is_nuisance: (m,) whether the cell is not of the contexts.
    row_of: (m,) the row of each cell. outcome: (m,) index of its outcome. is_of_value: (V, m) 1 where a value
    uses the cell. counts: (n, m) how often a case has its outcome. prior: (m,) pseudo-counts.

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
        tables = []
        for s, stated in enumerate(rates):
            counts = index_counts(cases.labels[:, s], stated.shape[1])
            tables.append(RateTable.of_stated(*number_rows(stated), counts))
        answers_of = cases.answer_counts.reshape(cases.n, -1, n_outcomes)
        for k, row_of_value in enumerate(answers.row_of):
            rows, places = np.unique(row_of_value, return_inverse=True)
            tables.append(RateTable.of_stated(places, answers.stated_rows[rows], answers_of[:, k]))
        self._rate_tables, self.weights = tables, cases.weights
        self._classes = LatentClasses(cases.contexts, cases.weights, tuple(own.counts for own in tables))
        uniform = np.full((n_contexts, n_values), PRIOR_PEOPLE / n_values)
        priors = [uniform, *(own.prior for own in tables)]
        self._shapes = [prior.shape for prior in priors]
        ends = np.cumsum([0, *[prior.size for prior in priors]]).tolist()
        self.tables = [slice(start, end) for start, end in pairwise(ends)]
        self.prior = np.concatenate([prior.ravel() for prior in priors])
        widths = np.concatenate([np.full(len(prior), prior.shape[1]) for prior in priors])
        self.row_of = np.repeat(np.arange(len(widths)), widths)
        outcomes = [np.arange(n_values), *(own.outcomes for own in tables)]
        self.outcome = np.concatenate(
            [np.tile(own, shape[0]) for own, shape in zip(outcomes, self._shapes, strict=True)]
        )
        self.is_of_value = np.hstack(
            [
                np.tile(np.eye(n_values), n_contexts),
                *(np.repeat(np.eye(len(own.prior))[own.row_of], len(own.outcomes), axis=1) for own in tables),
            ]
        )
        self.counts = np.hstack(
            [
                np.repeat(np.eye(n_contexts)[cases.contexts], n_values, axis=1),
                *(np.tile(own.counts, len(own.prior)) for own in tables),
            ]
        )
        self.is_nuisance = np.arange(len(self.prior)) >= ends[1]
        self.p = self._maximise()

    def _normalise(self, logs: Array) -> Array:
        p = np.exp(logs)
        normalised: Array = p / np.bincount(self.row_of, p)[self.row_of]
        return normalised

    def _split(self, p: Array) -> tuple[Array, list[Array]]:
        """Return the logarithms of p: (X, V) of the contexts, and (V, O) of each table."""
        parts = zip(self.tables, self._shapes, strict=True)
        log_pi, *logs = (np.log(p[cells]).reshape(shape) for cells, shape in parts)
        return log_pi, [own[table.row_of] for own, table in zip(logs, self._rate_tables, strict=True)]

    def _expect(self, p: Array) -> tuple[Array, ExpectedCounts]:
        """Return the expected number (m,) of cases with each cell, and all expected counts."""
        found = self._classes.expect(*self._split(p))
        by_row = (
            sum_by_group(table.row_of, own, len(table.prior))
            for own, table in zip(found.answers, self._rate_tables, strict=True)
        )
        return np.concatenate([found.contexts.ravel(), *(own.ravel() for own in by_row)]), found

    def with_contexts(self, contexts: Array) -> AnswerRates:
        """Return the rates under a given distribution (X, V) of the value in each context.

        They are the most probable ones, or as near to these as the confidence region of the estimates
        permits, on the line between both: rates under which answers mean the contrary explain a wrong
        distribution, too.

        Source: Berger and Boos, "P values maximized over a confidence set for the nuisance parameter", JASA
        89, 1994.
        """
        other, own = copy(self), self.is_nuisance
        maximum = other._maximise(contexts)
        move = np.log(maximum[own]) - np.log(self.p[own])
        distance = float(move @ invert(self.covariance[np.ix_(own, own)]) @ move)
        n_rows = len(np.unique(self.row_of[own]))
        radius = float(chi2.isf(1 - CONFIDENCE, int(own.sum()) - n_rows))
        share = min(1.0, (radius / distance) ** 0.5) if distance > 0 else 1.0
        logs = (1 - share) * np.log(self.p) + share * np.log(maximum)
        other.p = self._normalise(logs)
        return other

    def _maximise(self, contexts: Array | None = None) -> Array:
        prior, row_of, weights = self.prior, self.row_of, self.weights
        start = np.log(np.maximum(prior, MIN_START_PROBABILITY))
        is_free = np.ones(len(prior), bool)
        if contexts is not None:
            is_free = self.is_nuisance
            start[~is_free] = np.log(np.maximum(contexts, MIN_GIVEN_PROBABILITY)).ravel()

        def evaluate(logs: Array) -> tuple[float, Array]:
            p = self._normalise(logs)
            counts, found = self._expect(p)
            expected = counts + prior
            gradient = np.where(is_free, expected - np.bincount(row_of, expected)[row_of] * p, 0.0)
            value = found.log_likelihood + float(prior @ np.where(is_free, np.log(p), 0.0))
            return -value / weights.sum(), -gradient / weights.sum()

        found = minimize(
            evaluate,
            start,
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": 2000, "ftol": 1e-13, "gtol": 1e-7},
        )
        return self._normalise(found.x)

    @property
    def log_likelihood(self) -> float:
        """Of all cases, at the estimates."""
        return self._expect(self.p)[1].log_likelihood

    def count_expected(self) -> Array:
        """Return (m,) the expected number of cases, or of answers, with each cell."""
        return self._expect(self.p)[0]

    @cached_property
    def likelihoods(self) -> Array:
        """(n, V) P(labels, answers | value), up to a factor for each case."""
        log_pi, log_rates = self._split(self.p)
        logs = self._classes.compute_log_joint(np.zeros_like(log_pi), log_rates)
        likelihoods: Array = np.exp(logs - logs.max(axis=1, keepdims=True))
        return likelihoods

    def compute_scores(self, shares: Array) -> Array:
        """Compute (n, m) derivatives of each case's log likelihood by log p before normalisation.

        Args:
            shares: (n, V) the probability of each value, given the case.
        """
        expected = self.counts * (shares @ self.is_of_value)
        totals: Array = expected @ np.eye(int(self.row_of.max()) + 1)[self.row_of]
        scores: Array = expected - totals[:, self.row_of] * self.p
        return scores

    @cached_property
    def scores(self) -> Array:
        """(n, m) the scores at the estimates."""
        return self.compute_scores(self._expect(self.p)[1].classes)

    @cached_property
    def prior_information(self) -> Array:
        """(m, m) of the pseudo-counts."""
        row_of, p = self.row_of, self.p
        totals = np.bincount(row_of, self.prior)[row_of]
        information: Array = np.diag(totals * p) - (row_of[:, None] == row_of) * np.outer(totals * p, p)
        return information

    def find_table(self, place: int, n_outcomes: int) -> Array:
        """Return (V, O) the estimated P(outcome | value) of a sense or kind of question, in their order."""
        own, cells = self._rate_tables[place], self.tables[1 + place]
        table = np.zeros((len(own.row_of), n_outcomes))
        table[:, own.outcomes] = self.p[cells].reshape(len(own.prior), -1)[own.row_of]
        return table

    def list_rows(self, table: int) -> list[list[int]]:
        """List the cells of each row of a table of `tables`."""
        cells = range(len(self.p))[self.tables[table]]
        rows = dict.fromkeys(self.row_of[cells].tolist())
        return [[j for j in cells if self.row_of[j] == row] for row in rows]

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
