"""A simulated classifier, the noisy channel: it draws each class at known error rates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import DomainError
from lcorpp.simulation.people import Person
from lcorpp.values import Array, Instance, Label


class BatchClassifier(Protocol):
    """A classifier that also accepts many trajectories at once."""

    def classify(self, instance: Instance) -> Label: ...

    def classify_many(self, trajectories: Array) -> Sequence[Label]: ...


@dataclass(frozen=True, eq=False)
class NoisyChannel:
    """A classifier with known error rates; it is its own source of trajectories, too.

    The "trajectory" of a person is one number: the index of the predicted class, drawn from the row of rates
    of the person's true class.

    target: the attribute that is classified. classes: its V values.
    rates: (V, V) rates[i, j] = P(predicted class j | true class i).
    """

    target: str
    classes: tuple[str, ...]
    rates: Array

    @classmethod
    def of(cls, domain: Domain) -> NoisyChannel:
        """Return the noisy channel of a domain.

        Raises:
            DomainError: the domain has none.
        """
        label_rates = domain.simulation.noisy_channel
        if label_rates is None:
            raise DomainError(
                f"{domain.folder}: no noisy channel: neither [simulation.channel] nor rules for"
                f" {domain.learning.attribute!r} in the truth program"
            )
        labels = [domain.learning.label_of[value] for value in domain.values]
        rates = np.array([[label_rates[value][label] for label in labels] for value in domain.values])
        return cls(domain.target, domain.values, rates)

    def trajectories(self, people: Sequence[Person], rng: np.random.Generator) -> Array:
        """Draw the index of each person's predicted class: (people, 1, 1)."""
        bounds = np.cumsum(self.rates, axis=1)
        rows = [self.classes.index(person[self.target]) for person in people]
        drawn = (rng.random((len(people), 1)) >= bounds[rows][:, :-1]).sum(axis=1)
        signals: Array = drawn.astype(np.float64).reshape(-1, 1, 1)
        return signals

    def classify(self, instance: Instance) -> str:
        return self.classes[int(instance.trajectory[0, 0])]

    def classify_many(self, trajectories: Array) -> Sequence[str]:
        return [self.classes[int(index)] for index in trajectories[:, 0, 0]]
