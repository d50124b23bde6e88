"""The observation model of answers, stated and estimated."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lcorpp.values import Array, freeze
from lcorpp.values.probabilities import MIN_CREDIBLE

SHARED_ANSWERS = 20.0
"""Weight of the stated model against a noise that all questions share, in answers."""

QUESTION_ANSWERS = 100.0
"""Weight of the shared noise against another noise of one question, in answers."""

ROW_ANSWERS = 200.0
"""Weight of a question's noise against free probabilities of one of its rows, in answers."""

NOISE_DEGREES = np.arange(-30, 99) / 100
"""Degrees of noise that are compared: 0 is the stated model, 1 are answers without information."""

STATED_DEGREE = 30
"""Index of the stated model in `NOISE_DEGREES`."""

MIN_CONTRAST = 0.01
"""Smallest difference of two rows of a question in the direction of the stated one, relative to it."""

ROW_TOLERANCE = 1e-9
"""Rows whose probabilities differ by less are equal."""


def number_rows(table: Array) -> tuple[npt.NDArray[np.intp], Array]:
    """Number the distinct rows of a table (n, k), up to rounding errors.

    Returns:
        (n,) the number of each row, and the distinct rows in the order of their numbers.
    """
    equal = np.isclose(table[:, None], table, atol=ROW_TOLERANCE).all(axis=2)
    first, numbers = np.unique(equal.argmax(axis=1), return_inverse=True)
    return numbers.reshape(-1), table[first]


