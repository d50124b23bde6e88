"""The lower bound: alpha vectors over the states of one group."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lcorpp.planning.sarsop.numpy_kernels.model import BeliefBatch
from lcorpp.values import Array, Indices


class VectorSet:
    """Alpha vectors over n states in order of creation, each with a stamp that pruning does not change.

    With stamps a tree node selects the vectors added since its last visit and finds its best vector again.
    The table is stored by state: the values of many vectors at a sparse belief need few contiguous reads.
    """

    def __init__(self, states: int) -> None:
        self.count = 0
        self._table = np.empty((states, 0))
        self._actions = np.empty(0, dtype=np.int32)
        self._stamps = np.empty(0, dtype=np.int64)

    @property
    def table(self) -> Array:
        """(n, K) the vectors, one per column."""
        return self._table[:, : self.count]

    @property
    def actions(self) -> npt.NDArray[np.int32]:
        """(K,) the first action of each vector's plan."""
        return self._actions[: self.count]

    @property
    def stamps(self) -> npt.NDArray[np.int64]:
        """(K,) stamps, strictly increasing."""
        return self._stamps[: self.count]

    def first_since(self, stamp: int) -> int:
        """Return the column of the first vector whose stamp is at least `stamp`."""
        return int(np.searchsorted(self.stamps, stamp))

    def find(self, stamp: int) -> int:
        """Return the column of the vector with a stamp, -1 if it was pruned."""
        column = self.first_since(stamp)
        return column if column < self.count and self._stamps[column] == stamp else -1

    def values(self, beliefs: BeliefBatch, first: int = 0) -> Array:
        """Return (m, K - first) values of the vectors from column `first` on at m beliefs."""
        return np.asarray(beliefs.weights @ self._table[beliefs.positions, first : self.count])

    def best(self, beliefs: BeliefBatch, first: int = 0) -> tuple[Indices, Array]:
        """Return columns (m,) and values (m,) of the best vectors at m beliefs, from column `first` on."""
        values = self.values(beliefs, first)
        best = values.argmax(axis=1)
        return first + best, values[np.arange(len(best)), best]

    def central(self) -> int:
        """Return the column of the vector with the largest mean: the choice if the belief is unknown."""
        return int(self.table.sum(axis=0).argmax())

    def distances(self, column: int) -> Array:
        """Return (K,) Euclidean distances of all vectors from one."""
        return np.asarray(np.sqrt(((self.table - self.table[:, [column]]) ** 2).sum(axis=0)))

    def add(self, vector: Array, action: int, stamp: int) -> None:
        """Append a vector (n,); its stamp is larger than all others."""
        if self.count == len(self._stamps):
            growth = max(32, self.count)
            self._table = np.concatenate([self._table, np.zeros((len(self._table), growth))], axis=1)
            self._actions = np.concatenate([self._actions, np.zeros(growth, dtype=np.int32)])
            self._stamps = np.concatenate([self._stamps, np.zeros(growth, dtype=np.int64)])
        self._table[:, self.count], self._actions[self.count] = vector, action
        self._stamps[self.count] = stamp
        self.count += 1  # last, so that an interrupt before this line leaves the set unchanged

    def keep(self, kept: npt.NDArray[np.bool_]) -> None:
        """Drop the vectors whose entry in `kept` (K,) is false."""
        table, actions, stamps = self.table[:, kept], self.actions[kept], self.stamps[kept]
        self._table, self._actions, self._stamps, self.count = table, actions, stamps, len(stamps)
