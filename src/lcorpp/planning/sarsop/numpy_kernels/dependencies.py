"""The vectors that each alpha vector depends on: a policy needs them to earn what its vectors promise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lcorpp.planning.sarsop.numpy_kernels.alpha_vectors import VectorSet
from lcorpp.values import Array

EDGE_SIZE = 24
"""Memory of an edge in bytes: three numbers."""

IMPORTED = -1
"""Stands for all imported vectors: each of them may depend on any other."""


@dataclass(frozen=True)
class Edge:
    """After an observation, the plan of a vector continues with a vector of the group of the next belief."""

    observation: int
    group: int
    vector: int


@dataclass(frozen=True, eq=False)
class PrunedVector:
    """A pruned vector (n,) that others depend on, over the states of a group; the search does not use it."""

    stamp: int
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
        self._edges: dict[int, list[Edge]] = {}
        self._replaced_by: dict[int, int] = {}
        self._pruned: dict[int, PrunedVector] = {}

    @property
    def memory_size(self) -> int:
        """Memory of the pruned vectors and dependencies in bytes."""
        pruned = sum(vector.values.nbytes for vector in self._pruned.values())
        return pruned + EDGE_SIZE * sum(map(len, self._edges.values()))

    @property
    def has_imported(self) -> bool:
        """Whether vectors were imported from another search."""
        return IMPORTED in self._edges

    def record(self, vector: int, edges: Sequence[Edge]) -> None:
        """Record a new vector and those it depends on, one for each observation its states may lead to."""
        self._edges[vector] = list(edges)

    def record_imported_vector(self, vector: int) -> None:
        """Record a vector that was imported from another search."""
        self._edges.setdefault(IMPORTED, []).append(Edge(-1, -1, vector))
        self._edges[vector] = [Edge(-1, -1, IMPORTED)]

    def record_pruned_vector(self, pruned: PrunedVector) -> None:
        """Record a pruned vector."""
        self._pruned[pruned.stamp] = pruned

    def record_pruned_vectors(
        self, vectors: VectorSet, group: int, kept: npt.NDArray[np.bool_], slack: float
    ) -> None:
        """Record the vectors whose entry in `kept` is false, before the set drops them.

        `remove_unneeded` must follow.

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
                self._pruned[stamp] = PrunedVector(stamp, group, int(vectors.actions[column]), values.copy())

    def remove_unneeded(self, sets: Sequence[VectorSet]) -> None:
        """Remove all vectors that the vectors in the sets do not depend on."""
        needed = self._find_needed_stamps(sets)  # it resolves all replacements
        self._edges = {stamp: self._edges[stamp] for stamp in needed if stamp in self._edges}
        self._pruned = {stamp: self._pruned[stamp] for stamp in needed if stamp in self._pruned}
        self._replaced_by = {}

    def clear(self) -> None:
        """Remove all vectors."""
        self._edges, self._pruned, self._replaced_by = {}, {}, {}

    def edges(self, vector: int) -> list[Edge]:
        """Return the edges of a vector that is neither blind nor imported."""
        return self._edges[vector]

    def pruned(self) -> list[PrunedVector]:
        """Return the pruned vectors by rising stamps."""
        return [vector for _, vector in sorted(self._pruned.items())]

    def _find_replacement(self, stamp: int) -> int:
        while stamp in self._replaced_by:
            stamp = self._replaced_by[stamp]
        return stamp

    def _find_needed_stamps(self, sets: Sequence[VectorSet]) -> list[int]:
        """Return the stamps of the vectors in the sets and of all vectors they depend on, directly or not."""
        queue = [stamp for vectors in sets for stamp in vectors.stamps.tolist() if stamp >= self._blind]
        visited = set(queue)
        for stamp in queue:  # the loop body appends to the queue
            edges = [replace(e, vector=self._find_replacement(e.vector)) for e in self._edges.get(stamp, ())]
            if edges:
                self._edges[stamp] = edges
            for vector in dict.fromkeys(edge.vector for edge in edges):
                if (vector >= self._blind or vector == IMPORTED) and vector not in visited:
                    queue.append(vector)
                    visited.add(vector)
        return queue
