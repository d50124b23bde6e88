"""Dynamic programming on a dense model: best plans at beliefs, values of plans and controllers.

Sources: Smallwood and Sondik, Operations Research 1973 (alpha vectors); Hansen, Solving POMDPs by searching
in policy space, UAI 1998 (the value of a controller).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array, Indices


class Controller(NamedTuple):
    """Plans that each take an action and continue with a plan that depends on the observation.

    actions: (n,). links: (n, O) number of the next plan.
    """

    actions: Indices
    links: Indices


class DenseModel:
    """T, Z and R of a problem as dense tables; rows are scaled to sum to 1.

    transition: (A, S, S). observation: (A, O, S) P(o | a, s'). reward: (A, S). discount: gamma.
    possible: for each action the observations that can follow it.

    Raises:
        ModelError: the tables are too large.
    """

    def __init__(self, pomdp: Pomdp, discount: float | None = None) -> None:
        """
        Args:
            discount: replaces the model's own, for a finite horizon.
        """
        T, Z = pomdp.transition.dense, pomdp.observation.dense
        self.transition: Array = T / T.sum(axis=2, keepdims=True)
        self.observation = np.ascontiguousarray((Z / Z.sum(axis=2, keepdims=True)).transpose(0, 2, 1))
        self.reward = pomdp.reward
        self.discount = pomdp.discount if discount is None else discount
        self.actions, self.observations, self.states = self.observation.shape
        reached: npt.NDArray[np.bool_] = np.any(T > 0, axis=1)
        self.possible = [
            np.flatnonzero((self.observation[a] * reached[a]).any(axis=1)) for a in range(self.actions)
        ]

    def look_ahead(self, vectors: Array, beliefs: Array) -> Controller:
        """Compute the best plan at each of some beliefs.

        Args:
            vectors: (K, S) of the plans of the next step; a link is a row of it. beliefs: (n, S).
        """
        n = len(beliefs)
        best = np.full(n, -np.inf)
        actions, links = np.zeros(n, dtype=np.intp), np.zeros((n, self.observations), dtype=np.intp)
        for a in range(self.actions):
            predicted = beliefs @ self.transition[a]
            value = beliefs @ self.reward[a]
            # after an impossible observation any plan is valid: take the best one after the action alone
            next_plan = np.repeat((predicted @ vectors.T).argmax(axis=1)[:, None], self.observations, axis=1)
            for o in self.possible[a]:
                values = (predicted * self.observation[a, o]) @ vectors.T
                winner = values.argmax(axis=1)
                value += self.discount * values[np.arange(n), winner]
                reachable = (predicted * self.observation[a, o]).any(axis=1)
                next_plan[reachable, o] = winner[reachable]
            better = value > best
            best[better], actions[better], links[better] = value[better], a, next_plan[better]
        return Controller(actions, links)

    def backproject(self, plans: Controller, vectors: Array) -> Array:
        """Compute the values (n, S) of plans whose links are rows of vectors (K, S)."""
        values = np.empty((len(plans.actions), self.states))
        for a in np.unique(plans.actions):
            rows = np.flatnonzero(plans.actions == a)
            next_values = np.zeros((len(rows), self.states))
            for o in self.possible[a]:
                next_values += self.observation[a, o] * vectors[plans.links[rows, o]]
            values[rows] = self.reward[a] + self.discount * (self.transition[a] @ next_values.T).T
        return values

    def evaluate(self, plans: Controller) -> Array:
        """Compute values (n, S), from below, of plans whose links are among themselves."""
        from scipy.sparse import csr_array, eye_array, linalg

        n, S = len(plans.actions), self.states
        rows, columns, values = [], [], []
        for k in range(n):
            a = int(plans.actions[k])
            for o in self.possible[a]:
                step = self.transition[a] * self.observation[a, o]
                source, target = np.nonzero(step)
                rows.append(k * S + source)
                columns.append(int(plans.links[k, o]) * S + target)
                values.append(step[source, target])
        index = np.concatenate(rows), np.concatenate(columns)
        matrix = self.discount * csr_array((np.concatenate(values), index), shape=(n * S, n * S))
        reward = self.reward[plans.actions].reshape(-1)
        solution = linalg.spsolve((eye_array(n * S) - matrix).tocsc(), reward)
        # subtract the largest residual, so that rounding in the solver cannot raise a value above the truth
        residual = max(0.0, float((solution - reward - matrix @ solution).max()))
        return np.asarray(solution - residual / (1 - self.discount)).reshape(n, S)

    def evaluate_blind(self) -> Array:
        """Compute the values (A, S) of repeating one action forever."""
        actions = np.arange(self.actions)
        return self.evaluate(Controller(actions, np.repeat(actions[:, None], self.observations, axis=1)))
