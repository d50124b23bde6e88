"""The lower bound: alpha vectors over the states of one group."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lcorpp.planning.sarsop.numpy_kernels.model import Beliefs, Indices
from lcorpp.values import Array


class VectorSet:
    """Alpha vectors over n states in the order they were found; each has a stamp that outlives pruning.

    A stamp lets a tree node ask for the vectors since its last visit, and find again the one it liked best.
    The table is kept state by state: a belief of few states, asked about many vectors, reads few long runs.
    """

    def __init__(self, states: int) -> None:
        self.count = 0
        self._table = np.empty((states, 0))
        self._actions = np.empty(0, dtype=np.int32)
        self._stamps = np.empty(0, dtype=np.int64)

    @property
    def table(self) -> Array:
        """(n, K) the vectors, one in each column."""
        return self._table[:, : self.count]

    @property
    def actions(self) -> npt.NDArray[np.int32]:
        """(K,) the action each begins with."""
        return self._actions[: self.count]

    @property
    def stamps(self) -> npt.NDArray[np.int64]:
        """(K,) rising."""
        return self._stamps[: self.count]

    def first_since(self, stamp: int) -> int:
        """The number of the first vector whose stamp is at least `stamp`."""
        return int(np.searchsorted(self.stamps, stamp))

    def find(self, stamp: int) -> int:
        """The number of the vector with a stamp, -1 if it was pruned."""
        found = self.first_since(stamp)
        return found if found < self.count and self._stamps[found] == stamp else -1

    def values(self, beliefs: Beliefs, first: int = 0) -> Array:
        """(m, K - first) what the vectors from `first` on are worth at m beliefs."""
        return np.asarray(beliefs.weights @ self._table[beliefs.places, first : self.count])

    def best(self, beliefs: Beliefs, first: int = 0) -> tuple[Indices, Array]:
        """(m,) the best vectors at m beliefs, and their values, among those from `first` on; there is one."""
        values = self.values(beliefs, first)
        best = values.argmax(axis=1)
        return first + best, values[np.arange(len(best)), best]

    def central(self) -> int:
        """The vector that is best on the average over all states: what to do where nothing is known."""
        return int(self.table.sum(axis=0).argmax())

    def distances(self, number: int) -> Array:
        """(K,) the Euclidean distances of all vectors from one."""
        return np.asarray(np.sqrt(((self.table - self.table[:, [number]]) ** 2).sum(axis=0)))

    def add(self, vector: Array, action: int, stamp: int) -> None:
        """Append a vector (n,); its stamp is above all others."""
        if self.count == len(self._stamps):
            room = max(32, self.count)
            self._table = np.concatenate([self._table, np.zeros((len(self._table), room))], axis=1)
            self._actions = np.concatenate([self._actions, np.zeros(room, dtype=np.int32)])
            self._stamps = np.concatenate([self._stamps, np.zeros(room, dtype=np.int64)])
        self._table[:, self.count], self._actions[self.count] = vector, action
        self._stamps[self.count] = stamp
        self.count += 1  # last: an interrupt before this line leaves the set as it was

    def keep(self, kept: npt.NDArray[np.bool_]) -> None:
        """Drop the vectors whose entry in `kept` (K,) is false."""
        table, actions, stamps = self.table[:, kept], self.actions[kept], self.stamps[kept]
        self._table, self._actions, self._stamps, self.count = table, actions, stamps, len(stamps)
