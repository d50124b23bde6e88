"""Estimates of the parameters of a latent class model, with counts of the people who are not kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from lcorpp.trust.answers import AnswerModel, Noise
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class Counts:
    """Expected numbers of people of each of V values.

    values: (X, V) in each context. labels: for each sense (V, L) with each label. answers: (D, V) how often
    they gave each answer.
    """

    values: Array
    labels: tuple[Array, ...]
    answers: Array

    def with_context(self) -> Counts:
        """Return the counts with one more context, without people."""
        return replace(self, values=np.vstack([self.values, np.zeros(self.values.shape[1])]))

    def reorder(self, order: Sequence[int]) -> Counts:
        """Return the counts of the values in another order."""
        labels = tuple(labels[order] for labels in self.labels)
        return Counts(self.values[:, order], labels, self.answers[:, order])

    def state(self) -> dict[str, Any]:
        """Return the counts as JSON."""
        labels = [labels.tolist() for labels in self.labels]
        return {"values": self.values.tolist(), "labels": labels, "answers": self.answers.tolist()}

    def restore(self, state: Mapping[str, Any]) -> Counts:
        """Return the counts of a state of the same numbers of contexts, labels and answers."""
        own = zip(state["labels"], self.labels, strict=True)
        labels = tuple(_restore(labels, like) for labels, like in own)
        values, answers = _restore(state["values"], self.values), _restore(state["answers"], self.answers)
        return Counts(values, labels, answers)


@dataclass(frozen=True, eq=False)
class Estimates:
    """Parameters of the model of `LatentClassModel`.

    pi: (X, V) the distribution of the value in each context. values: (X, V) the expected number of people
    of each value. rates: for each sense (V, L) P(label | value). rows: (R, O) of the observation model.
    past: counts of the people whose cases are not kept, by the estimates of that time.
    noise: of the answers.
    """

    answers: AnswerModel
    pi: Array
    values: Array
    rates: tuple[Array, ...]
    rows: Array
    past: Counts
    noise: Noise

    @classmethod
    def of_start(cls, answers: AnswerModel, rates: Sequence[Array]) -> Estimates:
        """Return estimates without contexts, with the observation model before any answers."""
        n_values = answers.n_values
        by_context, by_answer = np.zeros((0, n_values)), np.zeros((answers.n_answers, n_values))
        past = Counts(by_context, tuple(np.zeros_like(table) for table in rates), by_answer)
        return cls(
            answers, by_context, by_context, tuple(rates), answers.start_rows, past, answers.start_noise
        )

    def with_context(self, pi: Array) -> Estimates:
        """Return the estimates with one more context, in which the values have the distribution pi (V,)."""
        values = np.vstack([self.values, np.zeros_like(pi)])
        return replace(self, pi=np.vstack([self.pi, pi]), values=values, past=self.past.with_context())

    def with_rates(self, sense: int, rates: Array) -> Estimates:
        """Return the estimates with other rates of a sense, without its past labels."""
        labels = (*self.past.labels[:sense], np.zeros_like(rates), *self.past.labels[sense + 1 :])
        replaced = (*self.rates[:sense], rates, *self.rates[sense + 1 :])
        return replace(self, rates=replaced, past=replace(self.past, labels=labels))

    def exchange(self, first: int, second: int) -> Estimates:
        """Return the estimates with two values exchanged, in each class, in all but the observation model."""
        columns = np.arange(self.pi.shape[1]).reshape(self.answers.n_classes, -1)
        columns[:, [first, second]] = columns[:, [second, first]]
        order = columns.ravel().tolist()
        rates = tuple(rates[order] for rates in self.rates)
        pi, values = self.pi[:, order], self.values[:, order]
        return replace(self, pi=pi, values=values, rates=rates, past=self.past.reorder(order))

    @cached_property
    def log_pi(self) -> Array:
        """(X, V)."""
        logs: Array = np.log(self.pi)
        return logs

    @cached_property
    def log_rates(self) -> list[Array]:
        """For each sense (V, L)."""
        return [np.log(rates) for rates in self.rates]

    @cached_property
    def log_answers(self) -> Array:
        """(D, V), see `AnswerModel.find_log_likelihoods`."""
        return self.answers.find_log_likelihoods(self.rows)

    @property
    def mean_noise(self) -> float:
        """The mean of the noise of the groups."""
        return float(np.mean(self.noise.degrees))

    @property
    def log_tables(self) -> list[Array]:
        """Of each source of `LatentClasses` (V, L): the answers, then each sense."""
        return [self.log_answers.T, *self.log_rates]

    def compute_past_log_likelihood(self) -> float:
        """Return the expected log likelihood of the past people, with their values."""
        past, pairs = self.past, zip(self.past.labels, self.log_rates, strict=True)
        labels = sum(float((counts * logs).sum()) for counts, logs in pairs)
        return labels + float((past.values * self.log_pi).sum() + (past.answers * self.log_answers).sum())

    def state(self) -> dict[str, Any]:
        """Return the estimates as JSON."""
        return {
            "pi": self.pi.tolist(),
            "values": self.values.tolist(),
            "rates": [rates.tolist() for rates in self.rates],
            "rows": self.rows.tolist(),
            "past": self.past.state(),
            "noise": list(self.noise.degrees),
            "equal_noise": self.noise.is_equal,
        }

    def restore(self, state: Mapping[str, Any]) -> Estimates:
        """Return the estimates of a state that has the same contexts."""
        pi, values, rows = (
            _restore(state[name], own)
            for name, own in (("pi", self.pi), ("values", self.values), ("rows", self.rows))
        )
        rates = tuple(_restore(own, like) for own, like in zip(state["rates"], self.rates, strict=True))
        past = self.past.restore(state["past"])
        noise = Noise(tuple(map(float, state["noise"])), bool(state["equal_noise"]))
        return Estimates(self.answers, pi, values, rates, rows, past, noise)


def _restore(numbers: object, like: Array) -> Array:
    """Return numbers as an array of the shape of another one."""
    restored: Array = np.array(numbers, np.float64).reshape(like.shape)
    return restored
