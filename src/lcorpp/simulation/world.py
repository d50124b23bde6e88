"""A simulated world: one person with a hidden state; costs and return are scored from that state."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, DomainError, ModelError, expected_one_of
from lcorpp.planning import Pomdp
from lcorpp.values import SharedValue


class Dynamics(ABC):
    """The true dynamics of a domain: what simulates its people."""

    domain: Domain

    @abstractmethod
    def start(self, value: SharedValue, rng: np.random.Generator) -> Any:
        """Draw the state of a person of a shared value before the first action."""

    @abstractmethod
    def step(
        self, state: Any, action: str, rng: np.random.Generator, *, answers: bool
    ) -> tuple[Any, str | None, float]:
        """Draw the next state and the observation, and return them with the reward.

        Args:
            answers: False may leave the observation out before the end of the decision.
        """

    @abstractmethod
    def report(self, state: Any, action: str, rng: np.random.Generator) -> float:
        """Return the reward of a report."""

    @abstractmethod
    def is_terminal(self, state: Any) -> bool:
        """Return whether the decision is over."""

    def check_action(self, action: str) -> None:
        """Raise DecisionError if a robot chose an action that the model does not have."""
        if action not in (actions := self.domain.model.actions):
            raise DecisionError(f"the robot chose the action {action!r}; {expected_one_of(actions)}")

    def make_world(self, person: Mapping[str, str], rng: np.random.Generator) -> SimulatedWorld:
        """Return the world of one person; `rng` draws the person's answers."""
        return SimulatedWorld(self, person, rng)


class SimulatedWorld:
    """A world with one simulated person (`lcorpp.protocols.World`).

    The hidden state starts where the domain places the person's shared value and moves by the planner's
    transition model. The person answers by the simulation's feedback model, not by the planner's
    observation model. If the domain has worlds of its own (`SimulationSection.world`), these answer instead,
    until the state is terminal; costs and return are scored from the hidden state all the same. `rng` draws
    states and answers.

    cost: the sum of the costs of the actions before the report, positive.
    return_: the sum of all rewards, undiscounted.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import load_domain
        >>> from lcorpp.simulation import SimulatedWorld, SimulationModel
        >>> model = SimulationModel(load_domain("intention"))
        >>> world = SimulatedWorld(model, {"intention": "interested"}, np.random.default_rng(0))
        >>> world.report("report_interested")  # without a question, so it costs nothing
        >>> world.cost, world.return_
        (0.0, 80.0)
    """

    def __init__(self, model: Dynamics, person: Mapping[str, str], rng: np.random.Generator) -> None:
        self._model, self._person, self._rng = model, person, rng
        self._state: Any = model.start(model.domain.reasoning.join(person), rng)
        make_answers = model.domain.simulation.world
        self._answers = None if make_answers is None else make_answers(person, rng)
        self.cost = 0.0
        self.return_ = 0.0

    @property
    def source(self) -> str:
        """The method of the domain's own world that answers, for messages; "" without an own world."""
        if self._answers is None:
            return ""
        return str(getattr(self._answers, "source", f"{type(self._answers).__name__}.act"))

    def act(self, action: str) -> str:
        """Pay for an action, move the hidden state and return the person's answer.

        Raises:
            DecisionError: the model has no such action.
            DomainError: the domain's own world returns something else than an observation of the model.
        """
        model, own = self._model, self._answers
        model.check_action(action)
        self._state, observation, reward = model.step(self._state, action, self._rng, answers=own is None)
        self.cost -= reward
        self.return_ += reward
        if own is None or model.is_terminal(self._state):
            assert observation is not None
            return observation
        return self._check_answer(action, own.act(action))

    def _check_answer(self, action: str, answer: Any) -> str:
        """Return an answer of the domain's own world, an observation of the model."""
        model = self._model.domain.model
        if isinstance(model, Pomdp):
            if isinstance(answer, str) and answer in model.observations:
                return answer
            expected = expected_one_of(model.observations)
        else:
            try:
                return model.format_observation(answer)
            except ModelError as error:
                expected = str(error)
        raise DomainError(f"{self.source}() answered {answer!r} to {action!r}; {expected}")

    def report(self, action: str) -> None:
        """Add the reward of the report."""
        self.return_ += self._model.report(self._state, action, self._rng)
        if self._answers is not None:
            self._answers.report(action)

    def describe_truth(self) -> dict[str, Any]:
        """Return what the robot cannot know, as JSON for a log: the person, cost and return."""
        return {"truth": dict(self._person), "cost": self.cost, "return": self.return_}
