"""Batches: many states of a simulator at once, for particle filters and searches over particle beliefs."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from math import isfinite
from numbers import Real
from typing import Any, Protocol, cast

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.solvers.pomcp.simulator import Simulator, check_hashable, compute_likelihood
from lcorpp.planning.vectorised import check_bounds
from lcorpp.values import Array, Indices

States = npt.NDArray[Any]
"""N states: (N,) objects, or (N, D) numbers."""

Observations = npt.NDArray[Any]
"""N observations: (N,) objects, indices or numbers, or (N, K) numbers."""


class Batch(Protocol):
    """A simulator of N states at once, with its own random numbers. Actions (N,) are indices."""

    @property
    def actions(self) -> int:
        """The number of actions."""

    @property
    def discount(self) -> float:
        """gamma, above 0 and below 1."""

    def step(self, states: States, actions: Indices) -> tuple[States, Observations, Array]:
        """Simulate an action of each state: the next states, the observations and the rewards (N,).

        States after the end remain as they are.
        """

    def likelihood(
        self, observations: Observations, states: States, actions: Indices, next_states: States
    ) -> Array:
        """Return (N,) the probability or density of each observation."""

    def repeat(self, observation: Any, count: int) -> Observations:
        """Return an observation (count) times."""

    def group(self, states: States) -> Indices:
        """Return (N,) a number of each state's group, which filters resample apart; -1 after the end."""

    def bounds(self, states: States) -> tuple[Array, Array]:
        """Return (N,) lower and (N,) upper bounds on the value of each state, 0 after the end."""


class Loop:
    """A simulator of single states as a `Batch`.

    Args:
        simulator: has a likelihood where it is needed, and `lower` and `upper` where bounds are.
        group_of: the group of a state before the end, a number of at least 0; without, all are of one.
    """

    def __init__(self, simulator: Simulator[Any], group_of: Callable[[Any], int] = lambda _state: 0) -> None:
        self._simulator, self._group_of = simulator, group_of
        self.actions, self.discount = simulator.actions, simulator.discount

    def step(self, states: Iterable[Any], actions: Indices) -> tuple[States, Observations, Array]:
        """Simulate an action of each state."""
        after, observations, rewards = list[Any](), list[Any](), list[float]()
        terminal, step = self._simulator.terminal, self._simulator.step
        for state, action in zip(states, actions.tolist(), strict=True):
            next_state, observation, reward = (state, None, 0.0) if terminal(state) else step(state, action)
            check_hashable(observation)
            after.append(next_state)
            observations.append(observation)
            rewards.append(reward)
        found = _as_numbers(rewards, "step()", "a finite number as reward")
        return as_objects(after), as_objects(observations), found

    def likelihood(
        self, observations: Observations, states: Iterable[Any], actions: Indices, next_states: Iterable[Any]
    ) -> Array:
        """Return (N,) the probability or density of each observation."""
        rows = zip(observations, states, actions.tolist(), next_states, strict=True)
        return np.array([compute_likelihood(self._simulator, *row) for row in rows], dtype=float)

    def repeat(self, observation: Any, count: int) -> Observations:
        """Return an observation (count) times."""
        return np.repeat(as_objects([observation]), count)

    def group(self, states: Iterable[Any]) -> Indices:
        """Return (N,) the group of each state."""
        terminal, group_of = self._simulator.terminal, self._group_of
        return np.array([-1 if terminal(state) else group_of(state) for state in states], dtype=np.intp)

    def bounds(self, states: Sequence[Any] | States) -> tuple[Array, Array]:
        """Return (N,) lower and (N,) upper bounds."""
        bounded = cast("Any", self._simulator)
        rows = [(0.0, 0.0) if bounded.terminal(s) else (bounded.lower(s), bounded.upper(s)) for s in states]
        numbers = _as_numbers(
            [bound for row in rows for bound in row], "lower() or upper()", "a finite number"
        )
        lower, upper = numbers.reshape(-1, 2).T
        check_bounds(lower, upper, states, ModelError)
        return lower, upper


def _as_numbers(found: Sequence[Any], method: str, expected: str) -> Array:
    """Return (N,) what a method of the simulator returned, as numbers."""
    for value in found:
        if not isinstance(value, Real) or not isfinite(value):
            raise ModelError(f"{method} of the simulator returned {value!r}; expected {expected}")
    return np.array(found, dtype=float)


def as_objects(values: Sequence[Any]) -> npt.NDArray[np.object_]:
    """Return (N,) an array of any objects, tuples among them."""
    found = np.empty(len(values), dtype=object)
    for i, value in enumerate(values):
        found[i] = value
    return found


def number_rows(rows: npt.NDArray[Any]) -> tuple[Indices, Indices]:
    """Return the index of the first of each distinct row (G,), and the number of each row's value (N,).

    Args:
        rows: (N,) objects or numbers, or (N, K) numbers.

    Raises:
        TypeError: objects are not hashable.
    """
    if rows.dtype != object:
        _, first, numbers = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        return first, numbers.reshape(-1)
    known = dict[Hashable, int]()
    numbers = np.array([known.setdefault(row, len(known)) for row in rows], dtype=np.intp)
    return np.unique(numbers, return_index=True)[1], numbers
