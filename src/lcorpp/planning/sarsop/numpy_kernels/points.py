"""The points of one group: beliefs at which the upper bound was found to be lower."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt

from lcorpp.planning.belief import MIN_PROBABILITY
from lcorpp.planning.sarsop.numpy_kernels.model import Indices, ranges
from lcorpp.values import Array

_Kind = TypeVar("_Kind", bound=np.generic)

_BLOCK = 1 << 21
"""Numbers worked on at once (16 MB): large enough for numpy, small enough for memory."""


class Points:
    """Points (p, v) of one group by rising stamp, their entries end to end.

    stamps, values, excess: (K,) excess is v - corners.p, what a point lowers the corners' plane by; 0 for one
    that was retired. begins: (K + 1,) where the entries of each begin. places, weights: (entries,).
    """

    def __init__(self, size: int) -> None:
        self.count = 0
        self._stamps = np.empty(0, dtype=np.int64)
        self._values, self._excess = np.empty(0), np.empty(0)
        self._begins = np.zeros(1, dtype=np.intp)
        self._places, self._weights = np.empty(0, dtype=np.intp), np.empty(0)
        self._rarest = np.empty(0, dtype=np.intp)
        self._having = np.zeros(size, dtype=np.intp)

    @property
    def alive(self) -> Indices:
        """The numbers of the points that were not retired."""
        return np.flatnonzero(~np.isnan(self._values[: self.count]))

    def point(self, number: int) -> tuple[int, Indices, Array, float]:
        """Stamp, places, weights and value of a point."""
        part = slice(int(self._begins[number]), int(self._begins[number + 1]))
        return int(self._stamps[number]), self._places[part], self._weights[part], float(self._values[number])

    def add(self, places: Indices, weights: Array, value: float, corners: Array, stamp: int) -> None:
        """A point at a belief: weights (n,) over places (n,); its stamp is above all others."""
        k, begin = self.count, int(self._begins[self.count])
        end = begin + len(places)
        self._grow(end)
        self._having[places] += 1
        self._places[begin:end], self._weights[begin:end] = places, weights
        self._values[k], self._stamps[k], self._begins[k + 1] = value, stamp, end
        self._excess[k] = min(0.0, value - float(weights @ corners[places]))
        # A point counts only where all its states are possible: the rarest decides soonest.
        self._rarest[k] = places[self._having[places].argmin()]
        self.count += 1  # last: an interrupt before this line leaves the set as it was

    def retire(self, stamp: int) -> bool:
        """Take out the point with a stamp; whether there was one. Its entries go at the next `compact`."""
        k = int(np.searchsorted(self._stamps[: self.count], stamp))
        if k == self.count or self._stamps[k] != stamp or np.isnan(self._values[k]):
            return False
        self._values[k], self._excess[k] = np.nan, 0.0
        return True

    def refresh(self, corners: Array) -> None:
        """Work out the excess anew: a corner fell."""
        if not self.count:
            return
        entries = slice(int(self._begins[self.count]))
        planes = np.add.reduceat(
            corners[self._places[entries]] * self._weights[entries], self._begins[: self.count]
        )
        excess = np.minimum(0.0, self._values[: self.count] - planes)
        self._excess[: self.count] = np.where(np.isnan(excess), 0.0, excess)

    def lowering(self, beliefs: Array, since: int) -> Array:
        """(m,) the most that any point lowers the plane at beliefs (m, size), not above 0.

        A point lowers it by phi (v - corners.p), phi = min over the support of p of b(s) / p(s). Only points
        whose stamp is at least `since` are asked.
        """
        lowest = np.zeros(len(beliefs))
        first = int(np.searchsorted(self._stamps[: self.count], since))
        possible = np.asarray((beliefs > 0).any(axis=0))
        useful = possible[self._rarest[first : self.count]] & (self._excess[first : self.count] < 0)
        asked = first + np.flatnonzero(useful)
        if not len(asked):
            return lowest
        work = np.cumsum(self._begins[asked + 1] - self._begins[asked]) * len(beliefs)
        for part in np.split(asked, np.flatnonzero(np.diff(work // _BLOCK)) + 1):
            begins, ends = self._begins[part], self._begins[part + 1]
            index, _ = ranges(begins, ends)
            ratios = beliefs[:, self._places[index]] / np.maximum(self._weights[index], MIN_PROBABILITY)
            phi = np.minimum.reduceat(ratios, np.cumsum(ends - begins) - (ends - begins), axis=1)
            np.minimum(lowest, (phi * self._excess[part]).min(axis=1), out=lowest)
        return lowest

    def compact(self) -> None:
        """Forget the entries of points that were retired."""
        alive = self.alive
        index, owner = ranges(self._begins[alive], self._begins[alive + 1])
        begins = np.searchsorted(owner, np.arange(len(alive) + 1))
        stamps, values, excess = self._stamps[alive], self._values[alive], self._excess[alive]
        places, weights, rarest = self._places[index], self._weights[index], self._rarest[alive]
        having = np.bincount(places, minlength=len(self._having))
        # all is worked out before anything is replaced
        self._stamps, self._values, self._excess, self._rarest = stamps, values, excess, rarest
        self._begins, self._places, self._weights, self._having = begins, places, weights, having
        self.count = len(alive)

    def _grow(self, entries: int) -> None:
        """Make room for one more point and for `entries` entries."""
        self._places, self._weights = _room(self._places, entries), _room(self._weights, entries)
        self._values, self._excess = _room(self._values, self.count + 1), _room(self._excess, self.count + 1)
        self._stamps, self._rarest = _room(self._stamps, self.count + 1), _room(self._rarest, self.count + 1)
        self._begins = _room(self._begins, self.count + 2)


def _room(array: npt.NDArray[_Kind], needed: int) -> npt.NDArray[_Kind]:
    """The array where it is long enough, else a longer one that begins with it; lengths double."""
    if needed <= len(array):
        return array
    longer = np.zeros(max(needed, 2 * len(array), 8), dtype=array.dtype)
    longer[: len(array)] = array
    return longer
