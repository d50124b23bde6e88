"""A generative model: the planner's model as an object that simulates steps, in place of tables."""

from __future__ import annotations

import json
from collections.abc import Hashable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from math import isfinite
from numbers import Real
from typing import Any, Protocol

import numpy as np

from lcorpp.errors import LcorppError, ModelError, ObservationError, expected_one_of
from lcorpp.planning.vectorised import OneByOne, VectorBatch, VectorisedModel, check_bounds
from lcorpp.user_code import UserFunction
from lcorpp.values import Array, SharedValue, format_value

OVER = "over"
"""Name of the state after the end of a decision."""


class Interaction(Protocol):
    """What a user's class defines. States are any objects; the random numbers are those of `rng`.

    actions: their names. discount: gamma, above 0 and below 1.
    observations: their names; a class without them has numbers, or tuples of numbers, as observations.

    Further methods are optional. `value(state)`: an estimate of what a state is worth; 0 without it. Or both
    `lower(state)` and `upper(state)`: what a policy, the same for all states, earns at least without seeing
    the state, and what no policy exceeds, even one that sees it. With `vectorised = True` the methods take
    many states at once, see `lcorpp.planning.vectorised.VectorisedInteraction`.
    """

    actions: Sequence[str]
    discount: float

    def start(self, value: SharedValue, rng: np.random.Generator) -> Any:
        """Draw the state at the start of a decision about a person of this shared value."""

    def step(self, state: Any, action: str, rng: np.random.Generator) -> tuple[Any, Hashable, float]:
        """Simulate an action: the next state, the observation and the reward."""

    def likelihood(self, observation: Any, state: Any, action: str, next_state: Any) -> float:
        """Return the probability or density of an observation, up to a factor of the observation."""

    def shared(self, state: Any) -> SharedValue | None:
        """Return the shared value of a state; None if the decision is over."""


MAX_CHECKED = 1000
"""Maximum number of steps that are simulated when a model is made."""

METHODS = ("start", "step", "likelihood", "shared")
"""The methods that an `Interaction` needs."""

BOUNDS = ("lower", "upper")
"""Its optional bounds on the value of a state."""

Origin = tuple[UserFunction, tuple[Any, ...]]
"""The function or class of a file that made an `Interaction`, and its arguments."""


