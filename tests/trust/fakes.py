"""A dialogue of one question and two values, for trust without a domain."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from lcorpp.protocols import Memory, Planner, Starts
from lcorpp.values import Array, Distribution, Label
from tests.decision.fakes import VALUES, FakePlanner

ANSWERS = ("nod", "shake")
STATED_TABLES = np.array([[[0.75, 0.25], [0.25, 0.75]]])


NOISES = np.array([0, 0, 0.2, 0.4, 0.6, 0.8, 0.95])
"""That of the estimates before the first person, and the fixed ones."""


def weigh_sources(n_sources: int, no_evidence: int) -> Array:
    """Return (7, sources) the weights before the first person: half of them are for the estimates."""
    sources = np.array([0.4, *[0.6 / (n_sources - 1)] * (n_sources - 1)])
    weights = (1 - NOISES[:, None]) * sources + NOISES[:, None] * np.eye(n_sources)[no_evidence]
    return weights * np.array([0.5, *[0.5 / 6] * 6])[:, None]


def find_noisy_likelihoods(answer: int, count: int = 1) -> Array:
    """Return (7, V) the likelihood of a number of equal answers at each noise."""
    rows = (1 - NOISES[:, None]) * STATED_TABLES[0, :, answer] + NOISES[:, None] * 0.5
    likelihoods: Array = rows**count
    return likelihoods


class SkyReasoner:
    """A program in which P(yes) depends on the sky and P(label=yes) on the value."""

    def __init__(
        self, sunny: float = 0.9, grey: float = 0.2, rates: tuple[float, float] = (0.8, 0.3)
    ) -> None:
        self.prior = {"sunny": sunny, "grey": grey}
        self.rates = np.array([[rates[0], 1 - rates[0]], [rates[1], 1 - rates[1]]])

    def posterior(self, attribute: str, evidence: Mapping[str, Label]) -> Distribution:
        if attribute == "sky":
            return Distribution(tuple(self.prior), np.full(2, 0.5))
        sky = evidence.get("sky")
        p = np.mean(list(self.prior.values())) if sky is None else self.prior[sky]
        values = np.array([p, 1 - p])
        if attribute == "label":
            return Distribution(VALUES, values @ self.rates)
        if "label" in evidence:
            values = values * self.rates[:, VALUES.index(evidence["label"])]
        return Distribution(VALUES, values / values.sum())


class AskDialogue:
    """The action "ask" is the only question. Planners are recorded with their tables."""

    tables = STATED_TABLES
    question, question_cost = "ask", 0.1

    def __init__(self) -> None:
        self.planned = list[Array]()

    def find_answers(self, history: Sequence[tuple[str, str]], memory: Memory | None = None) -> list[int]:
        return [ANSWERS.index(observation) for action, observation in history if action == "ask"]

    def find_memory(self, history: Sequence[tuple[str, str]], memory: Memory | None = None) -> Memory | None:
        return None

    def start_known(self, planner: Planner, find_starts: Callable[[], Starts]) -> Planner:
        return planner

    def make_planner(self, tables: Array, shares: Array | None = None) -> FakePlanner:
        self.planned.append(tables)
        return FakePlanner()

    def state(self) -> dict[str, Any]:
        return {"planned": len(self.planned)}

    def restore(self, state: Mapping[str, Any]) -> FakePlanner:
        self.planned = [STATED_TABLES] * state["planned"]
        return FakePlanner()
