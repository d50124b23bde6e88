"""Particles: states with weights, which represent a belief; and their filter.

Source: Gordon, Salmond and Smith, Novel approach to nonlinear/non-Gaussian Bayesian state estimation, 1993.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from random import Random
from typing import Any

import numpy as np

from lcorpp.errors import ObservationError
from lcorpp.planning.solvers.pomcp.batches import Batch, States, number_rows
from lcorpp.values import Array, Indices

GROUP_SHARE = 0.5
"""Share of the particles that groups get in equal parts; the others are shared by probability."""

MIN_PROBABILITY = 1e-12
"""Groups below this probability are left out."""


@dataclass(frozen=True, eq=False)
class Particles:
    """N states, of one of the forms of `States`, and their weights (N,), which sum to 1."""

    states: States
    weights: Array

    @classmethod
    def of(cls, states: States) -> Particles:
        """Return states of equal weight."""
        return cls(states, np.full(len(states), 1 / len(states)))

    def sampler(self, rng: Random) -> Callable[[], Any]:
        """Return a function that draws a state by the weights."""
        sums, states = np.cumsum(self.weights).tolist(), self.states
        last = int(np.flatnonzero(self.weights)[-1])
        return lambda: states[min(bisect_right(sums, rng.random() * sums[-1]), last)]


def share_out(probabilities: Array, count: int) -> Indices:
    """Return (G,) how many of `count` particles represent each group of states, about; at least one each."""
    equal = GROUP_SHARE / len(probabilities)
    shares = np.round(count * (equal + (1 - GROUP_SHARE) * probabilities))
    return np.maximum(1, shares).astype(np.intp)


def draw_systematically(weights: Array, count: int, rng: np.random.Generator) -> Indices:
    """Return (count,) indices into weights (N,), each as often as its share of their sum, up to one."""
    sums = np.cumsum(weights)
    places = (np.arange(count) + rng.random()) / count * sums[-1]
    last = int(np.flatnonzero(weights)[-1])  # rounding may lead beyond it
    drawn: Indices = np.minimum(np.searchsorted(sums, places, side="right"), last)
    return drawn


def filter_particles(
    batch: Batch,
    particles: Particles,
    action: int,
    observation: Hashable,
    *,
    count: int,
    rng: np.random.Generator,
) -> Particles:
    """Return the particles after an action and an observation: a step each, weighed, and resampled.

    If no more than `count` states differ, and without chance in the steps, this is Bayes' rule, up to states
    below `MIN_PROBABILITY`.

    Args:
        batch: simulates the states. count: about how many particles to return.

    Raises:
        ObservationError: the observation is impossible in all particles.
    """
    n = len(particles.states)
    actions = np.full(n, action)
    after, _, _ = batch.step(particles.states, actions)
    likelihoods = batch.likelihood(batch.repeat(observation, n), particles.states, actions, after)
    highest = likelihoods.max()
    # likelihoods may be tiny
    weights = particles.weights * (likelihoods / highest) if highest > 0 else np.zeros(n)
    total = weights.sum()
    if not total > 0:
        raise ObservationError(
            f"observation {observation!r} after action {action} is impossible in all {n} particles"
        )
    return resample(batch, after, weights / total, count, rng)


def resample(batch: Batch, states: States, weights: Array, count: int, rng: np.random.Generator) -> Particles:
    """Return about `count` particles that represent N states with weights (N,), which sum to 1.

    Groups of states, e.g. of each shared value, are resampled apart (systematically), so that an improbable
    group keeps its probability and particles. If no more than `count` states differ, each is a group.
    """
    groups, is_state = _find_groups(batch, states, count)
    probabilities = np.asarray(np.bincount(groups, weights), dtype=np.float64)
    kept = np.flatnonzero(probabilities > MIN_PROBABILITY)
    counts = share_out(probabilities[kept], count)
    if is_state:
        first = np.unique(groups, return_index=True)[1]
        drawn = np.repeat(first[kept], counts)
    else:
        members = [np.flatnonzero(groups == group) for group in kept]
        drawn = np.concatenate(
            [own[draw_systematically(weights[own], k, rng)] for own, k in zip(members, counts, strict=True)]
        )
    shares = np.repeat(probabilities[kept] / counts, counts)
    return Particles(states[drawn], shares / shares.sum())


def _find_groups(batch: Batch, states: States, count: int) -> tuple[Indices, bool]:
    """Return (N,) the number of each state's group, and whether each state is a group of its own."""
    try:
        first, numbers = number_rows(states)
    except TypeError:  # not hashable, e.g. lists
        return batch.group(states) + 1, False
    if len(first) <= count:
        return numbers, True
    return batch.group(states) + 1, False
