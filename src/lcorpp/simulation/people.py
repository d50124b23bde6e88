"""Simulated people, drawn from a domain's P-log program, and what the robot's sensors record of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import DataError, DomainError
from lcorpp.reasoning import Reasoner
from lcorpp.values import Array, Dataset

Person = Mapping[str, str]
"""One person: every attribute of the simulation's program and its value."""


class Population:
    """People drawn from a domain's simulation program (section "Experimental Results" of the paper).

    The program's rules order the draw, e.g. identity, then time and location, then intention.
    """

    def __init__(self, domain: Domain) -> None:
        self._reasoner = Reasoner(domain.simulation.true_program)

    def sample(self, count: int, rng: np.random.Generator, given: Mapping[str, str] = {}) -> list[Person]:
        """Draw `count` people from the distribution conditioned on the values in `given`."""
        return [self._reasoner.sample(rng, given) for _ in range(count)]


class TrajectorySource(Protocol):
    """A generator of one trajectory per person."""

    def trajectories(self, people: Sequence[Person], rng: np.random.Generator) -> Array:
        """Return an array (people, channels, time points)."""


@dataclass(frozen=True, eq=False)
class SimulatedTrajectories:
    """Trajectories from the `trajectories` function of a domain's `people.py`."""

    simulate: Callable[[Sequence[Person], np.random.Generator], Array]

    @classmethod
    def of(cls, domain: Domain) -> SimulatedTrajectories:
        """Return the trajectory source of a domain.

        Raises:
            DomainError: the domain has no `people.py` with a function `trajectories`.
        """
        if domain.simulation.trajectories is None:
            raise DomainError(
                f"{domain.folder}: no people.py with trajectories; give --data, or --classifier channel to"
                " `lcorpp run`"
            )
        return cls(domain.simulation.trajectories)

    def trajectories(self, people: Sequence[Person], rng: np.random.Generator) -> Array:
        return self.simulate(people, rng)


@dataclass(frozen=True, eq=False)
class RecordedTrajectories:
    """Trajectories sampled from a recorded data set, e.g. a held-out test set.

    Each person gets a track whose label equals the person's value of `target`.
    """

    target: str
    dataset: Dataset

    def trajectories(self, people: Sequence[Person], rng: np.random.Generator) -> Array:
        labels, rows = np.array(self.dataset.labels), []
        for person in people:
            candidates = np.flatnonzero(labels == person[self.target])
            if not len(candidates):
                raise DataError(f"no recorded track of class {person[self.target]!r} is left for the trials")
            rows.append(int(rng.choice(candidates)))
        return self.dataset.trajectories[rows]


def simulate_dataset(
    domain: Domain, source: SimulatedTrajectories, count: int, rng: np.random.Generator
) -> Dataset:
    """Simulate a balanced, shuffled training set.

    Args:
        count: the number of tracks, rounded up to a multiple of the number of classes.
    """
    population, values = Population(domain), domain.values
    per_class = -(-count // len(values))
    people = [
        person for value in values for person in population.sample(per_class, rng, {domain.target: value})
    ]
    people = [people[i] for i in rng.permutation(len(people))]
    return Dataset(
        source.trajectories(people, rng),
        tuple(person[domain.target] for person in people),
        source=f"{len(people)} simulated tracks ({domain.folder.name}/people.py)",
        interval=domain.learning.interval,
    )
