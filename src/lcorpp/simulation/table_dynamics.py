"""The people of a domain whose model has tables: drawn from cumulative tables."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from lcorpp.domains import Domain
from lcorpp.simulation.world import Dynamics
from lcorpp.values import Array, SharedValue


class SimulationModel(Dynamics):
    """The true dynamics of a domain as cumulative tables, shared by all simulated worlds.

    Each table has one list of interval ends for each row of probabilities:
    initial_states[v] over states, `find_successors` over next states, feedback[a][s'] over observations;
    reward[a][s] is the expected immediate reward.

    Examples:
        >>> import numpy as np
        >>> from lcorpp import load_domain
        >>> from lcorpp.simulation import SimulationModel
        >>> model = SimulationModel(load_domain("intention"))
        >>> world = model.make_world({"intention": "interested"}, np.random.default_rng(0))
        >>> world.act("greet"), world.cost
        ('pos', 2.0)
    """

    def __init__(self, domain: Domain) -> None:
        pomdp = domain.pomdp
        self.domain = domain
        self._terminal = frozenset(domain.planning.terminal)
        self._actions = {name: a for a, name in enumerate(pomdp.actions)}
        self.initial_states = _cumulate(domain.planning.initial_states)
        self._successors: dict[tuple[int, int], tuple[list[int], list[float]]] = {}
        self.feedback = [_cumulate(rows) for rows in domain.simulation.feedback_model]
        self.reward = pomdp.reward.tolist()

    def find_successors(self, a: int, s: int) -> tuple[list[int], list[float]]:
        """Return the possible states after an action in a state, and their interval ends."""
        known = self._successors.get((a, s))
        if known is None:
            states, probabilities = self.domain.people_transition.row(a, s)
            known = states.tolist(), _cumulate(probabilities[np.newaxis])[0]
            self._successors[a, s] = known
        return known

    def start(self, value: SharedValue, rng: np.random.Generator) -> int:
        return _draw(self.initial_states[self.domain.values.index(value)], rng)

    def step(
        self, state: int, action: str, rng: np.random.Generator, *, answers: bool
    ) -> tuple[int, str | None, float]:
        a = self._actions[action]
        states, ends = self.find_successors(a, state)
        after, observation = states[_draw(ends, rng)], None
        if answers or after in self._terminal:
            observation = self.domain.pomdp.observations[_draw(self.feedback[a][after], rng)]
        return after, observation, self.reward[a][state]

    def report(self, state: int, action: str, rng: np.random.Generator) -> float:
        return float(self.reward[self._actions[action]][state])

    def is_terminal(self, state: int) -> bool:
        return state in self._terminal


def _draw(bounds: Sequence[float], rng: np.random.Generator) -> int:
    return bisect_right(bounds, rng.random())


def _cumulate(rows: Array) -> list[list[float]]:
    """Return the cumulative sums of rows of probabilities (n, k), for sampling by bisection.

    From the last possible entry on the sums are exactly 1, so that rounding never draws an impossible one.
    """
    ends = np.cumsum(rows, axis=1)
    last = rows.shape[1] - 1 - np.argmax(rows[:, ::-1] > 0, axis=1)
    ends[np.arange(rows.shape[1]) >= last[:, None]] = 1.0
    bounds: list[list[float]] = ends.tolist()
    return bounds
