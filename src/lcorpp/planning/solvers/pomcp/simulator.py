"""What a search by simulation needs of a problem, and problems in tables as such a simulator."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Hashable, Iterator, Mapping
from itertools import accumulate
from typing import Any, Protocol, TypeVar

import numpy as np

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.planning.evaluation.absorbing import zero_reward_states
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernels import engine, model_of
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array, Belief

State = TypeVar("State")

DRAWN = 4096
"""Random numbers that are drawn at once."""


class Simulator(Protocol[State]):
    """A problem that can be tried out; it draws its own chance. Write one where tables would be too large."""

    @property
    def actions(self) -> int:
        """How many actions there are."""

    @property
    def discount(self) -> float:
        """gamma, above 0 and below 1."""

    def step(self, state: State, action: int) -> tuple[State, Hashable, float]:
        """The state that an action leads to, what is observed there, and the reward."""

    def value(self, state: State) -> float:
        """A guess at what is still earned from a state, e.g. by a simple policy; 0 where it is over."""

    def over(self, state: State) -> bool:
        """Whether nothing more can be earned."""


class TableSimulator:
    """A problem in tables, simulated; states, actions and observations are indices.

    Args:
        leaves: the name of a guess in LEAVES.
        seed: of its chance, a whole number from 0.

    Raises:
        ModelError: there is no guess of that name.
    """

    def __init__(self, pomdp: Pomdp, *, leaves: str = "mdp", seed: int = 0) -> None:
        if leaves not in LEAVES:
            raise ModelError(
                f"unknown guess {leaves!r} at the value of a state; {expected_one_of(tuple(LEAVES))}"
            )
        self.actions, self.discount = len(pomdp.actions), pomdp.discount
        self._states = len(pomdp.states)
        self._reward: list[float] = pomdp.reward.reshape(-1).tolist()
        self._over: list[bool] = zero_reward_states(pomdp).tolist()
        self._values: list[float] = np.where(self._over, 0.0, LEAVES[leaves](pomdp)).tolist()
        self._moves, self._shows = _Chances(pomdp.transition), _Chances(pomdp.observation)
        self._numbers = _numbers(np.random.default_rng(seed))

    def step(self, state: int, action: int) -> tuple[int, int, float]:
        """The state that an action leads to, what is observed there, and the reward."""
        row = action * self._states + state
        after = self._moves.draw(row, self._numbers)
        return after, self._shows.draw(action * self._states + after, self._numbers), self._reward[row]

    def value(self, state: int) -> float:
        """A guess at what is still earned from a state."""
        return self._values[state]

    def over(self, state: int) -> bool:
        """Whether nothing more can be earned."""
        return self._over[state]

    def drawing(self, belief: Belief) -> Callable[[], int]:
        """What draws states from a belief (S,)."""
        states = np.flatnonzero(belief).tolist()
        sums = _sums(belief[states].tolist())
        return lambda: int(states[bisect_right(sums, next(self._numbers))])


class _Chances:
    """The rows of a table, each made ready to be drawn from when it is first needed."""

    def __init__(self, table: SparseTables) -> None:
        self._table = table
        self._rows: dict[int, tuple[list[int], list[float]]] = {}

    def draw(self, row: int, numbers: Iterator[float]) -> int:
        """A column of row a R + r by its probability."""
        found = self._rows.get(row)
        if found is None:
            columns, values = self._table.row(*divmod(row, self._table.shape[1]))
            some = values > 0
            found = self._rows[row] = columns[some].tolist(), _sums(values[some].tolist())
        columns_, sums = found
        return columns_[0] if len(sums) == 1 else columns_[bisect_right(sums, next(numbers))]


def _sums(weights: list[float]) -> list[float]:
    """Running sums, as shares of the whole; the last is above any number drawn."""
    sums = list(accumulate(weights))
    return [part / sums[-1] for part in sums[:-1]] + [2.0]


def _numbers(rng: np.random.Generator) -> Iterator[float]:
    while True:
        yield from rng.random(DRAWN).tolist()


def _seen(pomdp: Pomdp) -> Array:
    """(S,) what is earned by who sees the state: too much."""
    kernels = engine()
    return np.asarray(kernels.mdp_bound(model_of(kernels, pomdp), _tolerance(pomdp), 10.0).max(axis=0))


def _random(pomdp: Pomdp) -> Array:
    """(S,) what actions at random earn: the expectation of a random rollout, without its chance."""
    from scipy.sparse import csr_array

    A, S, _ = pomdp.transition.shape
    table = pomdp.transition
    shape = (S, S)
    mean: Any = csr_array((table.values / A, (table.rows % S, table.columns)), shape=shape)
    nothing = csr_array(np.ones((S, 1)))
    walk = Pomdp(
        states=pomdp.states,
        actions=("any",),
        observations=("nothing",),
        transition=SparseTables.of([mean]),
        observation=SparseTables.of([nothing]),
        reward=pomdp.reward.mean(axis=0, keepdims=True),
        discount=pomdp.discount,
        start=pomdp.start,
    )
    kernels = engine()
    return np.asarray(kernels.blind_policies(model_of(kernels, walk), _tolerance(pomdp), 10.0)[0])


def _tolerance(pomdp: Pomdp) -> float:
    """Guesses need no more than three digits."""
    return 1e-3 * float(np.ptp(pomdp.reward)) + 1e-12


LEAVES: Mapping[str, Callable[[Pomdp], Array]] = {"mdp": _seen, "random": _random}
"""Guesses at the value of a state that a simulation ends in: of who sees the state, or acts at random."""
