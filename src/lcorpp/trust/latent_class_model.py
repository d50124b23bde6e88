"""The learnt model: latent classes of people, estimated from labels and answers, without the knowledge."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from lcorpp.latent_classes import LatentClasses, index_counts, normalise, normalise_logs, sum_log_likelihood
from lcorpp.trust.answers import AnswerModel, Noise, number_rows
from lcorpp.trust.cases import NO_LABEL, Cases
from lcorpp.trust.estimates import Counts, Estimates
from lcorpp.values import Array
from lcorpp.values.probabilities import MIN_CREDIBLE

CONTEXT_PEOPLE = 5.0
"""Weight of the prediction of a context from its facts against the people of the context, in people."""

FACT_PEOPLE = 1.0
"""Weight of a fact's frequency among all people against that among people of one value, in people."""

LABEL_PEOPLE = 6.0
"""Weight of the stated rates of a classifier, in people of each class. A strong prior fails where the
classifier's rates are wrong and answers are noisy."""

MAX_CASES = 5000
"""Maximum number of distinct cases; of further ones only the expected counts are kept."""

MIN_PEOPLE = 1e-12
"""Smallest expected number of people of a value."""


class LatentClassModel:
    """p(labels, answers | x) = sum_y pi_x(y) prod_s C_s(label | y) prod_j O(answer | question, y).

    y is the shared value, with the class of the person if answers depend on it; x the context. The choice of
    the questions cancels. The prior of pi is a prediction from the facts of the context (naive Bayes), that
    of the rates C and of the observation model O what is stated. The knowledge has no part in it: as a prior
    of pi beside a free O, EM would explain answers that disagree with it as noise.

    estimates: of pi, C and O, by EM. alternative: other credible estimates, see `AlternativeSearch`; None
    without. prior_rates: the prior of C, first the stated rates.

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
        self.n_values = answers.n_values
        self.cases = Cases(len(stated_rates), answers.n_answers, memory)
        self._stated_rates = [self._bound_rates(rates) for rates in stated_rates]
        self.prior_rates = list(self._stated_rates)
        self._equal_rows = [_find_equal_rows(rates) for rates in self.prior_rates]
        self._facts: dict[tuple[str, object], int] = {}
        self._has_fact = np.zeros((0, 0))  # (X, F) 1 for the facts of a context
        self.estimates = Estimates.of_start(answers, self.prior_rates)
        self.alternative: Estimates | None = None

    @property
    def class_shares(self) -> Array:
        """(C,) the estimated share of each class of people."""
        n_classes = self.answers.n_classes
        people = self.estimates.values.sum(axis=0).reshape(n_classes, -1).sum(axis=1)
        return normalise(people + CONTEXT_PEOPLE / n_classes)

    @property
    def pi(self) -> Array:
        return self.estimates.pi

    @property
    def rates(self) -> tuple[Array, ...]:
        return self.estimates.rates

    @property
    def rows(self) -> Array:
        return self.estimates.rows

    @property
    def noise(self) -> Noise:
        return self.estimates.noise

    def add_context(self, facts: Iterable[tuple[str, object]]) -> int:
        """Add a context, given by attributes and their values; return its index."""
        places = [self._facts.setdefault(fact, len(self._facts)) for fact in facts]
        has_fact = np.zeros((len(self._has_fact) + 1, len(self._facts)))
        has_fact[:-1, : self._has_fact.shape[1]] = self._has_fact
        has_fact[-1, places] = 1
        self._has_fact = has_fact
        self._change_estimates(self._add_context)
        return len(has_fact) - 1

    def _add_context(self, estimates: Estimates) -> Estimates:
        values = np.vstack([estimates.values, np.zeros(self.n_values)])
        return estimates.with_context(self._combine_facts(values)[-1])

    def _change_estimates(self, change: Callable[[Estimates], Estimates]) -> None:
        """Replace the estimates, and the alternative if there is one."""
        self.estimates = change(self.estimates)
        if self.alternative is not None:
            self.alternative = change(self.alternative)

    def predict(self, context: int, labels: Sequence[int], prior: Array | None = None) -> Array:
        """Return (W,) P(value | context, labels).

        Args:
            labels: as in `Cases`.
            prior: (W,) in people, in place of what the facts of the context suggest.
        """
        logs = self.estimates.log_pi[context]
        if prior is not None:
            logs = np.log(np.maximum(prior + self.estimates.values[context], MIN_PEOPLE))
        for label, log_rates in zip(labels, self.estimates.log_rates, strict=True):
            if label != NO_LABEL:
                logs = logs + log_rates[:, label]
        probabilities: Array = np.exp(logs - np.maximum.reduce(logs))
        probabilities /= np.add.reduce(probabilities)
        return probabilities

    def compute_label_likelihood(self, labels: Sequence[int]) -> Array:
        """Return (W,) P(labels | value) by the estimated rates."""
        pairs = zip(labels, self.estimates.rates, strict=True)
        columns = [rates[:, label] for label, rates in pairs if label != NO_LABEL]
        likelihood: Array = np.prod([np.ones(self.n_values), *columns], axis=0)
        return likelihood

    def compute_likelihood(self, answers: Sequence[int]) -> Array:
        """Return (V,) P(answers | value), up to a factor."""
        if not answers:
            return np.ones(self.n_values)
        logs = np.add.reduce(self.estimates.log_answers[list(answers)])
        likelihood: Array = np.exp(logs - logs.max())
        return likelihood

    def add(self, context: int, labels: Sequence[int], answers: Sequence[int]) -> None:
        """Add a person, without fitting the model anew; arguments as in `Cases.add`."""
        self.cases.add(context, labels, answers)
        if self.cases.n > MAX_CASES:
            self._condense()

    def fit(self, iterations: int, rows: Array | None = None) -> None:
        """Run EM from the present estimates, and from the alternative.

        Args:
            rows: (R, O) of the observation model, if it is not to be estimated.
        """
        if rows is not None:
            self.estimates = replace(self.estimates, rows=rows)
        self._change_estimates(lambda own: self.iterate(own, iterations, keep_rows=rows is not None))

    def iterate(self, estimates: Estimates, iterations: int, *, keep_rows: bool = False) -> Estimates:
        """Return the estimates after iterations of EM; with `keep_rows` those of O stay."""
        people = self._describe_people(self.cases.weights)
        for _ in range(iterations):
            expected = _expect(people, estimates)
            pi = normalise(expected.values + CONTEXT_PEOPLE * self._combine_facts(expected.values))
            pairs = zip(expected.labels, self._equal_rows, self.prior_rates, strict=True)
            rates = tuple(
                normalise(equal_rows @ own + LABEL_PEOPLE * stated) for own, equal_rows, stated in pairs
            )
            estimates = replace(estimates, pi=pi, values=expected.values, rates=rates)
            if not keep_rows:
                rows, noise = self.answers.estimate_rows(expected.answers)
                estimates = replace(estimates, rows=rows, noise=noise)
        return estimates

    def compute_log_posterior(self, estimates: Estimates) -> float:
        """Return the log likelihood, with the log priors of C and of the noise, up to a constant.

        Of cases that are not kept, the expected log likelihood counts.
        """
        prior = sum(
            LABEL_PEOPLE * float((stated * log_rates).sum())
            for stated, log_rates in zip(self.prior_rates, estimates.log_rates, strict=True)
        )
        prior += self.answers.compute_log_prior(estimates.noise)
        prior += estimates.compute_past_log_likelihood()
        return sum_log_likelihood(self.compute_log_joint(estimates), self.cases.weights) + prior

    def classify_cases(self, estimates: Estimates) -> Array:
        """Return (n, V) P(value | context, labels, answers) of each case."""
        return normalise_logs(self.compute_log_joint(estimates))

    def compute_log_joint(self, estimates: Estimates) -> Array:
        """Return (n, V) log p(value, labels, answers | context) of each case."""
        people = self._describe_people(self.cases.weights)
        return people.compute_log_joint(estimates.log_pi, estimates.log_tables)

    def expect(self, estimates: Estimates, weights: Array) -> Counts:
        """Return the expected counts of the cases with weights (n,), and of the past people."""
        return _expect(self._describe_people(weights), estimates)

    def _describe_people(self, weights: Array) -> LatentClasses:
        """Return the cases with weights (n,): the sources of answers are the questions, then each sense."""
        cases = self.cases
        labels = (index_counts(cases.labels[:, s], own.shape[1]) for s, own in enumerate(self.rates))
        return LatentClasses(cases.contexts, weights, (cases.answer_counts, *labels))

    def replace_rates(self, stated_rates: Sequence[Array]) -> bool:
        """Replace the stated rates; of a sense whose rates differ, forget all labels.

        Returns:
            Whether any rates differ.
        """
        replaced = [self._bound_rates(rates) for rates in stated_rates]
        changed = [s for s, own in enumerate(replaced) if not np.array_equal(own, self._stated_rates[s])]
        for s in changed:
            self._stated_rates[s] = self.prior_rates[s] = replaced[s]
            self._equal_rows[s] = _find_equal_rows(replaced[s])
            self.cases.forget_labels(s)
            self._change_estimates(partial(Estimates.with_rates, sense=s, rates=replaced[s]))
        return bool(changed)

    def state(self) -> dict[str, Any]:
        """Return the estimates and the cases as JSON, without the facts of the contexts."""
        return {
            "cases": self.cases.state(),
            "stated_rates": [rates.tolist() for rates in self._stated_rates],
            "estimates": self.estimates.state(),
            "alternative": None if self.alternative is None else self.alternative.state(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a state; all its contexts are already added."""
        self.cases.restore(state["cases"])
        limits = [len(self.pi), *[rates.shape[1] for rates in self.rates]]
        cases = np.column_stack([self.cases.contexts, self.cases.labels])
        if (cases >= limits).any() or (cases[:, 0] < 0).any() or (cases < NO_LABEL).any():
            raise ValueError("a case has an unknown context or label")
        self._stated_rates = [np.array(rates) for rates in state["stated_rates"]]
        self.prior_rates = list(self._stated_rates)
        self._equal_rows = [_find_equal_rows(rates) for rates in self.prior_rates]
        alternative = state["alternative"]
        self.alternative = None if alternative is None else self.estimates.restore(alternative)
        self.estimates = self.estimates.restore(state["estimates"])

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
        return normalise_logs(logs)

    def _bound_rates(self, rates: Array) -> Array:
        """Return credible rates (W, L), the same for each class of people."""
        return np.tile(normalise(np.maximum(rates, MIN_CREDIBLE)), (self.answers.n_classes, 1))

    def _condense(self) -> None:
        """Keep the half of the cases that occurred most; of the others, keep the expected counts."""
        weights = self.cases.weights
        rare = np.argsort(weights, kind="stable")[: self.cases.n // 2]
        removed = np.zeros_like(weights)
        removed[rare] = weights[rare]
        self._change_estimates(lambda own: replace(own, past=self.expect(own, removed)))
        self.cases.keep(np.flatnonzero(removed == 0))


def _expect(people: LatentClasses, estimates: Estimates) -> Counts:
    """Return the expected counts of people and of the past people."""
    expected, past = people.expect(estimates.log_pi, estimates.log_tables), estimates.past
    answers, *labels = expected.answers
    return Counts(
        expected.contexts + past.values,
        tuple(own + earlier for own, earlier in zip(labels, past.labels, strict=True)),
        answers.T + past.answers,
    )


def _find_equal_rows(rates: Array) -> Array:
    """Return (V, V) 1 where two values have the same row."""
    numbers, _ = number_rows(rates)
    equal_rows: Array = (numbers[:, None] == numbers).astype(np.float64)
    return equal_rows
