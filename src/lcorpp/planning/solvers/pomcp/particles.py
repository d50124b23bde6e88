"""Particles: states with weights, which represent a belief; and their filter.

Source: Gordon, Salmond and Smith, Novel approach to nonlinear/non-Gaussian Bayesian state estimation, 1993.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any

import numpy as np

from lcorpp.errors import ObservationError
from lcorpp.planning.solvers.pomcp.simulator import Simulator, compute_likelihood
from lcorpp.values import Array

GROUP_SHARE = 0.5
"""Share of the particles that groups get in equal parts; the others are shared by probability."""

MIN_PROBABILITY = 1e-12
"""Groups below this probability are left out."""


@dataclass(frozen=True, eq=False)
class Particles:
    """N states and their weights (N,), which sum to 1."""

    states: Sequence[Any]
    weights: Array

    @classmethod
    def of(cls, states: Sequence[Any]) -> Particles:
        """Return states of equal weight."""
        return cls(states, np.full(len(states), 1 / len(states)))

    def sampler(self, rng: Random) -> Callable[[], Any]:
        """Return a function that draws a state by the weights."""
        sums, states = np.cumsum(self.weights).tolist(), self.states
        last = int(np.flatnonzero(self.weights)[-1])
        return lambda: states[min(bisect_right(sums, rng.random() * sums[-1]), last)]


def share_out(probabilities: Mapping[Hashable, float], count: int) -> dict[Hashable, int]:
    """Return how many of `count` particles represent each group of states, about; at least one each."""
    equal = GROUP_SHARE / len(probabilities)
    return {
        group: max(1, round(count * (equal + (1 - GROUP_SHARE) * p))) for group, p in probabilities.items()
    }


def filter_particles(
    simulator: Simulator[Any],
    particles: Particles,
    action: int,
    observation: Hashable,
    *,
    count: int,
    rng: np.random.Generator,
    group_of: Callable[[Any], Hashable] = lambda _state: None,
) -> Particles:
    """Return the particles after an action and an observation: a step each, weighed, and resampled.

    Groups of states, e.g. of each shared value, are resampled apart (systematically), so that an improbable
    group keeps its probability and particles. If no more than `count` states differ, each is a group: without
    chance in the steps, the filter is then Bayes' rule, up to states below `MIN_PROBABILITY`.

    Args:
        simulator: has a likelihood. count: about how many particles to return. group_of: a state's group.

    Raises:
        ObservationError: the observation is impossible in all particles.
    """
    after, likelihoods = list[Any](), list[float]()
    for before in particles.states:
        state = before
        if not simulator.terminal(before):
            state, _, _ = simulator.step(before, action)
        after.append(state)
        likelihoods.append(compute_likelihood(simulator, observation, before, action, state))
    highest = max(likelihoods)
    keys: list[Hashable] = [group_of(state) for state in after]
    if _differ_at_most(after, count):
        keys = list(zip(keys, after, strict=True))
    groups: dict[Hashable, tuple[list[Any], list[float]]] = {}
    for key, state, weight, likelihood in zip(
        keys, after, particles.weights.tolist(), likelihoods, strict=True
    ):
        states, weights = groups.setdefault(key, ([], []))
        states.append(state)
        weights.append(weight * (likelihood / highest) if highest > 0 else 0.0)  # likelihoods may be tiny
    totals = {group: sum(weights) for group, (_, weights) in groups.items()}
    total = sum(totals.values())
    if not total > 0:
        raise ObservationError(
            f"observation {observation!r} after action {action} is impossible in all {len(particles.states)}"
            " particles"
        )
    kept = {group: own / total for group, own in totals.items() if own / total > MIN_PROBABILITY}
    resampled, shares = list[Any](), list[float]()
    for group, n in share_out(kept, count).items():
        own, weights = groups[group]
        sums = np.cumsum(weights)
        places = (np.arange(n) + rng.random()) / n * sums[-1]
        last = int(np.flatnonzero(weights)[-1])  # rounding may lead beyond it
        resampled += [own[i] for i in np.minimum(np.searchsorted(sums, places, side="right"), last)]
        shares += [kept[group] / n] * n
    normalised = np.array(shares)
    return Particles(resampled, normalised / normalised.sum())


def _differ_at_most(states: Sequence[Any], count: int) -> bool:
    """Whether states can be compared, and at most some number of them differ."""
    try:
        return len(set(states)) <= count
    except TypeError:  # not hashable, e.g. lists
        return False
