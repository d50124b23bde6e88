"""One step of the model, arranged for the search: dense for small models, sparse where most is zero."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array, eye_array, linalg

from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array, Belief

_DENSE_STATES = 64
"""Up to this many states a dense product is faster than a sparse one, whatever its zeros."""

_SPARSE_SHARE = 0.1
"""Above this share of non-zero entries BLAS wins."""


class Dynamics:
    """T, Z and R of a POMDP in the memory order that forward and backward steps want.

    observing: (A, O, S) P(o | a, s'), the state reached running fastest.
    reward: (A, S). discount: gamma. sizes: S, A and O.
    """

    def __init__(self, pomdp: Pomdp) -> None:
        T = pomdp.transition
        A, S, _ = T.shape
        self.states, self.actions, self.observations = S, A, len(pomdp.observations)
        self.reward, self.discount = pomdp.reward, pomdp.discount
        self.observing = np.ascontiguousarray(pomdp.observation.transpose(0, 2, 1))
        self._observation = pomdp.observation
        self.is_sparse = bool(S > _DENSE_STATES and np.count_nonzero(T) < _SPARSE_SHARE * T.size)
        # scipy's sparse arrays and numpy's answer the same products; Any stands for either
        self.matrices: list[Any] = [csr_array(T[a]) if self.is_sparse else T[a] for a in range(A)]
        stacked = T.transpose(0, 2, 1).reshape(A * S, S)
        self._forward: Any = csr_array(stacked) if self.is_sparse else np.ascontiguousarray(stacked)

    def spread(self, belief: Belief) -> Array:
        """(A, S) where each action leads from a belief (S,), before anything is observed."""
        return np.asarray(self._forward @ belief).reshape(self.actions, self.states)

    def observation_probabilities(self, spread: Array) -> Array:
        """(A, O) P(o | b, a) from `spread` (A, S)."""
        return np.asarray(np.matmul(spread[:, None, :], self._observation)[:, 0, :])

    def back(self, action: int, following: Array) -> Array:
        """(S,) or (S, n) expectation over s' of `following`, by the state the action is done in."""
        return np.asarray(self.matrices[action] @ following)

    def discounted_sum(self, choice: npt.NDArray[np.intp], reward: Array) -> Array:
        """(S,) the value of doing action choice[s] in s for ever, in a world that can be seen.

        Solves (I - gamma T) v = r.
        """
        S, gamma = self.states, self.discount
        if self.is_sparse:
            T = csr_array((S, S))
            for a in np.unique(choice):
                T = T + csr_array((choice == a).astype(float)[:, None] * self.matrices[a])
            return np.asarray(linalg.spsolve((eye_array(S) - gamma * T).tocsc(), reward))
        rows = np.stack(self.matrices)[choice, np.arange(S)]
        return np.asarray(np.linalg.solve(np.eye(S) - gamma * rows, reward))
