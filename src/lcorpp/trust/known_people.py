"""Records of people with an id, and the probability that a value persists from one meeting to the next."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcorpp.protocols import Memory
from lcorpp.values import Array

MAX_PEOPLE = 10_000
"""Maximum number of records; of more people, those of the latest meetings."""

MAX_CERTAINTY = 0.99
"""Largest probability, about, of a value or class after a conversation: a wrong model must not make it
certain."""

PERSISTENCE = np.arange(1, 200) / 200
"""Grid of probabilities that a value persists."""


@dataclass(frozen=True, eq=False)
class PersonRecord:
    """Belief about a person after the meetings so far.

    belief: (W,) P(value), with the person's class, after the last one.
    memory: of the form of answers after it; None if the form remembers nothing from one to the next.
    odds: (C,) P(all answers | class of the person), up to a factor, and bounded as the belief is.
    """

    belief: Array
    memory: Memory | None
    odds: Array

    def state(self) -> dict[str, Any]:
        """Return it as JSON."""
        memory = None if self.memory is None else list(self.memory)
        return {"belief": self.belief.tolist(), "memory": memory, "odds": self.odds.tolist()}

    @classmethod
    def of_state(cls, state: Mapping[str, Any]) -> PersonRecord:
        """Return the record of a state."""
        memory = None if state["memory"] is None else tuple(map(int, state["memory"]))
        return cls(np.array(state["belief"]), memory, np.array(state["odds"]))


class KnownPeople:
    """The records of people with an id, and the probability that a value persists between two meetings.

    With probability `persistence`, a person has the value and the memory of the meeting before, otherwise a
    new value and no memory. The class of the person, if there are several, stays.

    log_likelihoods: (n,) of all meetings after a person's first one, at each of `PERSISTENCE`.
    """

    def __init__(self) -> None:
        self._people: OrderedDict[str, PersonRecord] = OrderedDict()
        self.log_likelihoods: Array = np.zeros(len(PERSISTENCE))

    def __len__(self) -> int:
        return len(self._people)

    @property
    def persistence(self) -> float:
        """The posterior mean, from a uniform prior."""
        weights = np.exp(self.log_likelihoods - self.log_likelihoods.max())
        return float(weights @ PERSISTENCE / weights.sum())

    def find(self, person: str | None) -> PersonRecord | None:
        """Return the record of a person; None without one, or without an id."""
        return None if person is None else self._people.get(person)

    def add(self, person: str, now: PersonRecord) -> None:
        """Replace the record of a person."""
        self._people[person] = now
        self._people.move_to_end(person)
        if len(self._people) > MAX_PEOPLE:
            self._people.popitem(last=False)

    def compare(self, same: float, new: float) -> None:
        """Update the likelihoods with a meeting after a person's first one.

        Args:
            same, new: probability of labels and answers if the value persists, and if it is a new one, up to
                a common factor.
        """
        self.log_likelihoods += np.log(PERSISTENCE * same + (1 - PERSISTENCE) * new)
        self.log_likelihoods -= self.log_likelihoods.max()

    def state(self) -> dict[str, Any]:
        """Return the people, in the order of their last meetings, and the likelihoods as JSON."""
        people = {person: own.state() for person, own in self._people.items()}
        return {"people": people, "persistence": self.log_likelihoods.tolist()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Replace everything by that of a state."""
        people = state["people"].items()
        self._people = OrderedDict((person, PersonRecord.of_state(own)) for person, own in people)
        self.log_likelihoods = np.array(state["persistence"], np.float64).reshape(PERSISTENCE.shape)


def bound_belief(belief: Array) -> Array:
    """Return a belief (W,) without values that are more certain than `MAX_CERTAINTY`."""
    n = len(belief)
    doubt = (1 - MAX_CERTAINTY) / max(n - 1, 1)
    bounded: Array = np.maximum(belief, doubt)
    bounded /= bounded.sum()
    return bounded
