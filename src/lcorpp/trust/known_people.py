"""People who are met again: what the last conversation with each of them left, and how often it remains."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lcorpp.protocols import Memory
from lcorpp.values import Array

MAX_PEOPLE = 10_000
"""Maximum number of people who are known; of more, those who were met last."""

MAX_CERTAINTY = 0.99
"""Largest probability, about, of a value or class after a conversation: a wrong model must not make it
certain."""

KEPT = np.arange(1, 200) / 200
"""Probabilities that a value is kept which are compared."""


@dataclass(frozen=True, eq=False)
class Acquaintance:
    """What the conversations with a person left.

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
    def of_state(cls, state: Mapping[str, Any]) -> Acquaintance:
        """Return the acquaintance of a state."""
        memory = None if state["memory"] is None else tuple(map(int, state["memory"]))
        return cls(np.array(state["belief"]), memory, np.array(state["odds"]))


class KnownPeople:
    """The people who were met with an id, and the probability that a person's value is that of the last time.

    A person who is met again has the value and the memory of the last time with probability `kept`, otherwise
    a new value, and answers as if never asked. The class of the person, if there are several, stays.

    log_likelihoods: (n,) of all meetings after a person's first one, at each of `KEPT`.
    """

    def __init__(self) -> None:
        self._people: OrderedDict[str, Acquaintance] = OrderedDict()
        self.log_likelihoods: Array = np.zeros(len(KEPT))

    def __len__(self) -> int:
        return len(self._people)

    @property
    def kept(self) -> float:
        """The posterior mean, from a uniform prior."""
        weights = np.exp(self.log_likelihoods - self.log_likelihoods.max())
        return float(weights @ KEPT / weights.sum())

    def find(self, person: str | None) -> Acquaintance | None:
        """Return what is known of a person; None for somebody who is new, or has no id."""
        return None if person is None else self._people.get(person)

    def add(self, person: str, now: Acquaintance) -> None:
        """Replace what is known of a person."""
        self._people[person] = now
        self._people.move_to_end(person)
        if len(self._people) > MAX_PEOPLE:
            self._people.popitem(last=False)

    def compare(self, again: float, new: float) -> None:
        """Learn from a person who was met again.

        Args:
            again, new: probability of the answers if the value is that of the last time, and if it is a new
                one, up to a common factor.
        """
        self.log_likelihoods += np.log(KEPT * again + (1 - KEPT) * new)
        self.log_likelihoods -= self.log_likelihoods.max()

    def state(self) -> dict[str, Any]:
        """Return the people, in the order of their last meetings, and the likelihoods as JSON."""
        people = {person: own.state() for person, own in self._people.items()}
        return {"people": people, "kept": self.log_likelihoods.tolist()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Replace everything by that of a state."""
        people = state["people"].items()
        self._people = OrderedDict((person, Acquaintance.of_state(own)) for person, own in people)
        self.log_likelihoods = np.array(state["kept"], np.float64).reshape(KEPT.shape)


def bound_belief(belief: Array) -> Array:
    """Return a belief (W,) without values that are more certain than `MAX_CERTAINTY`."""
    n = len(belief)
    doubt = (1 - MAX_CERTAINTY) / max(n - 1, 1)
    bounded: Array = np.maximum(belief, doubt)
    bounded /= bounded.sum()
    return bounded
