"""Estimates of the parameters of a latent class model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from lcorpp.trust.answers import AnswerModel
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class Estimates:
    """Parameters of the model of `LatentClassModel`.

    pi: (X, V) the distribution of the value in each context. values: (X, V) the expected number of people
    of each value. rates: for each sense (V, L) P(label | value). rows: (R, O) of the observation model.
    noise: of the answers, see `AnswerModel`.
    """

    answers: AnswerModel
    pi: Array
    values: Array
    rates: tuple[Array, ...]
    rows: Array
    noise: float = 0.0

    @classmethod
    def of_start(cls, answers: AnswerModel, rates: Sequence[Array]) -> Estimates:
        """Return estimates without contexts, with the stated observation model."""
        nobody = np.zeros((0, answers.row_of.shape[1]))
        return cls(answers, nobody, nobody, tuple(rates), answers.stated_rows)

    def add_context(self, pi: Array) -> Estimates:
        """Return the estimates with one more context, in which the values have the distribution pi (V,)."""
        nobody = np.zeros_like(pi)
        return replace(self, pi=np.vstack([self.pi, pi]), values=np.vstack([self.values, nobody]))

    def exchange(self, first: int, second: int) -> Estimates:
        """Return the estimates with two values exchanged in `pi`, `values` and `rates`."""
        order = np.arange(self.pi.shape[1])
        order[[first, second]] = second, first
        rates = tuple(rates[order] for rates in self.rates)
        return replace(self, pi=self.pi[:, order], values=self.values[:, order], rates=rates)

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

    def state(self) -> dict[str, Any]:
        """Return the estimates as JSON."""
        return {
            "pi": self.pi.tolist(),
            "values": self.values.tolist(),
            "rates": [rates.tolist() for rates in self.rates],
            "rows": self.rows.tolist(),
            "noise": self.noise,
        }

    def restore(self, state: Mapping[str, Any]) -> Estimates:
        """Return the estimates of a state that has the same contexts."""
        pi, values, rows = (
            np.array(state[name], np.float64).reshape(own.shape)
            for name, own in (("pi", self.pi), ("values", self.values), ("rows", self.rows))
        )
        rates = tuple(np.array(rates, np.float64) for rates in state["rates"])
        return Estimates(self.answers, pi, values, rates, rows, float(state["noise"]))
