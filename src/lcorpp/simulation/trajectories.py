"""Trajectory sources: what the robot's sensors record of simulated people."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import DataError, DomainError
from lcorpp.simulation.population import Person, Population
from lcorpp.values import Array, Dataset


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
        labels = np.array(self.dataset.labels)
        rows = []
        for person in people:
            candidates = np.flatnonzero(labels == person[self.target])
            if not len(candidates):
                raise DataError(f"no recorded track of class {person[self.target]!r} is left for the trials")
            rows.append(int(rng.choice(candidates)))
        tracks: Array = self.dataset.trajectories[rows]
        return tracks


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
    order = rng.permutation(len(people))
    people = [people[i] for i in order]
    return Dataset(
        source.trajectories(people, rng),
        tuple(person[domain.target] for person in people),
        source=f"{len(people)} simulated tracks ({domain.folder.name}/people.py)",
        interval=domain.learning.interval,
    )
