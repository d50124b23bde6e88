"""A simulated person in front of the robot; what it is worth is scored here, from the hidden truth."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import DomainError, expected_one_of
from lcorpp.values import Array


class Stage:
    """Where simulated people meet the robot: what all worlds of a domain share, prepared once."""

    def __init__(self, domain: Domain) -> None:
        pomdp = domain.pomdp
        self.domain = domain
        self.entry = _bounds(domain.entry)
        self.transition = [_bounds(rows) for rows in pomdp.transition.dense]
        self.reactions = [_bounds(rows) for rows in domain.simulation.reactions]
        self.reward = pomdp.reward.tolist()
        self.action = {name: a for a, name in enumerate(pomdp.actions)}

    def world(self, person: Mapping[str, str], rng: np.random.Generator) -> SimulatedWorld:
        """A person in front of the robot, with a generator for what they do."""
        return SimulatedWorld(self, person, rng)


class SimulatedWorld:
    """One person, the hidden state that goes with them, and the score of what the robot does.

    The hidden state starts where the domain says for the person's target value and moves by the planner's
    transition model; the person answers by the simulation's own reactions, not by the planner's model.

    cost: what the actions before the report cost, positive. earned: sum of all rewards, undiscounted.
    """

    def __init__(self, stage: Stage, person: Mapping[str, str], rng: np.random.Generator) -> None:
        self._stage, self._person, self._rng = stage, person, rng
        value = stage.domain.values.index(person[stage.domain.target])
        self._state = self._draw(stage.entry[value])
        self.cost = 0.0
        self.earned = 0.0

    def act(self, action: str) -> str:
        """Do an action: pay for it, move the hidden state and hear the person's answer."""
        stage, domain = self._stage, self._stage.domain
        a = stage.action[action]
        paid = stage.reward[a][self._state]
        self.cost -= paid
        self.earned += paid
        self._state = self._draw(stage.transition[a][self._state])
        if domain.simulation.reaction is None or self._state == domain.terminal:
            return domain.pomdp.observations[self._draw(stage.reactions[a][self._state])]
        answer = domain.simulation.reaction(self._person, action, self._rng)
        if answer not in domain.pomdp.observations:
            raise DomainError(
                f"{domain.folder}: people.py: reaction() answered {answer!r};"
                f" {expected_one_of(domain.pomdp.observations)}"
            )
        return answer

    def report(self, action: str) -> None:
        """Score the report."""
        self.earned += self._stage.reward[self._stage.action[action]][self._state]

    def _draw(self, bounds: Sequence[float]) -> int:
        return bisect_right(bounds, self._rng.random())


def _bounds(rows: Array) -> list[list[float]]:
    """Rows of probabilities (n, k) as upper ends of intervals of [0, 1) that have those lengths.

    From the last possible entry on the ends are 1, so that rounding never draws an impossible one.
    """
    ends = np.cumsum(rows, axis=1)
    last = rows.shape[1] - 1 - np.argmax(rows[:, ::-1] > 0, axis=1)
    ends[np.arange(rows.shape[1]) >= last[:, None]] = 1.0
    bounds: list[list[float]] = ends.tolist()
    return bounds
