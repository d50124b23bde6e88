"""A simulated world: one person with a hidden state; costs and return are scored from that state."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, DomainError, expected_one_of
from lcorpp.values import Array


class SimulationModel:
    """The true dynamics of a domain as cumulative tables, shared by all simulated worlds.

    Each table has one list of interval ends for each row of probabilities:
    initial_states[v] over states, `find_successors` over next states, feedback[a][s'] over observations;
    reward[a][s] is the expected immediate reward.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import load_domain
        >>> from lcorpp.simulation import SimulationModel
        >>> model = SimulationModel(load_domain("intention"))
        >>> world = model.make_world({"intention": "interested"}, np.random.default_rng(0))
        >>> world.act("greet"), world.cost
        ('pos', 2.0)
    """

    def __init__(self, domain: Domain) -> None:
        pomdp = domain.pomdp
        self.domain = domain
        self.initial_states = _cumulate(domain.planning.initial_states)
        self._successors: dict[tuple[int, int], tuple[list[int], list[float]]] = {}
        self.feedback = [_cumulate(rows) for rows in domain.simulation.feedback_model]
        self.reward = pomdp.reward.tolist()
        self.action_index = {name: a for a, name in enumerate(pomdp.actions)}

    def find_successors(self, a: int, s: int) -> tuple[list[int], list[float]]:
        """Return the possible states after an action in a state, and their interval ends."""
        known = self._successors.get((a, s))
        if known is None:
            states, probabilities = self.domain.people_transition.row(a, s)
            known = states.tolist(), _cumulate(probabilities[np.newaxis])[0]
            self._successors[a, s] = known
        return known

    def find_action(self, action: str) -> int:
        """Return the index of an action that a robot chose.

        Raises:
            DecisionError: the POMDP has no such action.
        """
        index = self.action_index.get(action)
        if index is None:
            actions = self.domain.pomdp.actions
            raise DecisionError(f"the robot chose the action {action!r}; {expected_one_of(actions)}")
        return index

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

    def __init__(self, model: SimulationModel, person: Mapping[str, str], rng: np.random.Generator) -> None:
        self._model, self._person, self._rng = model, person, rng
        value = model.domain.values.index(model.domain.reasoning.join(person))
        self._state = self._draw(model.initial_states[value])
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
            DecisionError: the POMDP has no such action.
            DomainError: the domain's own world returns something else than an observation of the POMDP.
        """
        model, domain = self._model, self._model.domain
        a = model.find_action(action)
        reward = model.reward[a][self._state]
        self.cost -= reward
        self.return_ += reward
        states, ends = model.find_successors(a, self._state)
        self._state = states[self._draw(ends)]
        if self._answers is None or self._state in domain.planning.terminal:
            return domain.pomdp.observations[self._draw(model.feedback[a][self._state])]
        answer = self._answers.act(action)
        if not isinstance(answer, str) or answer not in domain.pomdp.observations:
            expected = expected_one_of(domain.pomdp.observations)
            raise DomainError(f"{self.source}() answered {answer!r} to {action!r}; {expected}")
        return answer

    def report(self, action: str) -> None:
        """Add the reward of the report."""
        self.return_ += self._model.reward[self._model.action_index[action]][self._state]
        if self._answers is not None:
            self._answers.report(action)

    def describe_truth(self) -> dict[str, Any]:
        """Return what the robot cannot know, as JSON for a log: the person, cost and return."""
        return {"truth": dict(self._person), "cost": self.cost, "return": self.return_}

    def _draw(self, bounds: Sequence[float]) -> int:
        return bisect_right(bounds, self._rng.random())


def _cumulate(rows: Array) -> list[list[float]]:
    """Return the cumulative sums of rows of probabilities (n, k), for sampling by bisection.

    From the last possible entry on the sums are exactly 1, so that rounding never draws an impossible one.
    """
    ends = np.cumsum(rows, axis=1)
    last = rows.shape[1] - 1 - np.argmax(rows[:, ::-1] > 0, axis=1)
    ends[np.arange(rows.shape[1]) >= last[:, None]] = 1.0
    bounds: list[list[float]] = ends.tolist()
    return bounds
