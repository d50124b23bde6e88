"""The learnt model: latent classes of people, estimated from labels and answers, without the knowledge."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.trust.answers import AnswerModel, number_rows
from lcorpp.trust.cases import NO_LABEL, Cases
from lcorpp.values import Array

CONTEXT_PEOPLE = 5.0
"""Weight of the prediction of a context from its facts against the people of the context, in people."""

FACT_PEOPLE = 1.0
"""Weight of a fact's frequency among all people against that among people of one value, in people."""

LABEL_PEOPLE = 6.0
"""Weight of the stated rates of a classifier, in people of each class. A strong prior fails where the
classifier's rates are wrong and answers are noisy."""

MAX_CASES = 5000
"""Maximum number of distinct cases; of further ones only the expected counts are kept."""

MIN_GAIN = 2.0
"""Gain in log likelihood above which the result of a restart is kept."""

MIN_PEOPLE = 1e-12
"""Smallest expected number of people of a value."""

MIN_RATE = 1e-3
"""Smallest stated probability of a label."""


class LatentClassModel:
    """p(labels, answers | x) = sum_y pi_x(y) prod_s C_s(label | y) prod_j O(answer | question, y).

    y is the shared value, x the context. The choice of the questions cancels. The prior of pi is a prediction
    from the facts of the context (naive Bayes), that of the rates C and of the observation model O what is
    stated. The knowledge has no part in it: as a prior of pi beside a free O, EM would explain answers that
    disagree with it as noise.

    pi: (X, V) the distribution of the value in each context. rates: for each sense (V, L) C. rows: (R, O) the
    rows of O. noise: of the answers, see `AnswerModel`. prior_rates: the prior of C, first the stated rates.
    past_answers: (D, V) the expected counts of answers in cases that are not kept.

    Args:
        answers: the stated observation model.
        stated_rates: for each sense (V, L) the stated P(label | value). Values with the same row share
            their estimated rates.
        memory: see `Cases`.

    Source: Dawid and Skene, "Maximum likelihood estimation of observer error-rates using the EM algorithm",
    Applied Statistics 28(1), 1979.
    """

    def __init__(
        self, answers: AnswerModel, stated_rates: Sequence[Array], *, memory: float | None = None
    ) -> None:
        self.answers = answers
        self.n_values = answers.row_of.shape[1]
        self.cases = Cases(len(stated_rates), answers.n_answers, memory)
        self._stated_rates = [_bound_rows(rates) for rates in stated_rates]
        self.prior_rates = list(self._stated_rates)
        self._equal_rows = [_find_equal_rows(rates) for rates in self.prior_rates]
        self.pi = np.zeros((0, self.n_values))
        self._facts: dict[tuple[str, object], int] = {}
        self._has_fact = np.zeros((0, 0))  # (X, F) 1 for the facts of a context
        self.rates = list(self.prior_rates)
        self.rows, self.noise = answers.stated_rows, 0.0
        self._values = np.zeros((0, self.n_values))  # (X, V) expected counts
        # expected counts of cases that are not kept, as `past_answers`
        self._past_values = np.zeros((0, self.n_values))
        self._past_labels = [np.zeros_like(rates) for rates in self.prior_rates]
        self.past_answers = np.zeros((answers.n_answers, self.n_values))
        self._update_logs()

    def add_context(self, facts: Iterable[tuple[str, object]]) -> int:
        """Add a context, given by attributes and their values; return its index."""
        places = [self._facts.setdefault(fact, len(self._facts)) for fact in facts]
        has_fact = np.zeros((len(self.pi) + 1, len(self._facts)))
        has_fact[:-1, : self._has_fact.shape[1]] = self._has_fact
        has_fact[-1, places] = 1
        self._has_fact = has_fact
        self._values = np.vstack([self._values, np.zeros(self.n_values)])
        self._past_values = np.vstack([self._past_values, np.zeros(self.n_values)])
        self.pi = np.vstack([self.pi, np.full(self.n_values, 1 / self.n_values)])
        self.pi[-1] = self._combine_facts(self._values)[-1]
        self._log_pi = np.log(self.pi)
        return len(self.pi) - 1

    def predict(self, context: int, labels: Sequence[int], prior: Array | None = None) -> Array:
        """Return (V,) P(value | context, labels).

        Args:
            labels: as in `Cases`.
            prior: (V,) in people, in place of what the facts of the context suggest.
        """
        logs = self._log_pi[context]
        if prior is not None:
            logs = np.log(np.maximum(prior + self._values[context], MIN_PEOPLE))
        for label, log_rates in zip(labels, self._log_rates, strict=True):
            if label != NO_LABEL:
                logs = logs + log_rates[:, label]
        probabilities: Array = np.exp(logs - logs.max())
        probabilities /= np.add.reduce(probabilities)
        return probabilities

    def compute_likelihood(self, answers: Sequence[int]) -> Array:
        """Return (V,) P(answers | value), up to a factor."""
        if not answers:
            return np.ones(self.n_values)
        logs = np.add.reduce(self._log_answers[list(answers)])
        likelihood: Array = np.exp(logs - logs.max())
        return likelihood

    def add(self, context: int, labels: Sequence[int], answers: Sequence[int]) -> None:
        """Add a person, without fitting the model anew; arguments as in `Cases.add`."""
        self.cases.add(context, labels, answers)
        if self.cases.n > MAX_CASES:
            self._condense()

    def fit(self, iterations: int, rows: Array | None = None) -> None:
        """Run EM from the present estimates.

        Args:
            rows: (R, O) of the observation model, if it is not to be estimated.
        """
        if rows is not None:
            self.rows = rows
            self._update_logs()
        for _ in range(iterations):
            values, labels, answers_of_value = self._expect(self.cases.weights)
            self._values = values
            self.pi = values + CONTEXT_PEOPLE * self._combine_facts(values)
            self.pi /= self.pi.sum(axis=1, keepdims=True)
            self.rates = [
                _normalise(equal_rows @ own + LABEL_PEOPLE * stated)
                for own, equal_rows, stated in zip(labels, self._equal_rows, self.prior_rates, strict=True)
            ]
            if rows is None:
                self.rows, self.noise = self.answers.estimate_rows(answers_of_value)
            self._update_logs()

    def replace_rates(self, stated_rates: Sequence[Array]) -> bool:
        """Replace the stated rates; of a sense whose rates differ, forget all labels.

        Returns:
            Whether any rates differ.
        """
        replaced = [_bound_rows(rates) for rates in stated_rates]
        changed = [s for s, own in enumerate(replaced) if not np.array_equal(own, self._stated_rates[s])]
        for s in changed:
            self._stated_rates[s] = self.prior_rates[s] = self.rates[s] = replaced[s]
            self._equal_rows[s] = _find_equal_rows(replaced[s])
            self._past_labels[s] = np.zeros_like(replaced[s])
            self.cases.forget_labels(s)
        self._update_logs()
        return bool(changed)

    def state(self) -> dict[str, Any]:
        """Return the estimates and the cases as JSON, without the facts of the contexts."""
        return {
            "cases": self.cases.state(),
            "pi": self.pi.tolist(),
            "stated_rates": [rates.tolist() for rates in self._stated_rates],
            "rates": [rates.tolist() for rates in self.rates],
            "rows": self.rows.tolist(),
            "noise": self.noise,
            "values": self._values.tolist(),
            "past_values": self._past_values.tolist(),
            "past_labels": [labels.tolist() for labels in self._past_labels],
            "past_answers": self.past_answers.tolist(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state; all its contexts are added already."""
        self.cases.restore(state["cases"])
        shape = self.pi.shape
        self.pi, self._values, self._past_values = (
            np.array(state[name], np.float64).reshape(shape) for name in ("pi", "values", "past_values")
        )
        self._stated_rates = [np.array(rates) for rates in state["stated_rates"]]
        self.prior_rates = list(self._stated_rates)
        self._equal_rows = [_find_equal_rows(rates) for rates in self.prior_rates]
        self.rates = [np.array(rates) for rates in state["rates"]]
        self._past_labels = [np.array(labels) for labels in state["past_labels"]]
        self.rows, self.noise = np.array(state["rows"]), float(state["noise"])
        self.past_answers = np.array(state["past_answers"])
        self._update_logs()

    def restart(self, iterations: int) -> None:
        """Run EM from another start, and keep its result if it is more likely.

        At this start labels have no information and answers have noise 1/2. EM from the stated rates may end
        in a local maximum in which the classes are exchanged, if the rates are wrong and answers are noisy.
        """
        before, score = (self.pi, self._values, self.rates, self.rows, self.noise), self._compute_objective()
        self.pi = np.full_like(self.pi, 1 / self.n_values)
        self.rates = [np.tile(stated.mean(axis=0), (self.n_values, 1)) for stated in self.prior_rates]
        self.rows = self.answers.add_noise(0.5)
        self._update_logs()
        self.fit(iterations)
        if self._compute_objective() < score + MIN_GAIN:
            self.pi, self._values, self.rates, self.rows, self.noise = before
            self._update_logs()

    def _compute_objective(self) -> float:
        """Return the log likelihood of the cases, and the log prior of the rates up to a constant."""
        prior = sum(
            LABEL_PEOPLE * float((stated * log_rates).sum())
            for stated, log_rates in zip(self.prior_rates, self._log_rates, strict=True)
        )
        return sum_log_likelihood(self.compute_log_joint(), self.cases.weights) + prior

    def compute_log_joint(self) -> Array:
        """Return (n, V) log p(value, labels, answers | context) of each case."""
        cases = self.cases
        logs: Array = self._log_pi[cases.contexts] + cases.answer_counts @ self._log_answers
        for s, log_rates in enumerate(self._log_rates):
            label = cases.labels[:, s]
            logs += np.where((label != NO_LABEL)[:, None], log_rates.T[label], 0)
        return logs

    def _expect(self, weights: Array) -> tuple[Array, list[Array], Array]:
        """Return the expected counts of values (X, V), labels (V, L) for each sense, and answers (D, V)."""
        cases, logs = self.cases, self.compute_log_joint()
        logs -= logs.max(axis=1, keepdims=True)
        people = np.exp(logs, out=logs)
        people *= (weights / people.sum(axis=1))[:, None]
        values = _sum_by(cases.contexts, people, len(self.pi)) + self._past_values
        labels = [
            _sum_by(cases.labels[:, s] + 1, people, past.shape[1] + 1)[1:].T + past
            for s, past in enumerate(self._past_labels)
        ]
        return values, labels, cases.answer_counts.T @ people + self.past_answers

    def _combine_facts(self, values: Array) -> Array:
        """Return (X, V) P(value | facts) if the facts were independent given the value (naive Bayes).

        Args:
            values: (X, V) expected counts of the values in each context.
        """
        by_fact = self._has_fact.T @ values  # (F, V)
        by_value, n_people = values.sum(axis=0), values.sum() + 1
        frequency = (by_fact.sum(axis=1, keepdims=True) + 1 / self.n_values) / n_people
        p_facts = (by_fact + FACT_PEOPLE * frequency) / (by_value + FACT_PEOPLE)
        logs = self._has_fact @ np.log(p_facts) + np.log(by_value + 1 / self.n_values)
        return _normalise(np.exp(logs - logs.max(axis=1, keepdims=True)))

    def _condense(self) -> None:
        """Keep the half of the cases that occurred most; of the others, keep the expected counts."""
        weights = self.cases.weights
        rare = np.argsort(weights, kind="stable")[: self.cases.n // 2]
        removed = np.zeros_like(weights)
        removed[rare] = weights[rare]
        self._past_values, self._past_labels, self.past_answers = self._expect(removed)
        self.cases.keep(np.flatnonzero(removed == 0))

    def _update_logs(self) -> None:
        self._log_pi = np.log(self.pi)
        self._log_rates = [np.log(rates) for rates in self.rates]
        self._log_answers = self.answers.find_log_likelihoods(self.rows)


def sum_log_likelihood(logs: Array, weights: Array) -> float:
    """Return the log likelihood of cases with weights (n,) and logs (n, V) of `compute_log_joint`."""
    top = logs.max(axis=1)
    return float(weights @ (top + np.log(np.exp(logs - top[:, None]).sum(axis=1))))


def _bound_rows(rates: Array) -> Array:
    return _normalise(np.maximum(rates, MIN_RATE))


def _normalise(rows: Array) -> Array:
    normalised: Array = rows / rows.sum(axis=1, keepdims=True)
    return normalised


def _find_equal_rows(rates: Array) -> Array:
    """Return (V, V) 1 where two values have the same row."""
    numbers, _ = number_rows(rates)
    equal_rows: Array = (numbers[:, None] == numbers).astype(np.float64)
    return equal_rows


def _sum_by(groups: npt.NDArray[np.intp], people: Array, n_groups: int) -> Array:
    """Return (n_groups, V) the sums of the rows of people (n, V) by group (n,)."""
    n_values = people.shape[1]
    cells = (groups[:, None] * n_values + np.arange(n_values)).ravel()
    sums: Array = np.bincount(cells, people.ravel(), n_groups * n_values).astype(np.float64)
    return sums.reshape(n_groups, n_values)
