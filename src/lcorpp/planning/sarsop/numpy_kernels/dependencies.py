"""The vectors that each alpha vector depends on: a policy needs them to earn what its vectors promise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcorpp.planning.sarsop.numpy_kernels.alpha_vectors import VectorSet
from lcorpp.values import Array

IMPORTED = -1
"""Stands for all imported vectors: each of them may depend on any other."""


@dataclass(frozen=True, eq=False)
class PrunedVector:
    """A pruned vector (n,) that others depend on, over the states of a group; the search does not use it."""

    group: int
    action: int
    values: Array


class VectorDependencies:
    """For each vector, by stamp, the vectors it depends on, and replacements of the pruned ones.

    A backup computes a vector from one vector per observation, and the promised value is earned only if the
    policy continues with those. If one of them is pruned, a vector that dominates it replaces it. If there is
    none, the pruned vector is kept here until no other vector depends on it.
    """

    def __init__(self, blind: int) -> None:
        """
        Args:
            blind: vectors with smaller stamps are blind policies: they depend on themselves and always stay.
        """
        self._blind = blind
        self._depends_on: dict[int, list[int]] = {}
        self._replaced_by: dict[int, int] = {}
        self._pruned: dict[int, PrunedVector] = {}

    @property
    def memory_size(self) -> int:
        """Memory of the pruned vectors and dependencies in bytes."""
        pruned = sum(vector.values.nbytes for vector in self._pruned.values())
        return pruned + 8 * sum(map(len, self._depends_on.values()))

    def record(self, vector: int, depends_on: Sequence[int]) -> None:
        """Record a new vector and the vectors it depends on."""
        self._depends_on[vector] = sorted({stamp for stamp in depends_on if stamp >= self._blind})

    def record_imported_vector(self, vector: int) -> None:
        """Record a vector that was imported from another search."""
        self._depends_on.setdefault(IMPORTED, []).append(vector)
        self._depends_on[vector] = [IMPORTED]

    def record_pruned_vectors(
        self, vectors: VectorSet, group: int, kept: npt.NDArray[np.bool_], slack: float
    ) -> None:
        """Record the vectors whose entry in `kept` is false, before the set drops them.

        Args:
            slack: losses up to this are rounding errors.
        """
        remaining = np.flatnonzero(kept)
        for column in np.flatnonzero(~kept).tolist():
            stamp, values = int(vectors.stamps[column]), vectors.table[:, column]
            dominating = (vectors.table[:, remaining] >= values[:, None] - slack).all(axis=0)
            if dominating.any():
                self._replaced_by[stamp] = int(vectors.stamps[remaining[dominating.argmax()]])
            else:
                self._pruned[stamp] = PrunedVector(group, int(vectors.actions[column]), values.copy())

    def forget_unneeded(self, sets: Sequence[VectorSet]) -> None:
        """Forget all vectors that the vectors in the sets do not depend on."""
        needed = self._find_needed_stamps(sets)  # it resolves all replacements
        self._depends_on = {stamp: self._depends_on[stamp] for stamp in needed if stamp in self._depends_on}
        self._pruned = {stamp: self._pruned[stamp] for stamp in needed if stamp in self._pruned}
        self._replaced_by = {}

    def find_needed_vectors(self, sets: Sequence[VectorSet]) -> list[PrunedVector]:
        """Return the pruned vectors that the vectors in the sets depend on, by rising stamps."""
        if not self._pruned:
            return []
        return [
            self._pruned[stamp] for stamp in sorted(self._find_needed_stamps(sets)) if stamp in self._pruned
        ]

    def _find_replacement(self, stamp: int) -> int:
        while stamp in self._replaced_by:
            stamp = self._replaced_by[stamp]
        return stamp

    def _find_needed_stamps(self, sets: Sequence[VectorSet]) -> list[int]:
        """Return the stamps of the vectors in the sets and of all vectors they depend on, directly or not."""
        queue = [stamp for vectors in sets for stamp in vectors.stamps.tolist() if stamp >= self._blind]
        visited = set(queue)
        for stamp in queue:  # the loop body appends to the queue
            if stamp in self._depends_on:
                stamps = [self._find_replacement(other) for other in self._depends_on[stamp]]
                self._depends_on[stamp] = stamps
                queue.extend(
                    other
                    for other in dict.fromkeys(stamps)
                    if (other >= self._blind or other == IMPORTED) and other not in visited
                )
                visited.update(stamps)
        return queue