@dataclass(frozen=True, eq=False)
class AnswerModel:
    """P(observation | value) for K kinds of questions, as the planner's model states it.

    Values with the same stated row share their estimated row.

    stated_rows: (R, O) the distinct rows of each kind of question. row_of: (K, V) the row of each value. No
    two kinds share a row.

    With noise d a row is (1 - d) times the stated one plus d times the mean of its question's rows over the
    values. For two values and one rate e of wrong answers, this is the rate e + d (1/2 - e).
    """

    stated_rows: Array
    row_of: npt.NDArray[np.intp]

    @classmethod
    def of_tables(cls, tables: Array) -> AnswerModel:
        """Return the model of the tables (K, V, O) of P(observation | value)."""
        rows, row_of = list[Array](), np.empty(tables.shape[:2], np.intp)
        for k, table in enumerate(tables):
            numbers, distinct = number_rows(table)
            row_of[k] = len(rows) + numbers
            rows.extend(distinct)
        return cls(freeze(np.array(rows).reshape(-1, tables.shape[2])), row_of)

    @property
    def n_answers(self) -> int:
        """D, the number of pairs of a question's kind and an observation; (k, o) has the index k * O + o."""
        return int(self.row_of.shape[0]) * int(self.stated_rows.shape[1])

    def make_tables(self, rows: Array) -> Array:
        """Return (K, V, O) the probabilities that rows (R, O) give."""
        tables: Array = rows[self.row_of]
        return tables

    def add_noise(self, noise: float) -> Array:
        """Return the rows (R, O) with a noise that all questions share."""
        rows: Array = self._noisy_rows[_find_degree(noise)]
        return rows

    def list_questions(self, noise: float) -> list[tuple[npt.NDArray[np.bool_], Array]]:
        """Return for each kind of question its rows (R,), and their prior at a shared noise, in answers."""
        prior = self._question_weights * self.add_noise(noise)
        members = [self._question_of == k for k in range(len(self.row_of))]
        return [(own, prior[own]) for own in members]

    def find_log_likelihoods(self, rows: Array) -> Array:
        """Return (D, V) the logarithm of P(observation | value) for each answer, 0 if it is impossible."""
        logs = np.log(np.where(rows > 0, rows, 1))[self.row_of]
        return logs.transpose(0, 2, 1).reshape(self.n_answers, -1)

    @cached_property
    def noisy_log_likelihoods(self) -> Array:
        """(N, D, V) what `find_log_likelihoods` returns at each degree of `NOISE_DEGREES`."""
        return np.array([self.find_log_likelihoods(rows) for rows in self._noisy_rows])

    def estimate_rows(self, counts: Array) -> tuple[Array, float]:
        """Estimate the rows from expected counts of answers, by a hierarchy of priors.

        First the noise that all questions share, then that of each question around it, then each row around
        that of its question.

        Args:
            counts: (D, V) how often people of each value gave each answer.

        Returns:
            The rows (R, O), and the shared noise.
        """
        n_observations = self.stated_rows.shape[1]
        by_value = counts.reshape(len(self.row_of), n_observations, -1).transpose(0, 2, 1)
        by_row = self._membership.T @ by_value.reshape(-1, n_observations)  # (R, O)
        shared = int(np.argmax(self._logs @ by_row.ravel() + self._stated_score))
        expected = by_row + self._question_weights * self._noisy_rows[shared]
        scores = (self._logs.reshape(self._noisy_rows.shape) * expected).sum(axis=2)
        best = (scores @ self._is_row_of).argmax(axis=0)  # (K,)
        prior = self._noisy_rows[best[self._question_of], np.arange(len(by_row))]
        rows = ROW_ANSWERS * prior + by_row
        rows /= rows.sum(axis=1, keepdims=True)
        return self._keep_order(rows, prior), float(NOISE_DEGREES[shared])

    def compute_log_prior(self, noise: float) -> float:
        """Return the log prior of a noise that all questions share, 0 for the stated model."""
        scores = self._stated_score - self._stated_score[STATED_DEGREE]
        return float(scores[_find_degree(noise)])

    def _keep_order(self, rows: Array, prior: Array) -> Array:
        """Return rows between `rows` and `prior` (R, O) in which no two values are exchanged.

        Exchanging two values in the rows, the rates and the contexts changes no probability (label
        switching), so only the direction in which the stated rows differ identifies the values.
        """
        left, right = self._pairs
        stated = self.stated_rows[left] - self.stated_rows[right]
        minimum = MIN_CONTRAST * (stated**2).sum(axis=1)
        found = ((rows[left] - rows[right]) * stated).sum(axis=1)
        expected = ((prior[left] - prior[right]) * stated).sum(axis=1)
        share = np.ones(len(self.row_of))
        wrong = found < minimum
        limits = np.maximum(expected - minimum, 0)[wrong] / np.maximum(expected - found, 1e-12)[wrong]
        np.minimum.at(share, self._question_of[left[wrong]], np.minimum(limits, 1))
        weight = share[self._question_of][:, None]
        ordered: Array = weight * rows + (1 - weight) * prior
        return ordered

    @cached_property
    def _pairs(self) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """The indices of all pairs of rows of one question."""
        left, right = np.triu_indices(len(self.stated_rows), 1)
        same = self._question_of[left] == self._question_of[right]
        return left[same], right[same]

    @cached_property
    def _membership(self) -> Array:
        """(K V, R) 1 for the row of each question and value."""
        return np.eye(len(self.stated_rows))[self.row_of.ravel()]

    @cached_property
    def _question_of(self) -> npt.NDArray[np.intp]:
        """(R,) the kind of question of each row."""
        question = np.empty(len(self.stated_rows), np.intp)
        question[self.row_of] = np.arange(len(self.row_of))[:, None]
        return question

    @cached_property
    def _is_row_of(self) -> Array:
        """(R, K) 1 for the question of each row."""
        return np.eye(len(self.row_of))[self._question_of]

    @cached_property
    def _question_weights(self) -> Array:
        """(R, 1) `QUESTION_ANSWERS`, divided among the rows of each question."""
        sizes = self._is_row_of.sum(axis=0)
        weights: Array = (QUESTION_ANSWERS / sizes)[self._question_of][:, None]
        return weights

    @cached_property
    def _noisy_rows(self) -> Array:
        """(N, R, O) the rows at each degree of `NOISE_DEGREES`."""
        means = self.stated_rows[self.row_of].mean(axis=1)[self._question_of]  # (R, O)
        rows = (1 - NOISE_DEGREES)[:, None, None] * self.stated_rows + NOISE_DEGREES[:, None, None] * means
        rows = np.where(means > 0, np.maximum(rows, MIN_CREDIBLE), 0)
        noisy: Array = rows / rows.sum(axis=2, keepdims=True)
        return noisy

    @cached_property
    def _logs(self) -> Array:
        """(N, R O) the logarithms of `_noisy_rows`, 0 for impossible observations."""
        rows = self._noisy_rows
        return np.log(np.where(rows > 0, rows, 1)).reshape(len(NOISE_DEGREES), -1)

    @cached_property
    def _stated_score(self) -> Array:
        """(N,) log likelihood of `SHARED_ANSWERS` answers that are as the stated model expects them."""
        expected = self._noisy_rows[STATED_DEGREE] * (SHARED_ANSWERS / max(len(self.stated_rows), 1))
        scores: Array = self._logs @ expected.ravel()
        return scores


def _find_degree(noise: float) -> int:
    """Return the index of the nearest of `NOISE_DEGREES`."""
    return int(np.argmin(np.abs(NOISE_DEGREES - noise)))
