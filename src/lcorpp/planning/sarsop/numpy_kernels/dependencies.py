"""Which vectors each alpha vector was made from: what a policy needs to earn what its vectors promise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcorpp.planning.sarsop.numpy_kernels.alpha_vectors import VectorSet
from lcorpp.values import Array

FOREIGN = -1
"""Stands for all vectors that were taken over: one of them may go on with any other."""


@dataclass(frozen=True, eq=False)
class Retired:
    """A vector (n,) that no search asks any more, over the states of a group."""

    group: int
    action: int
    values: Array


class Origins:
    """Vectors by their stamps, those they go on with, and what became of the pruned ones.

    A vector promises a value because it goes on with others. Where one of those is pruned, another that is
    worth as much in every state takes its place; where there is none it is kept here, out of the search's
    way, until no vector needs it any more.
    """

    def __init__(self, blind: int) -> None:
        """blind: vectors with stamps below go on with themselves and are never pruned."""
        self._blind = blind
        self._from: dict[int, list[int]] = {}
        self._instead: dict[int, int] = {}  # what took the place of a pruned vector
        self._retired: dict[int, Retired] = {}

    def note(self, made: int, origins: Sequence[int]) -> None:
        """A new vector and those it goes on with."""
        self._from[made] = sorted({stamp for stamp in origins if stamp >= self._blind})

    def note_foreign(self, made: int) -> None:
        """One that was taken over from elsewhere."""
        self._from.setdefault(FOREIGN, []).append(made)
        self._from[made] = [FOREIGN]

    def retire(self, vectors: VectorSet, group: int, kept: npt.NDArray[np.bool_], slack: float) -> None:
        """Called before a set drops the vectors whose entry in `kept` is false. Up to `slack` is rounding."""
        staying = np.flatnonzero(kept)
        for row in np.flatnonzero(~kept).tolist():
            stamp, values = int(vectors.stamps[row]), vectors.table[:, row]
            above = (vectors.table[:, staying] >= values[:, None] - slack).all(axis=0)
            if above.any():
                self._instead[stamp] = int(vectors.stamps[staying[above.argmax()]])
            else:
                self._retired[stamp] = Retired(group, int(vectors.actions[row]), values.copy())

    def collect(self, sets: Sequence[VectorSet]) -> None:
        """Forget what the vectors in the sets do not go on with."""
        found = self._reached(sets)  # after which nothing asks `_instead` any more
        self._from = {stamp: self._from[stamp] for stamp in found if stamp in self._from}
        self._retired = {stamp: self._retired[stamp] for stamp in found if stamp in self._retired}
        self._instead = {}

    def needed(self, sets: Sequence[VectorSet]) -> list[Retired]:
        """The pruned vectors that those in the sets go on with, by rising stamps."""
        found = sorted(self._reached(sets))
        return [self._retired[stamp] for stamp in found if stamp in self._retired]

    def _standing_for(self, stamp: int) -> int:
        while stamp in self._instead:
            stamp = self._instead[stamp]
        return stamp

    def _reached(self, sets: Sequence[VectorSet]) -> list[int]:
        """The stamps of all vectors that those in the sets go on with, now or later, and of themselves."""
        found = [stamp for vectors in sets for stamp in vectors.stamps.tolist() if stamp >= self._blind]
        met = set(found)
        for stamp in found:  # which grows while it is read
            if stamp in self._from:
                self._from[stamp] = origins = [self._standing_for(origin) for origin in self._from[stamp]]
                found.extend(new for new in dict.fromkeys(origins) if self._counts(new) and new not in met)
                met.update(origins)
        return found

    def _counts(self, stamp: int) -> bool:
        return stamp >= self._blind or stamp == FOREIGN
