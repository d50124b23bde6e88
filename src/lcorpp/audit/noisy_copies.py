"""Maximum likelihood of answers whose noise depends on earlier answers, or on the person."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize

from lcorpp.audit.answer_rates import MIN_START_PROBABILITY
from lcorpp.audit.logged_people import LoggedPeople
from lcorpp.latent_classes import LatentClasses, index_counts, normalise, sum_by_group
from lcorpp.trust.answers import number_rows
from lcorpp.trust.cases import Cases
from lcorpp.trust.forms import AnswerForm
from lcorpp.values import Array

START_LOGIT = -1.0
"""Log odds of the noise at which the search begins."""


class NoisyCopies:
    """Copies of free rows, each with a noise: maximum likelihood of contexts, rates, rows and noise.

    A row of a copy is (1 - d) times the row of its kind, plus d times its end (`AnswerForm.find_ends`). The
    noise d is that of the copy's group; with several classes of people, that of the class, and the class is
    independent of all else. The noise of the groups is a sum of given directions, each times a factor between
    0 and 1. As the rows of the kinds are free, only differences between the groups are identified.

    Args:
        cases: the people, with their answers in the cells of the form.
        rates: for each sense (V, L) the stated rates.
    """

    def __init__(self, people: LoggedPeople, form: AnswerForm, cases: Cases, rates: Sequence[Array]) -> None:
        self._kinds, self._values, self._observations = people.dialogue.tables.shape
        self._n_copies, self._n_classes, self._weights = form.n_copies, form.n_classes, cases.weights
        groups = [[form.find_group(copy) + c for copy in range(form.n_copies)] for c in range(form.n_classes)]
        self._group_of = np.array(groups)  # (C, copies)
        self._form = form
        self._has_mean_end = np.array([form.has_mean_end(copy) for copy in range(form.n_copies)])
        labels = [index_counts(cases.labels[:, s], own.shape[1]) for s, own in enumerate(rates)]
        self._classes = LatentClasses(cases.contexts, cases.weights, (cases.answer_counts, *labels))
        tables = [number_rows(table) for table in people.dialogue.tables]
        senses = [number_rows(np.maximum(own, MIN_START_PROBABILITY)) for own in rates]
        self._row_of = [numbers for numbers, _ in [*tables, *senses]]
        stated = [np.maximum(rows, MIN_START_PROBABILITY) * (rows > 0) for _, rows in tables]
        uniform = np.full((len(people.contexts), self._values), 1 / self._values)
        shares = np.full((1, form.n_classes), 1 / form.n_classes)
        self._priors = [shares, uniform, *stated, *[rows for _, rows in senses]]

    def fit(self, directions: Array) -> tuple[float, list[Array], Array]:
        """Maximise the likelihood.

        Args:
            directions: (G, P) of the noise of the groups; without any the noise is 0.

        Returns:
            The log likelihood with the prior, the distributions (first of the classes), and the noise (G,).
        """
        starts = [np.log(np.where(prior > 0, prior, 1.0)) for prior in self._priors]
        sizes = np.cumsum([0, *[start.size for start in starts]])

        def split(x: Array) -> tuple[list[Array], Array]:
            ends = zip(sizes[:-1], sizes[1:], self._priors, strict=True)
            logits = [x[begin:end].reshape(prior.shape) for begin, end, prior in ends]
            rows = [
                normalise(np.exp(own - own.max(axis=-1, keepdims=True)) * (prior > 0))
                for own, prior in zip(logits, self._priors, strict=True)
            ]
            return rows, 1 / (1 + np.exp(-x[sizes[-1] :]))

        def evaluate(x: Array) -> tuple[float, Array]:
            rows, factors = split(x)
            value, slopes, noise_slopes = self._evaluate(rows, directions @ factors)
            factor_slopes = noise_slopes @ directions * factors * (1 - factors)
            gradient = np.concatenate([*(own.ravel() for own in slopes), factor_slopes])
            return -value / self._weights.sum(), -gradient / self._weights.sum()

        start = np.full(directions.shape[1], START_LOGIT)
        found = minimize(
            evaluate,
            np.concatenate([*(own.ravel() for own in starts), start]),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": 2000, "ftol": 1e-12, "gtol": 1e-7},
        )
        rows, factors = split(found.x)
        return -float(found.fun) * float(self._weights.sum()), rows, directions @ factors

    def _evaluate(self, rows: Sequence[Array], noise: Array) -> tuple[float, list[Array], Array]:
        """Return the log posterior, and its derivatives by the logits of rows and by the noise."""
        n_classes, none = self._n_classes, np.zeros(0, np.intp)
        places = [none, none, *self._row_of]
        kinds = range(2, 2 + self._kinds)
        by_value = np.array([rows[k][places[k]] for k in kinds])[None, :, None]  # (1, K, 1, V, O)
        own_noise = noise[self._group_of][:, None, :, None, None]  # (C, 1, copies, 1, 1)
        ends = self._form.find_ends(by_value[0, :, 0])
        ends = ends.reshape(1, self._kinds, self._n_copies, self._values, self._observations)
        copies = (1 - own_noise) * by_value + own_noise * ends  # (C, K, copies, V, O)
        logs = np.log(np.where(copies > 0, copies, 1.0)).transpose(0, 3, 1, 2, 4)
        senses = [np.tile(np.log(rows[k][places[k]]), (n_classes, 1)) for k in range(kinds.stop, len(rows))]
        log_pi = np.hstack([np.log(rows[1]) + log_share for log_share in np.log(rows[0][0])])
        found = self._classes.expect(log_pi, [logs.reshape(n_classes * self._values, -1), *senses])
        counts = found.answers[0].reshape(logs.shape).transpose(0, 2, 3, 1, 4)
        slopes = np.divide(counts, copies, out=np.zeros_like(counts), where=copies > 0)
        by_copy = (slopes * (ends - by_value)).sum(axis=(1, 3, 4))  # (C, copies)
        noise_slopes = np.bincount(self._group_of.ravel(), by_copy.ravel(), minlength=len(noise)).astype(
            float
        )
        direct = ((1 - own_noise) * slopes).sum(axis=(0, 2))  # (K, V, O)
        through_means = own_noise * slopes * self._has_mean_end[:, None, None]
        direct = direct + through_means.sum(axis=(0, 2, 3))[:, None] / self._values
        by_context = found.contexts.reshape(-1, n_classes, self._values)
        expected = [by_context.sum(axis=(0, 2))[None], by_context.sum(axis=1)]
        expected += [
            sum_by_group(places[k], own, len(rows[k])) * rows[k] for k, own in zip(kinds, direct, strict=True)
        ]
        for k, own in enumerate(found.answers[1:], kinds.stop):
            by_class = own.reshape(n_classes, self._values, -1).sum(axis=0)
            expected.append(sum_by_group(places[k], by_class, len(rows[k])))
        value, gradients = found.log_likelihood, list[Array]()
        for own, row, prior in zip(expected, rows, self._priors, strict=True):
            value += float((prior * np.log(np.where(row > 0, row, 1.0))).sum())
            total = own + prior
            gradients.append(total - total.sum(axis=1, keepdims=True) * row)
        return value, gradients, noise_slopes

    def find_class_rates(self, fitted: Sequence[Array], noise: Array) -> list[float]:
        """Return the rate of wrong answers of each class of people, by the rows and the noise of `fit`.

        An answer is wrong if it is not the most probable one of the person's value. Rates are means over the
        answers, which all values give alike.
        """
        counts = (self._weights @ self._classes.counts[0]).reshape(self._kinds, -1).sum(axis=1)
        by_value = [fitted[2 + k][self._row_of[k]] for k in range(self._kinds)]
        rates = []
        for own in noise[self._group_of[:, 0]]:
            noisy = [(1 - own) * rows + own * rows.mean(axis=0) for rows in by_value]
            places = [rows.argmax(axis=1) for rows in by_value]
            wrong = [
                1 - own_rows[np.arange(len(own_rows)), right].mean()
                for own_rows, right in zip(noisy, places, strict=True)
            ]
            rates.append(float(counts @ np.array(wrong) / counts.sum()))
        return rates
