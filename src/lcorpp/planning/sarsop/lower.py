"""The lower bound: a growing set of alpha vectors."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lcorpp.values import Array, Belief


class AlphaVectors:
    """Alpha vectors in the order they were found; each has a stamp that outlives pruning.

    A stamp lets a tree node ask for the vectors since its last visit, and find again the one it liked best.
    """

    def __init__(self, vectors: Array, actions: npt.NDArray[np.intp]) -> None:
        self.count = len(vectors)
        self.next_stamp = self.count
        self._vectors, self._actions, self._stamps = vectors.copy(), actions.copy(), np.arange(self.count)

    @property
    def vectors(self) -> Array:
        """(K, S) the vectors."""
        return self._vectors[: self.count]

    @property
    def actions(self) -> npt.NDArray[np.intp]:
        """(K,) the action each begins with."""
        return self._actions[: self.count]

    @property
    def stamps(self) -> npt.NDArray[np.intp]:
        """(K,) increasing."""
        return self._stamps[: self.count]

    def value(self, belief: Belief) -> float:
        """The bound at a belief (S,)."""
        return float((self.vectors @ belief).max())

    def add(self, vector: Array, action: int) -> None:
        """Append a vector (S,)."""
        if self.count == len(self._vectors):
            room = self.count + 64
            self._vectors = np.concatenate([self._vectors, np.empty((room, len(vector)))])
            self._actions = np.concatenate([self._actions, np.empty(room, dtype=np.intp)])
            self._stamps = np.concatenate([self._stamps, np.empty(room, dtype=np.intp)])
        self._vectors[self.count], self._actions[self.count] = vector, action
        self._stamps[self.count] = self.next_stamp
        # counted last: an interrupt before this line leaves the set as it was
        self.next_stamp += 1
        self.count += 1

    def first_since(self, stamp: int) -> int:
        """The row of the first vector whose stamp is at least `stamp`."""
        return int(np.searchsorted(self.stamps, stamp))

    def rows(self, stamps: npt.NDArray[np.intp]) -> npt.NDArray[np.intp]:
        """(n,) the rows of stamps (n,), -1 for those that were pruned."""
        rows = np.searchsorted(self.stamps, stamps)
        found = self.stamps[np.minimum(rows, self.count - 1)] == stamps
        return np.where(found, rows, -1)

    def keep(self, mask: npt.NDArray[np.bool_]) -> None:
        """Drop the vectors whose entry in `mask` (K,) is false."""
        vectors, actions, stamps = self.vectors[mask], self.actions[mask], self.stamps[mask]
        self._vectors, self._actions, self._stamps, self.count = vectors, actions, stamps, len(vectors)
