"""The people of a domain with a generative model: the model itself simulates them."""

from __future__ import annotations

from typing import Any

import numpy as np

from lcorpp.domains import Domain
from lcorpp.planning import GenerativeModel
from lcorpp.simulation.world import Dynamics
from lcorpp.values import SharedValue


class GenerativeDynamics(Dynamics):
    """The true dynamics of a domain with a generative model: its own simulation."""

    def __init__(self, domain: Domain, model: GenerativeModel) -> None:
        self.domain, self._model = domain, model

    def start(self, value: SharedValue, rng: np.random.Generator) -> Any:
        with self._model.locate("start()"):
            return self._model.interaction.start(value, rng)

    def step(
        self, state: Any, action: str, rng: np.random.Generator, *, answers: bool
    ) -> tuple[Any, str | None, float]:
        with self._model.locate("step()"):
            after, observation, reward = self._model.interaction.step(state, action, rng)
        return after, self._model.format_observation(observation), float(reward)

    def report(self, state: Any, action: str, rng: np.random.Generator) -> float:
        return self.step(state, action, rng, answers=False)[2]

    def is_terminal(self, state: Any) -> bool:
        with self._model.locate("shared()"):
            return self._model.interaction.shared(state) is None
