"""Simulators for Monte-Carlo planning: the protocol, and simulators of problems in tables."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import replace
from itertools import accumulate, repeat
from typing import Any, Protocol, TypeVar, cast

import numpy as np

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.planning._native import blind_policies, mdp_bound
from lcorpp.planning.arguments import check_type
from lcorpp.planning.evaluation.mdp import zero_reward_states
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernel_model import build_model
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array, Belief

State = TypeVar("State")

BATCH_SIZE = 4096
"""Random numbers that are drawn at once."""


class Simulator(Protocol[State]):
    """A problem that can be simulated, with its own random numbers. Implement it if tables are too large."""

    @property
    def actions(self) -> int:
        """The number of actions."""

    @property
    def discount(self) -> float:
        """gamma, above 0 and below 1."""

    def step(self, state: State, action: int) -> tuple[State, Hashable, float]:
        """Simulate an action: the next state, the observation and the reward."""

    def value(self, state: State) -> float:
        """Return an estimate of the value of a state, e.g. of a simple policy; 0 if the state is terminal."""

    def terminal(self, state: State) -> bool:
        """Return whether all later rewards are 0."""


class ObservedSimulator(Simulator[State], Protocol[State]):
    """A simulator with the probabilities of its observations, which may be numbers or arrays as tuples."""

    def likelihood(self, observation: Any, state: State, action: int, next_state: State) -> float:
        """Return the probability or density of an observation, up to a factor of the observation."""


MAX_LIKELIHOOD = 1e200
"""Largest likelihood; sums of larger ones may overflow."""


def compute_likelihood(
    simulator: Simulator[Any], observation: Hashable, state: Any, action: int, next_state: Any
) -> float:
    """Return the likelihood by an `ObservedSimulator`.

    Raises:
        ModelError: it is no number from 0 to `MAX_LIKELIHOOD`.
    """
    observed = cast("ObservedSimulator[Any]", simulator)
    found = observed.likelihood(observation, state, action, next_state)
    if not isinstance(found, int | float | np.number) or not 0 <= found <= MAX_LIKELIHOOD:
        raise ModelError(
            f"likelihood() of the simulator returned {found!r} for observation {observation!r}; expected a"
            f" number from 0 to {MAX_LIKELIHOOD:g}"
        )
    return float(found)


def check_hashable(observation: Any) -> None:
    """Reject observations that cannot be compared with others."""
    try:
        hash(observation)
    except TypeError:
        raise ModelError(
            f"an observation of the simulator is a {type(observation).__name__}; expected a key of a"
            " dictionary, e.g. a tuple"
        ) from None


class TableSimulator:
    """A simulator of a problem in tables; states, actions and observations are indices.

    Args:
        leaf_values: the name of an estimate in LEAF_VALUES.
        seed: of the random numbers, an integer of at least 0.

    Raises:
        ModelError: `pomdp` is not a Pomdp, or the estimate is unknown.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import TableSimulator
        >>> pomdp = load_domain("intention").pomdp
        >>> state, _, reward = TableSimulator(pomdp).step(0, pomdp.action_index("report_interested"))
        >>> pomdp.states[state], reward
        ('term', 80.0)
    """

    def __init__(self, pomdp: Pomdp, *, leaf_values: str = "mdp", seed: int = 0) -> None:
        check_type("pomdp", pomdp, Pomdp)
        if leaf_values not in LEAF_VALUES:
            raise ModelError(f"unknown leaf_values {leaf_values!r}; {expected_one_of(tuple(LEAF_VALUES))}")
        self.actions, self.discount = len(pomdp.actions), pomdp.discount
        self._states = len(pomdp.states)
        self._reward: list[float] = pomdp.reward.reshape(-1).tolist()
        self._terminal: list[bool] = zero_reward_states(pomdp).tolist()
        self._values: list[float] = np.where(self._terminal, 0.0, LEAF_VALUES[leaf_values](pomdp)).tolist()
        self._table = pomdp.observation
        self._transition, self._observation = _RowSampler(pomdp.transition), _RowSampler(pomdp.observation)
        rng = np.random.default_rng(seed)
        self._numbers = (number for _ in repeat(None) for number in rng.random(BATCH_SIZE).tolist())

    def __repr__(self) -> str:
        return f"<TableSimulator: {self._states} states, {self.actions} actions>"

    def step(self, state: int, action: int) -> tuple[int, int, float]:
        """Simulate an action: the next state, the observation and the reward."""
        row = action * self._states + state
        after = self._transition.draw(row, self._numbers)
        observation = self._observation.draw(action * self._states + after, self._numbers)
        return after, observation, self._reward[row]

    def likelihood(self, observation: int, state: int, action: int, next_state: int) -> float:
        """Return the probability of an observation."""
        columns, values = self._table.row(action, next_state)
        return float(values[columns == observation].sum())

    def value(self, state: int) -> float:
        """Return an estimate of the value of a state."""
        return self._values[state]

    def terminal(self, state: int) -> bool:
        """Return whether all later rewards are 0."""
        return self._terminal[state]

    def state_sampler(self, belief: Belief) -> Callable[[], int]:
        """Return a function that draws a state from a belief (S,)."""
        states = np.flatnonzero(belief).tolist()
        sums = _cumulate(belief[states].tolist())
        return lambda: int(states[bisect_right(sums, next(self._numbers))])


class _RowSampler:
    """Draws columns of table rows by inverse CDF; the cumulative sums of a row are computed at its first
    use."""

    def __init__(self, table: SparseTables) -> None:
        self._table = table
        self._rows: dict[int, tuple[list[int], list[float]]] = {}

    def draw(self, row: int, numbers: Iterator[float]) -> int:
        """Draw a column of row a R + r."""
        cached = self._rows.get(row)
        if cached is None:
            columns, values = self._table.row(*divmod(row, self._table.shape[1]))
            positive = values > 0
            cached = self._rows[row] = columns[positive].tolist(), _cumulate(values[positive].tolist())
        candidates, sums = cached
        return candidates[0] if len(sums) == 1 else candidates[bisect_right(sums, next(numbers))]


def _cumulate(weights: list[float]) -> list[float]:
    """Cumulative sums as shares of the total; the last is above all random numbers."""
    sums = list(accumulate(weights))
    return [part / sums[-1] for part in sums[:-1]] + [2.0]


def _compute_mdp_values(pomdp: Pomdp) -> Array:
    """Return (S,) values if the state is observed: an upper bound."""
    return np.asarray(mdp_bound(build_model(pomdp), _compute_tolerance(pomdp), 10.0).max(axis=0))


def _compute_random_values(pomdp: Pomdp) -> Array:
    """Return (S,) values of random actions: the expectation of a random rollout."""
    from scipy.sparse import csr_array

    A, S, _ = pomdp.transition.shape
    table = pomdp.transition
    mean = csr_array((table.values / A, (table.rows % S, table.columns)), shape=(S, S))
    random_walk = replace(
        pomdp,
        actions=("any",),
        observations=("nothing",),
        transition=SparseTables.of([mean]),
        observation=SparseTables.of(np.ones((1, S, 1))),
        reward=pomdp.reward.mean(axis=0, keepdims=True),
    )
    return np.asarray(blind_policies(build_model(random_walk), _compute_tolerance(pomdp), 10.0)[0])


def _compute_tolerance(pomdp: Pomdp) -> float:
    """Estimates need only three digits."""
    return 1e-3 * float(np.ptp(pomdp.reward)) + 1e-12


LEAF_VALUES: Mapping[str, Callable[[Pomdp], Array]] = {
    "mdp": _compute_mdp_values,
    "random": _compute_random_values,
}
"""Estimates of the value of the last state of a simulation: with observed state, or of random actions."""
