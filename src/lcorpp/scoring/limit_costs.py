"""The costs of the limits of a domain in simulated decisions, and their shares among people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lcorpp.domains import Domain
from lcorpp.domains.sections.limits import DomainLimit
from lcorpp.simulation.people import Person
from lcorpp.values import Array, Indices, Interval


class LimitCosts:
    """The costs of the limits in n decisions that are made at once.

    people: (n) of the decisions.
    """

    def __init__(self, domain: Domain, people: Sequence[Person]) -> None:
        self._limits, self._discount = domain.planning.limits, domain.pomdp.discount
        concerns = [[own.concerns(p) for own in self._limits] for p in people]
        self._concerns = np.array(concerns, dtype=bool).reshape(len(people), len(self._limits))
        self._values = np.array([domain.values.index(domain.reasoning.join(p)) for p in people], np.intp)
        self._totals = np.zeros(self._concerns.shape)

    def add(self, people: Indices, actions: Indices, step: int) -> None:
        """Add the actions (m,) about people (m,) in a step, from 0."""
        for k, limit in enumerate(self._limits):
            factor = self._discount**step if limit.kind == "discounted" else 1.0
            self._totals[people, k] += factor * limit.cost[actions, self._values[people]]

    def finish(self) -> Array:
        """Return (n, K) the costs, of events 1 or 0; NaN for a limit that is not about a person."""
        costs = np.array(
            [limit.score(own) for limit, own in zip(self._limits, self._totals.T, strict=True)]
        ).T
        return np.where(self._concerns, costs, np.nan)


def measure_decision(domain: Domain, person: Person, actions: Sequence[str]) -> Array:
    """Return (K,) the costs of a decision about a person, as of `LimitCosts.finish`."""
    costs = LimitCosts(domain, [person])
    for step, action in enumerate(actions):
        costs.add(np.zeros(1, np.intp), np.array([domain.pomdp.action_index(action)]), step)
    found: Array = costs.finish()[0]
    return found


def summarise_limits(limits: Sequence[DomainLimit], costs: Array) -> Mapping[str, Interval]:
    """Return the share or mean cost of each limit among the people whom it is about.

    Args:
        costs: (n, K), NaN for people whom it is not about.
    """
    found = dict[str, Interval]()
    for limit, column in zip(limits, costs.T, strict=True):
        own = column[~np.isnan(column)]
        if len(own):
            is_event = limit.kind == "probability"
            found[limit.name] = (
                Interval.from_count(float(own.sum()), len(own)) if is_event else Interval.from_sample(own)
            )
    return found