class GenerativeModel:
    """The planner's model as an `Interaction`; it has no tables, so that no policy can be solved for it.

    The names of its states are those of the shared values, joined by "_", and "over": a belief (S,) is a
    distribution over them. What else a state contains is in the particles of `GenerativePlanner` alone.

    Args:
        interaction: the user's object, an `Interaction` or a `VectorisedInteraction`.
        values: of the shared variables.
        origin: the function or class of a file that made the object, and its arguments; None without a file.

    user_object: the object as given. interaction: as an `Interaction`. vectorised: as one that is vectorised;
        None if it is not. has_bounds: whether states have a lower and an upper bound.

    Raises:
        ModelError: a part is missing or wrong. From each shared value each action is simulated once, so that
            most errors occur here.

    Examples:
        >>> from lcorpp.planning import GenerativeModel
        >>> class Coin:
        ...     actions, discount, observations = ("look", "say_heads", "say_tails"), 0.9, ("h", "t")
        ...     def start(self, value, rng): return value
        ...     def step(self, state, action, rng):
        ...         if action == "look": return state, state[0], -1.0
        ...         return "end", "h", 5.0 if action == "say_" + state else -5.0
        ...     def likelihood(self, observation, state, action, next_state):
        ...         return float(observation == next_state[0]) if action == "look" else 1.0
        ...     def shared(self, state): return None if state == "end" else state
        >>> GenerativeModel(Coin(), ("heads", "tails"))
        <GenerativeModel Coin: 2 values, 3 actions, 2 observations>
    """

    def __init__(self, interaction: Any, values: Sequence[SharedValue], origin: Origin | None = None) -> None:
        self.user_object, self.values, self._origin = interaction, tuple(values), origin
        self._name = type(interaction).__name__
        self._function = None if origin is None else origin[0]
        names = [value if isinstance(value, str) else "_".join(value) for value in self.values]
        over = OVER
        while over in names:
            over += "_"
        self.states = (*names, over)
        self._indices = {value: v for v, value in enumerate(self.values)}
        missing = [name for name in METHODS if not callable(getattr(interaction, name, None))]
        if missing:
            raise self.make_error(f"has no method {', '.join(missing)}; expected {', '.join(METHODS)}")
        self.actions = self._read_names("actions", getattr(interaction, "actions", None))
        own = getattr(interaction, "observations", None)
        self.observations = () if own is None else self._read_names("observations", own)
        self.discount = self._check_discount(getattr(interaction, "discount", None))
        self.has_bounds = self._find_bounds()
        self.interaction: Any = interaction
        self._width: int | None = None  # of the observations of one that is vectorised, see `_find_width`
        self.vectorised: VectorisedModel | None = None
        if self._find_vectorised():
            self.vectorised = VectorisedModel(
                interaction, self.values, self.actions, self.observations, self.discount, self.make_error
            )
            self.interaction = OneByOne(self.vectorised)
        with self.locate("the simulation of its actions"):
            self._check_steps()

    def __repr__(self) -> str:
        count = len(self.observations)
        observations = f"{count} observations" if count else "observations that are numbers"
        return (
            f"<GenerativeModel {self._name}: {len(self.values)} values,"
            f" {len(self.actions)} actions, {observations}>"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        if self._origin is None:
            return GenerativeModel, (self.user_object, self.values)
        return _make_again, (self.values, self._origin)  # another process loads the file again

    @property
    def file(self) -> str:
        """``FILE:LINE`` of the definition; the name of the class without a file."""
        return self._function.location if self._function else self._name

    @cached_property
    def fingerprint(self) -> str:
        """Hash of the file, "" without one: 64 hexadecimal digits."""
        from hashlib import sha256

        return sha256(self._function.path.read_bytes()).hexdigest() if self._function else ""

    @property
    def start(self) -> Array:
        """(S,) a belief without knowledge: all shared values are equally probable."""
        return np.array([*[1 / len(self.values)] * len(self.values), 0.0])

    def action_index(self, action: str) -> int:
        """Return the index of an action.

        Raises:
            ModelError: there is none of this name.
        """
        if action not in self.actions:
            raise ModelError(f"unknown action {action!r}; {expected_one_of(self.actions)}")
        return self.actions.index(action)

    def find_value(self, state: Any) -> int:
        """Return the index of a state's shared value; the number of values if the decision is over.

        Raises:
            ModelError: `shared` returns something else.
        """
        value = self.interaction.shared(state)
        if value is None:
            return len(self.values)
        index: int | None = self._indices.get(value) if isinstance(value, str | tuple) else None
        if index is None:
            expected = expected_one_of([format_value(known) for known in self.values])
            raise self.make_error(f"shared() returned {value!r}; {expected}, or None after the end")
        return index

    def format_observation(self, observation: Any) -> str:
        """Return an observation as text: its name, or a number or tuple as JSON.

        Raises:
            ModelError: it is no observation of the model.
        """
        if self.observations:
            if observation in self.observations:
                return str(observation)
            raise self.make_error(f"step() observed {observation!r}; {expected_one_of(self.observations)}")
        try:
            if not _is_finite(observation):
                raise ValueError
            return json.dumps(observation, default=lambda number: number.item())
        except (TypeError, ValueError, AttributeError):
            raise self.make_error(
                f"step() observed {observation!r}; expected a finite number or a tuple of such, as the class"
                " has no observations with names"
            ) from None

    def read_observation(self, text: str) -> Hashable:
        """Return the observation of a text of `format_observation`.

        Raises:
            ObservationError: the text is something else.
        """
        if self.observations:
            if text in self.observations:
                return text
            raise ObservationError(f"unknown observation {text!r}; {expected_one_of(self.observations)}")
        observation: Hashable
        try:
            observation = _as_tuples(json.loads(text))
        except (ValueError, RecursionError):
            observation = None
        if not _is_finite(observation):
            raise ObservationError(f"the observation {text!r}; expected a number, or numbers as in [1, 2.5]")
        if self._width is not None and _find_width(observation) != self._width:
            expected = f"{self._width} numbers" if self._width else "a number"
            raise ObservationError(f"the observation {text!r}; expected {expected}")
        return observation

    @contextmanager
    def locate(self, what: str) -> Iterator[None]:
        """Return a context in which failures of the user's code become typed errors with file and line."""
        try:
            yield
        except LcorppError:
            raise
        except Exception:
            if self._function is None:
                raise
            with self._function.locate_failures(what):
                raise

    def make_error(self, reason: str) -> ModelError:
        """Return an error that names the class, and its file if it has one."""
        place = f"{self.file}: " if self._function else ""
        return ModelError(f"{place}{self._name}: {reason}")

    def _read_names(self, key: str, names: Any) -> tuple[str, ...]:
        is_list = isinstance(names, Iterable) and not isinstance(names, str)
        found = tuple(names) if is_list else ()
        if not found or len(set(found)) < len(found) or not all(isinstance(x, str) and x for x in found):
            raise self.make_error(f"{key} = {names!r}; expected a tuple of distinct names")
        return found

    def _check_discount(self, discount: Any) -> float:
        if not isinstance(discount, int | float) or not 0 < discount < 1:
            raise self.make_error(f"discount = {discount!r}; expected a number above 0 and below 1")
        return float(discount)

    def _find_bounds(self) -> bool:
        """Return whether the object has bounds; one alone is an error."""
        found = [name for name in BOUNDS if callable(getattr(self.user_object, name, None))]
        if len(found) == 1:
            raise self.make_error(f"has {found[0]}() alone; expected both of {', '.join(BOUNDS)}")
        return bool(found)

    def _find_vectorised(self) -> bool:
        """Return whether the object takes many states at once; it then needs bounds."""
        found = getattr(self.user_object, "vectorised", False)
        if not isinstance(found, bool):
            raise self.make_error(f"vectorised = {found!r}; expected True or False")
        if found and not self.has_bounds:
            raise self.make_error(f"is vectorised, without {' and '.join(BOUNDS)}; expected both methods")
        return found

    def _check_steps(self) -> None:
        """Simulate each action once from each shared value, at most `MAX_CHECKED` steps."""
        rng = np.random.default_rng(0)
        for value in self.values[: max(1, MAX_CHECKED // len(self.actions))]:
            state = self.interaction.start(value, rng)
            if self.find_value(state) != self._indices[value]:
                shown = self.interaction.shared(state)
                raise self.make_error(f"start({value!r}) has the shared value {shown!r}; expected the same")
            if self.has_bounds:
                self._check_bounds(state)
            for action in self.actions:
                self._check_step(state, action, self.interaction.step(state, action, rng))

        if self.vectorised is not None:
            self._check_batch(VectorBatch(self.vectorised, rng))

    def _check_bounds(self, state: Any) -> None:
        """Check the bounds of a state."""
        bounds = self.interaction.lower(state), self.interaction.upper(state)
        if not all(map(_is_number, bounds)):
            raise self.make_error(f"lower() and upper() returned {bounds!r}; expected finite numbers")
        lower, upper = (np.array([bound], dtype=float) for bound in bounds)
        check_bounds(lower, upper, [state], self.make_error)

    def _check_batch(self, batch: VectorBatch) -> None:
        """Simulate all actions at once; a method may fail for several states alone."""
        starts = [batch.start(value, 2) for value in range(min(len(self.values), MAX_CHECKED))]
        widths = {states.shape[1] for states in starts}
        if len(widths) > 1:
            raise self.make_error(f"start() returned arrays (N, D) of several D: {sorted(widths)}")
        states = np.resize(np.concatenate(starts), (max(2, batch.actions), *widths))
        actions = np.arange(len(states)) % batch.actions
        after, observations, _ = batch.step(states, actions)
        if not self.observations:
            self._width = _find_width(tuple(observations[0].tolist()) if observations.ndim > 1 else 0)
        batch.likelihood(observations, states, actions, after)
        batch.group(after)
        if self.has_bounds:
            batch.bounds(after)

    def _check_step(self, state: Any, action: str, result: Any) -> None:
        """Check the result of a step."""
        if not isinstance(result, tuple) or len(result) != 3:
            raise self.make_error(
                f"step() returned {result!r} for {action!r}; expected (next state, observation, reward)"
            )
        after, observation, reward = result
        if not _is_number(reward):
            raise self.make_error(f"the reward of {action!r} is {reward!r}; expected a finite number")
        self.find_value(after)
        known = self.read_observation(self.format_observation(observation))
        likelihood = self.interaction.likelihood(known, state, action, after)
        if not isinstance(likelihood, int | float | np.number) or not likelihood > 0:
            raise self.make_error(
                f"likelihood() returned {likelihood!r} for the observation {observation!r} that step()"
                f" returned for {action!r}; expected a number above 0"
            )


class GenerativeSimulator:
    """A generative model with random numbers, as `Simulator`: actions are indices."""

    def __init__(self, model: GenerativeModel, rng: np.random.Generator) -> None:
        interaction = model.interaction
        self.actions, self.discount = len(model.actions), model.discount
        self._names, self._rng, self._step = model.actions, rng, interaction.step
        self._likelihood, self._shared = interaction.likelihood, interaction.shared
        self.value = getattr(interaction, "value", None) or (lambda _state: 0.0)
        if model.has_bounds:
            self.lower, self.upper = interaction.lower, interaction.upper

    def step(self, state: Any, action: int) -> tuple[Any, Hashable, float]:
        """Simulate an action: the next state, the observation and the reward."""
        after, observation, reward = self._step(state, self._names[action], self._rng)
        return after, observation, reward

    def likelihood(self, observation: Any, state: Any, action: int, next_state: Any) -> float:
        """Return the probability or density of an observation."""
        return self._likelihood(observation, state, self._names[action], next_state)  # type: ignore[no-any-return]

    def terminal(self, state: Any) -> bool:
        """Return whether the decision is over."""
        return self._shared(state) is None


def _make_again(values: tuple[SharedValue, ...], origin: Origin) -> GenerativeModel:
    function, arguments = origin
    return GenerativeModel(function(*arguments), values, origin)


def _is_number(value: Any) -> bool:
    """Whether a value is a finite number."""
    return not isinstance(value, tuple) and _is_finite(value)


def _is_finite(value: Any) -> bool:
    """Whether a value is a finite number, or a tuple of such."""
    if isinstance(value, tuple):
        return all(map(_is_finite, value))
    try:
        return isinstance(value, Real) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:  # an integer of hundreds of digits
        return False


def _find_width(observation: Any) -> int:
    """Return the length of a tuple of numbers; 0 of a number, -1 of a tuple of tuples."""
    if not isinstance(observation, tuple):
        return 0
    return -1 if any(isinstance(part, tuple) for part in observation) else len(observation)


def _as_tuples(value: Any) -> Any:
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value
