"""Simulated people: who comes, and what the robot's sensors see of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import DataError, DomainError
from lcorpp.reasoning import Enumeration, Reasoner
from lcorpp.values import Array, Dataset, Instance, Label

Person = Mapping[str, str]
"""One person: every attribute of the truth program and its value."""


class Appearance(Protocol):
    """How people look to the robot's sensors."""

    def trajectories(self, people: Sequence[Person], rng: np.random.Generator) -> Array:
        """(people, channels, time points)"""


class Reader(Protocol):
    """A classifier that reads many trajectories at once."""

    def classify(self, instance: Instance) -> Label: ...

    def classify_many(self, trajectories: Array) -> Sequence[Label]: ...


class Population:
    """People drawn from a domain's truth program (section "Experimental Results" of the paper).

    The program's own rules order the draw, e.g. identity, then time and place, then intention.
    """

    def __init__(self, domain: Domain) -> None:
        self._truth = domain.simulation.truth
        self._reasoner = Reasoner(self._truth)

    def people(self, count: int, rng: np.random.Generator, given: Mapping[str, str] = {}) -> list[Person]:
        """`count` people, among those with the given values."""
        return [self._reasoner.sample(rng, given) for _ in range(count)]

    def cells(self, attributes: Sequence[str]) -> dict[tuple[str, ...], float]:
        """The exact joint distribution of some attributes: value tuple -> probability."""
        joint: dict[tuple[str, ...], float] = {}
        for world in Enumeration(self._truth).worlds:
            cell = tuple(world.values[name] for name in attributes)
            joint[cell] = joint.get(cell, 0.0) + float(world.measure)
        return joint


@dataclass(frozen=True, eq=False)
class Motion:
    """People who move as the domain's `people.py` says."""

    simulate: Callable[[Sequence[Person], np.random.Generator], Array]

    def trajectories(self, people: Sequence[Person], rng: np.random.Generator) -> Array:
        return self.simulate(people, rng)


@dataclass(frozen=True, eq=False)
class Recorded:
    """People who move as someone of their kind did in recorded data, e.g. in a held-out test set."""

    target: str
    dataset: Dataset

    def trajectories(self, people: Sequence[Person], rng: np.random.Generator) -> Array:
        labels = np.array(self.dataset.labels)
        rows = []
        for person in people:
            alike = np.flatnonzero(labels == person[self.target])
            if not len(alike):
                raise DataError(f"no recorded track of class {person[self.target]!r} is left for the trials")
            rows.append(int(rng.choice(alike)))
        tracks: Array = self.dataset.trajectories[rows]
        return tracks


@dataclass(frozen=True, eq=False)
class Channel:
    """The classifier as a noisy channel: both how people look and who reads it.

    What a person "looks like" is one number, the index of the class that the classifier will say, drawn
    from the channel's rates for that person.

    target: the attribute that is classified. classes: its values.
    rates: (V, V) rates[i, j] probability that one of class i is called class j.
    """

    target: str
    classes: tuple[str, ...]
    rates: Array

    @classmethod
    def of(cls, domain: Domain) -> Channel:
        """The channel of a domain.

        Raises:
            DomainError: the domain has none.
        """
        channel = domain.simulation.channel
        if channel is None:
            raise DomainError(
                f"{domain.folder}: no channel: neither [simulation.channel] nor rules for"
                f" {domain.attribute!r} in the truth program"
            )
        words = [domain.label_of[value] for value in domain.values]
        return cls(
            domain.target,
            domain.values,
            np.array([[channel[value][word] for word in words] for value in domain.values]),
        )

    def trajectories(self, people: Sequence[Person], rng: np.random.Generator) -> Array:
        bounds = np.cumsum(self.rates, axis=1)
        rows = [self.classes.index(person[self.target]) for person in people]
        drawn = (rng.random((len(people), 1)) >= bounds[rows][:, :-1]).sum(axis=1)
        signals: Array = drawn.astype(np.float64).reshape(-1, 1, 1)
        return signals

    def classify(self, instance: Instance) -> str:
        return self.classes[int(instance.trajectory[0, 0])]

    def classify_many(self, trajectories: Array) -> Sequence[str]:
        return [self.classes[int(index)] for index in trajectories[:, 0, 0]]


def simulated_dataset(domain: Domain, appearance: Motion, count: int, rng: np.random.Generator) -> Dataset:
    """Tracks to train on, as many of each class of the target, shuffled.

    Args:
        count: how many in all; rounded up to as many of each class.
    """
    population, values = Population(domain), domain.values
    each = -(-count // len(values))
    people = [person for value in values for person in population.people(each, rng, {domain.target: value})]
    order = rng.permutation(len(people))
    people = [people[i] for i in order]
    return Dataset(
        appearance.trajectories(people, rng),
        tuple(person[domain.target] for person in people),
        source=f"{len(people)} simulated tracks ({domain.folder.name}/people.py)",
        interval=domain.interval,
    )
