"""A stream of simulated people for Algorithm 1, and the result of each decision."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcorpp.domains import Domain
from lcorpp.learning.store import StoredTrack
from lcorpp.simulation.dynamics import make_dynamics
from lcorpp.simulation.people import Person, Population, SignalSource, select_signals, simulate_signals
from lcorpp.simulation.world import SimulatedWorld
from lcorpp.values import Array, Episode, Instance, SharedValue, read_value

GROUP_SIZE = 50
"""People whose trajectories are simulated together; one by one takes twenty times longer."""


@dataclass(frozen=True)
class DecisionResult:
    """The result of a decision, scored from the hidden truth.

    actual: the true shared value. report: the reported value, None without a report.
    cost, return_: as in `SimulatedWorld`.

    Examples:
        >>> from lcorpp.simulation import DecisionResult
        >>> DecisionResult("interested", "interested", cost=4.0, return_=76.0).to_extra()
        {'simulated': {'actual': 'interested', 'report': 'interested', 'cost': 4.0, 'earned': 76.0}}
    """

    actual: SharedValue
    report: SharedValue | None
    cost: float
    return_: float

    def to_extra(self) -> dict[str, Any]:
        """Return the result as JSON, for the `extra` field of a stored track."""
        result = {"actual": self.actual, "report": self.report, "cost": self.cost, "earned": self.return_}
        return {"simulated": result}

    @classmethod
    def from_stored(cls, track: StoredTrack) -> DecisionResult | None:
        """Return the result of a stored decision, None if the store does not contain the truth."""
        extra = track.extra.get("simulated")
        if not isinstance(extra, dict) or not {"actual", "cost", "earned"} <= set(extra):
            return None
        report = extra.get("report", track.label_history[0].label)  # earlier versions stored the label only
        return cls(read_value(extra["actual"]), read_value(report), extra["cost"], extra["earned"])


class PeopleStream:
    """An endless sequence of simulated people.

    Each person depends only on the seed and the position, so a resumed run continues the same sequence.

    Examples:
        >>> from lcorpp import dt_control, load_robot
        >>> from lcorpp.simulation import PeopleStream
        >>> robot = load_robot("intention")
        >>> stream = PeopleStream(robot.domain, {"motion": robot.senses["motion"].signals}, seed=0)
        >>> episode = dt_control(robot.robot, *stream.next())
        >>> stream.result(episode)
        DecisionResult(actual='not_interested', report='not_interested', cost=4.0, return_=76.0)
    """

    def __init__(
        self, domain: Domain, sources: Mapping[str, SignalSource], seed: int, *, position: int = 0
    ) -> None:
        """sources: sense -> its signals. seed: of all people. position: of the first, counted from 0."""
        self._domain, self._sources, self._seed = domain, sources, seed
        self._population, self._model = Population(domain), make_dynamics(domain)
        self._group: list[tuple[Person, dict[str, Array]]] = []
        self._position = position
        self._current: tuple[Person, SimulatedWorld] | None = None

    def next(self) -> tuple[Instance, SimulatedWorld]:
        """Return the next person's instance and world; line 8 of Algorithm 1."""
        group, index = divmod(self._position, GROUP_SIZE)
        if not self._group or index == 0:
            rng = np.random.default_rng([self._seed, 1, group])
            people = self._population.sample(GROUP_SIZE, rng)
            signals = {
                sense: simulate_signals(self._domain, sense, source, people, rng)
                for sense, source in self._sources.items()
            }
            self._group = [(person, select_signals(signals, i)) for i, person in enumerate(people)]
        person, perceived = self._group[index]
        world = self._model.make_world(person, np.random.default_rng([self._seed, 2, self._position]))
        self._position += 1
        self._current = person, world
        return Instance(perceived, {name: person[name] for name in self._domain.observed}), world

    def result(self, episode: Episode) -> DecisionResult:
        """Score the decision about the latest person."""
        assert self._current is not None
        person, world = self._current
        return DecisionResult(self._domain.reasoning.join(person), episode.report, world.cost, world.return_)

    def describe_truth(self) -> dict[str, Any]:
        """Return what only the simulation knows of the latest decision, as JSON for a log."""
        assert self._current is not None
        _, world = self._current
        return {"trial": self._position - 1, **world.describe_truth()}
