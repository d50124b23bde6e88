"""Vectorised interactions: generative models whose methods take many states at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from lcorpp.values import Array, Indices, SharedValue

Table = npt.NDArray[Any]
"""One row for each state: (N, D), or (N,) where a row is one number."""

TOLERANCE = 1e-9
"""Largest relative error of rounding by which a lower bound may exceed the upper one."""


class VectorisedInteraction(Protocol):
    """An `Interaction` whose methods take N states at once, the rows of an array (N, D) of numbers.

    vectorised: True. actions: their names; the methods take their indices (N,). discount: gamma.
    observations: their names; the methods take and return their indices (N,). Without names, observations are
    numbers (N,), or tuples of K numbers (N, K).
    """

    vectorised: bool
    actions: Sequence[str]
    discount: float

    def start(self, value: SharedValue, count: int, rng: np.random.Generator) -> Table:
        """Draw states (count, D) at the start of a decision about a person of this shared value."""

    def step(self, states: Table, actions: Indices, rng: np.random.Generator) -> tuple[Table, Table, Array]:
        """Simulate an action of each state: the next states, the observations and the rewards (N,)."""

    def likelihood(self, observations: Table, states: Table, actions: Indices, next_states: Table) -> Array:
        """Return (N,) the probability or density of each observation, up to a factor of the observation."""

    def shared(self, states: Table) -> Indices:
        """Return (N,) the index of each state's shared value, in their order; -1 if the decision is over."""

    def lower(self, states: Table) -> Array:
        """Return (N,) what one policy that does not see the states earns at least, discounted."""

    def upper(self, states: Table) -> Array:
        """Return (N,) what no policy exceeds, even one that sees the states."""


@dataclass(frozen=True, eq=False)
class VectorisedModel:
    """A vectorised interaction, with the names of its parts as they were checked.

    values: of the shared variables. actions, observations: names; observations without names have none.
    make_error: returns an error that names the class.
    """

    interaction: VectorisedInteraction
    values: tuple[SharedValue, ...]
    actions: tuple[str, ...]
    observations: tuple[str, ...]
    discount: float
    make_error: Callable[[str], Exception]


class VectorBatch:
    """A vectorised interaction with random numbers: `lcorpp.planning.solvers.pomcp.batches.Batch`.

    Raises:
        ModelError: a method returns something else than an array of the expected shape and values.
    """

    def __init__(self, model: VectorisedModel, rng: np.random.Generator) -> None:
        self.actions, self.discount = len(model.actions), model.discount
        self._model, self._interaction, self._rng = model, model.interaction, rng

    def start(self, value: int, count: int) -> Table:
        """Draw states (count, D) of a shared value, given by its index."""
        states = self._interaction.start(self._model.values[value], count, self._rng)
        if not _is_numeric(states) or states.ndim != 2 or len(states) != count:
            raise self._make_error("start()", states, f"an array of numbers ({count}, D)")
        return np.asarray(states)

    def step(self, states: Table, actions: Indices) -> tuple[Table, Table, Array]:
        """Simulate an action of each state; states after the end remain as they are."""
        alive = self.group(states) >= 0
        if alive.all():
            return self._step(states, actions)
        after, rewards = states.copy(), np.zeros(len(states))
        if not alive.any():
            return after, np.zeros(len(states)), rewards
        after[alive], seen, rewards[alive] = self._step(states[alive], actions[alive])
        observations = np.zeros((len(states), *seen.shape[1:]), dtype=seen.dtype)
        observations[alive] = seen
        return after, observations, rewards

    def likelihood(self, observations: Table, states: Table, actions: Indices, next_states: Table) -> Array:
        """Return (N,) the probability or density of each observation."""
        rows = observations, _lock(states), actions, _lock(next_states)
        found = self._interaction.likelihood(*rows)
        self._check_numbers("likelihood()", found, len(states))
        if not (np.asarray(found) >= 0).all():
            raise self._make_error("likelihood()", found, "numbers of at least 0")
        return np.asarray(found, dtype=float)

    def repeat(self, observation: Any, count: int) -> Table:
        """Return an observation, as of `GenerativeModel.read_observation`, (count) times."""
        names = self._model.observations
        row = np.array([names.index(observation) if names else observation])
        if row.dtype == object:  # integers beyond 64 bits
            row = row.astype(float)
        return np.repeat(row, count, axis=0)

    def group(self, states: Table) -> Indices:
        """Return (N,) the index of each state's shared value, -1 after the end."""
        found = np.asarray(self._interaction.shared(_lock(states)))
        count = len(self._model.values)
        is_index = found.shape == (len(states),) and np.issubdtype(found.dtype, np.integer)
        if not is_index or (len(found) and not -1 <= found.min() <= found.max() < count):
            raise self._make_error("shared()", found, f"integers ({len(states)},) from -1 to {count - 1}")
        return found.astype(np.intp)

    def bounds(self, states: Table) -> tuple[Array, Array]:
        """Return (N,) lower and (N,) upper bounds on the value of each state, 0 after the end."""
        alive = np.flatnonzero(self.group(states) >= 0)
        lower, upper = np.zeros(len(states)), np.zeros(len(states))
        for name, bounds in (("lower", lower), ("upper", upper)) if len(alive) else ():
            values = getattr(self._interaction, name)(_lock(states[alive]))
            self._check_numbers(f"{name}()", values, len(alive))
            bounds[alive] = values
        check_bounds(lower, upper, states, self._model.make_error)
        return lower, upper

    def _step(self, states: Table, actions: Indices) -> tuple[Table, Table, Array]:
        result = self._interaction.step(_lock(states), actions, self._rng)
        if not isinstance(result, tuple) or len(result) != 3:
            raise self._make_error("step()", result, "(next states, observations, rewards)")
        after, observations, rewards = result
        if not _is_numeric(after) or after.shape != states.shape:
            raise self._make_error("step()", after, f"next states, an array of numbers {states.shape}")
        self._check_numbers("step()", rewards, len(states), "rewards, ")
        seen, names = np.asarray(observations), self._model.observations
        if names:
            is_valid = seen.shape == (len(states),) and np.issubdtype(seen.dtype, np.integer)
            if not is_valid or not 0 <= seen.min() <= seen.max() < len(names):
                expected = f"observations, integers ({len(states)},) from 0 to {len(names) - 1}"
                raise self._make_error("step()", observations, expected)
        elif not _is_numeric(seen) or seen.ndim not in (1, 2) or len(seen) != len(states):
            expected = f"observations, an array of numbers ({len(states)},) or ({len(states)}, K)"
            raise self._make_error("step()", observations, expected)
        elif not np.isfinite(seen).all():
            raise self._make_error("step()", observations, "observations that are finite")
        if not np.can_cast(after.dtype, states.dtype, "same_kind"):
            raise self._make_error(
                "step()", after, f"next states of type {states.dtype}, as those of start()"
            )
        return np.asarray(after, dtype=states.dtype), seen, np.asarray(rewards, dtype=float)

    def _check_numbers(self, method: str, found: Any, count: int, what: str = "") -> None:
        array = np.asarray(found)
        if not _is_numeric(array) or array.shape != (count,) or not np.isfinite(array).all():
            raise self._make_error(method, found, f"{what}an array of finite numbers ({count},)")

    def _make_error(self, method: str, found: Any, expected: str) -> Exception:
        shape = f" of shape {found.shape}" if isinstance(found, np.ndarray) else ""
        return self._model.make_error(f"{method} returned {found!r}{shape}; expected {expected}")


