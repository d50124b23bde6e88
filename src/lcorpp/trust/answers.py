"""The observation model of answers, stated and estimated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter

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


@dataclass(frozen=True)
class NoiseGroup:
    """Kinds of questions that share a noise.

    follows: the index of an earlier group whose estimated noise is the most probable one a priori; None for
        `start`.
    start: the noise without any answers; 0 for the stated rows.
    """

    follows: int | None = None
    start: float = 0.0


INDEPENDENT = (NoiseGroup(),)
"""All questions share one noise."""


@dataclass(frozen=True)
class Noise:
    """The noise of all questions.

    degrees: of each group. is_equal: whether the questions of a group have equal contrasts: a person who does
    not listen answers all of them wrongly as often. Otherwise those that are stated as more reliable remain
    so.
    """

    degrees: tuple[float, ...]
    is_equal: bool = False


@dataclass(frozen=True, eq=False)
class AnswerModel:
    """P(observation | value) for K kinds of questions, as the planner's model states it.

    Values with the same stated row share their estimated row.

    stated_rows: (R, O) the distinct rows of each kind of question. row_of: (K, V) the row of each value. No
    two kinds share a row. ends: (R, O) the rows at noise 1. group_of: (K,) the index of each kind's group.

    n_classes: C, of people: there is a kind k * C + c for each question k and class c. The values of people
        are then W = C V pairs c * V + v of a class and a value.

    With noise d a row is (1 - d) times the stated one plus d times its end, by default the mean of its
    question's rows over the values. For two values and one rate e of wrong answers, this is the rate
    e + d (1/2 - e). The contrast of a question is the mean total variation between its rows, (1 - d) times
    the stated one. If contrasts are equal (`Noise`), that of a group's questions is (1 - d) times the mean of
    the stated ones; the noise of each question follows.
    """

    stated_rows: Array
    row_of: npt.NDArray[np.intp]
    ends: Array
    group_of: npt.NDArray[np.intp]
    groups: tuple[NoiseGroup, ...] = INDEPENDENT
    n_classes: int = 1

    @classmethod
    def of_tables(
        cls,
        tables: Array,
        *,
        ends: Array | None = None,
        group_of: npt.NDArray[np.intp] | None = None,
        groups: tuple[NoiseGroup, ...] = INDEPENDENT,
        n_classes: int = 1,
    ) -> AnswerModel:
        """Return the model of the tables (K, V, O) of P(observation | value).

        Args:
            ends: (K, V, O); values with the same row have the same end.
        """
        if ends is None:
            ends = np.broadcast_to(tables.mean(axis=1, keepdims=True), tables.shape)
        if group_of is None:
            group_of = np.zeros(len(tables), np.intp)
        rows, end_rows, row_of = list[Array](), list[Array](), np.empty(tables.shape[:2], np.intp)
        for k, table in enumerate(tables):
            numbers, distinct = number_rows(table)
            row_of[k] = len(rows) + numbers
            rows.extend(distinct)
            end_rows.extend(ends[k, np.unique(numbers, return_index=True)[1]])
        shape = -1, tables.shape[2]
        stated, far = (freeze(np.array(own).reshape(shape)) for own in (rows, end_rows))
        return cls(stated, row_of, far, group_of, groups, n_classes)

    @property
    def n_answers(self) -> int:
        """D, the number of pairs of a question's kind and an observation; (k, o) has the index k * O + o."""
        return int(self.row_of.shape[0]) // self.n_classes * int(self.stated_rows.shape[1])

    @property
    def n_values(self) -> int:
        """W, the number of pairs of a class and a value."""
        return self.n_classes * int(self.row_of.shape[1])

    @property
    def start_noise(self) -> Noise:
        """The noise without any answers."""
        return Noise(tuple(group.start for group in self.groups))

    @property
    def stated_noise(self) -> Noise:
        """The noise of the stated rows."""
        return Noise((0.0,) * len(self.groups))

    @cached_property
    def start_rows(self) -> Array:
        """(R, O) the rows without any answers."""
        return self.add_noise(self.start_noise) if any(self.start_noise.degrees) else self.stated_rows

    def find_expected(self, kind: int, value: int) -> int:
        """Return the index of the observation that the stated model expects most."""
        return int(self.stated_rows[self.row_of[kind, value]].argmax())

    def make_tables(self, rows: Array) -> Array:
        """Return (K, V, O) the probabilities that rows (R, O) give."""
        tables: Array = rows[self.row_of]
        return tables

    def add_noise(self, noise: Noise) -> Array:
        """Return the rows (R, O) with a noise."""
        shared = np.array([find_degree(own) for own in noise.degrees], np.intp)[self._group_of_row]
        each = np.arange(len(self.stated_rows))
        rows: Array = self._noisy_rows[self._row_degrees[noise.is_equal][shared, each], each]
        return rows

    def list_questions(self) -> list[npt.NDArray[np.bool_]]:
        """Return for each kind of question which rows (R,) are its own."""
        return [self._question_of == k for k in range(len(self.row_of))]

    def find_log_likelihoods(self, rows: Array) -> Array:
        """Return (D, W) the logarithm of P(observation | value) for each answer, 0 if it is impossible."""
        logs = np.log(np.where(rows > 0, rows, 1))[self.row_of]  # (K, V, O)
        by_class = logs.reshape(-1, self.n_classes, *logs.shape[1:])
        return by_class.transpose(0, 3, 1, 2).reshape(self.n_answers, -1)

    def fix_noise(self, degree: float, rows: Array) -> Array:
        """Return rows (R, O) with a degree of noise in the first group and those that follow it."""
        is_fixed = self._is_following[self._question_of][:, None]
        return np.where(is_fixed, self.add_noise(Noise((degree,) * len(self.groups))), rows)

    @cached_property
    def follows_first_group(self) -> npt.NDArray[np.bool_]:
        """(D, W) whether the group of an answer is the first one, or follows it."""
        of_kind = self._is_following.reshape(-1, self.n_classes)
        n_observations, n_values = self.stated_rows.shape[1], self.row_of.shape[1]
        return np.repeat(np.repeat(of_kind, n_values, axis=1), n_observations, axis=0)

    @cached_property
    def noisy_log_likelihoods(self) -> Array:
        """(N, D, W) what `find_log_likelihoods` returns at each degree of `NOISE_DEGREES`."""
        return np.array([self.find_log_likelihoods(rows) for rows in self._noisy_rows])

    def estimate_rows(self, counts: Array) -> tuple[Array, Noise]:
        """Estimate the rows from expected counts of answers, by a hierarchy of priors.

        First the noise that the questions of a group share, in equal degrees or contrasts, whichever is more
        probable; then that of each question around it, then each row around that of its question.

        Args:
            counts: (D, W) how often people of each value gave each answer.

        Returns:
            The rows (R, O), and the shared noise.
        """
        n_observations = self.stated_rows.shape[1]
        by_class = counts.reshape(-1, n_observations, self.n_classes, self.row_of.shape[1])
        by_value = by_class.transpose(0, 2, 3, 1)
        by_row = self._membership.T @ by_value.reshape(-1, n_observations)  # (R, O)
        by_degree = (self._logs * by_row).sum(axis=2)  # (N, R)
        both = [self._find_shared_noise(by_degree, is_equal=own) for own in (False, True)]
        _, noise = max(both, key=itemgetter(0))
        expected = by_row + self._question_weights * self.add_noise(noise)
        scores = (self._logs * expected).sum(axis=2)
        best = (scores @ self._is_row_of).argmax(axis=0)  # (K,)
        prior = self._noisy_rows[best[self._question_of], np.arange(len(by_row))]
        rows = ROW_ANSWERS * prior + by_row
        rows /= rows.sum(axis=1, keepdims=True)
        return self._keep_order(rows, prior), noise

    def _find_shared_noise(self, by_degree: Array, *, is_equal: bool) -> tuple[float, Noise]:
        """Return the most probable noise, before that its log posterior, up to a constant.

        Args:
            by_degree: (N, R) log likelihood of the answers in each row, at each degree of the row.
        """
        by_shared = np.take_along_axis(by_degree, self._row_degrees[is_equal], axis=0)
        scores, degrees = by_shared @ self._is_row_of_group.T, list[int]()  # (N, G)
        total = 0.0
        for g, own in enumerate(scores.T):
            posterior = own + self._compute_group_prior(g, degrees, is_equal=is_equal)
            degrees.append(int(posterior.argmax()))
            total += float(posterior.max())
        return total, Noise(tuple(NOISE_DEGREES[degrees].tolist()), is_equal)

    def compute_log_prior(self, noise: Noise, rows: Array | None = None) -> float:
        """Return the log prior of the noise, and of rows (R, O) around it; 0 for those without answers."""
        degrees = [find_degree(own) for own in noise.degrees]
        total = sum(
            float(self._compute_group_prior(g, degrees, is_equal=noise.is_equal)[degree])
            for g, degree in enumerate(degrees)
        )
        if rows is None:
            return total
        expected = self.add_noise(noise)
        ratio = np.log(np.divide(rows, expected, out=np.ones_like(rows), where=expected > 0))
        return total + float((self._question_weights * expected * ratio).sum())

    def _compute_group_prior(self, group: int, degrees: Sequence[int], *, is_equal: bool) -> Array:
        """Return (N,) the log prior of each degree of a group, 0 for the rows that it follows.

        It is the log likelihood of `SHARED_ANSWERS` answers that are as those rows expect.

        Args:
            degrees: indices of the degrees of the earlier groups.
        """
        follows, own = self.groups[group].follows, np.flatnonzero(self._group_of_row == group)
        by_row = self._row_degrees[is_equal][:, own]  # (N, own)
        if follows is None:
            center = np.full(len(own), find_degree(self.groups[group].start))
        else:
            center = by_row[degrees[follows]]
        scores = np.einsum("ro,nro->nr", self._noisy_rows[center, own], self._logs[:, own])
        scores -= np.take_along_axis(scores, center[None], axis=0)
        log_prior: Array = np.take_along_axis(scores, by_row, axis=0).sum(axis=1)
        return log_prior * (SHARED_ANSWERS / max(len(own), 1))

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
    def _is_following(self) -> npt.NDArray[np.bool_]:
        """(K,) whether the group of a kind is the first one, or follows it."""
        is_member = list[bool]()
        for g, group in enumerate(self.groups):
            is_member.append(g == 0 if group.follows is None else is_member[group.follows])
        return np.array(is_member)[self.group_of]

    @cached_property
    def _group_of_row(self) -> npt.NDArray[np.intp]:
        """(R,) the group of each row."""
        return self.group_of[self._question_of]

    @cached_property
    def _is_row_of_group(self) -> Array:
        """(G, R) 1 for the rows of each group."""
        members: Array = np.eye(len(self.groups))[:, self._group_of_row]
        return members

    @cached_property
    def _noisy_rows(self) -> Array:
        """(N, R, O) the rows at each degree of `NOISE_DEGREES`."""
        degrees = NOISE_DEGREES[:, None, None]
        rows = (1 - degrees) * self.stated_rows + degrees * self.ends
        of_kind: npt.NDArray[np.bool_] = np.asarray(self.stated_rows[self.row_of].any(axis=1))
        is_possible = of_kind[self._question_of] | (self.ends > 0)
        rows = np.where(is_possible, np.maximum(rows, MIN_CREDIBLE), 0)
        noisy: Array = rows / rows.sum(axis=2, keepdims=True)
        return noisy

    @cached_property
    def _logs(self) -> Array:
        """(N, R, O) the logarithms of `_noisy_rows`, 0 for impossible observations."""
        rows = self._noisy_rows
        return np.log(np.where(rows > 0, rows, 1))

    @cached_property
    def _row_degrees(self) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """Each (N, R) the index of each row's degree at a shared one: of equal degrees, of equal contrasts.

        Rows whose end is not the mean of their question's rows have equal degrees: these are not of contrast.
        """
        same = np.broadcast_to(np.arange(len(NOISE_DEGREES))[:, None], (len(NOISE_DEGREES), len(self.ends)))
        left, right = self._pairs
        variation = np.abs(self.stated_rows[left] - self.stated_rows[right]).sum(axis=1) / 2
        n_pairs = np.bincount(self._question_of[left], minlength=len(self.row_of))
        total = np.bincount(self._question_of[left], variation, minlength=len(self.row_of))
        contrast = total / np.maximum(n_pairs, 1)  # (K,)
        members = np.eye(len(self.groups))[self.group_of] * (contrast > 0)[:, None]  # (K, G)
        mean = (contrast @ members / np.maximum(members.sum(axis=0), 1))[self.group_of]
        ratio = np.divide(mean, contrast, out=np.ones_like(mean), where=contrast > 0)[self._question_of]
        means = self.stated_rows[self.row_of].mean(axis=1)  # (K, O)
        has_mean_end = np.isclose(self.ends, means[self._question_of], atol=ROW_TOLERANCE).all(axis=1)
        places = (1 - (1 - NOISE_DEGREES[:, None]) * ratio - NOISE_DEGREES[0]) * 100
        equal = np.clip(np.rint(places).astype(np.intp), 0, len(NOISE_DEGREES) - 1)
        return same, np.where(has_mean_end, equal, same)


def find_degree(noise: float) -> int:
    """Return the index of the nearest of `NOISE_DEGREES`."""
    return int(np.argmin(np.abs(NOISE_DEGREES - noise)))