class OneByOne:
    """A vectorised interaction as an `Interaction`: states are tuples of numbers."""

    def __init__(self, model: VectorisedModel) -> None:
        self._model = model

    def start(self, value: SharedValue, rng: np.random.Generator) -> tuple[Any, ...]:
        """Draw the state at the start of a decision."""
        states = VectorBatch(self._model, rng).start(self._model.values.index(value), 1)
        return tuple(states[0].tolist())

    def step(self, state: Any, action: str, rng: np.random.Generator) -> tuple[tuple[Any, ...], Any, float]:
        """Simulate an action: the next state, the observation and the reward."""
        index, names = np.array([self._model.actions.index(action)]), self._model.observations
        after, seen, rewards = VectorBatch(self._model, rng).step(np.array([state]), index)
        observed = seen[0].tolist()
        named = names[observed] if names else tuple(observed) if isinstance(observed, list) else observed
        return tuple(after[0].tolist()), named, float(rewards[0])

    def likelihood(self, observation: Any, state: Any, action: str, next_state: Any) -> float:
        """Return the probability or density of an observation."""
        batch = self._make_batch()
        index = np.array([self._model.actions.index(action)])
        rows = batch.repeat(observation, 1), np.array([state]), index, np.array([next_state])
        return float(batch.likelihood(*rows)[0])

    def shared(self, state: Any) -> SharedValue | None:
        """Return the shared value of a state, None if the decision is over."""
        index = int(self._make_batch().group(np.array([state]))[0])
        return None if index < 0 else self._model.values[index]

    def lower(self, state: Any) -> float:
        """Return a lower bound on the value of a state."""
        return float(self._make_batch().bounds(np.array([state]))[0][0])

    def upper(self, state: Any) -> float:
        """Return an upper bound on the value of a state."""
        return float(self._make_batch().bounds(np.array([state]))[1][0])

    def _make_batch(self) -> VectorBatch:
        return VectorBatch(self._model, np.random.default_rng(0))  # which is not used


def check_bounds(
    lower: Array, upper: Array, states: Sequence[Any] | Table, make_error: Callable[[str], Exception]
) -> None:
    """Raise an error unless the bounds (N,) of states are finite, and the upper ones not below the others."""
    wrong = ~(np.isfinite(lower) & np.isfinite(upper) & (lower <= upper + TOLERANCE * (1 + np.abs(upper))))
    if wrong.any():
        i = int(np.argmax(wrong))
        raise make_error(
            f"lower() and upper() returned {lower[i]} and {upper[i]} for the state {states[i]!r}; expected"
            " finite numbers, the first not above the second"
        )


def _is_numeric(found: Any) -> bool:
    return isinstance(found, np.ndarray) and found.dtype.kind in "biuf"


def _lock(states: Table) -> Table:
    """Return a view that the user's methods cannot change: several beliefs may share the states."""
    view = states.view()
    view.flags.writeable = False
    return view
