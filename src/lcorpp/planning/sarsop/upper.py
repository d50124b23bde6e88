"""The upper bound: the fast informed bound, lowered by points with the sawtooth interpolation.

Source: Hauskrecht, JAIR 2000, section 4.4; Smith and Simmons, UAI 2005, section 4.2 (sawtooth).
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt

from lcorpp.values import Array, Belief

_Kind = TypeVar("_Kind", bound=np.generic)

_BLOCK = 1 << 21
"""Numbers worked on at once (16 MB): large enough for numpy, small enough for memory."""


class Sawtooth:
    """An upper bound on the value, positively homogeneous: it may be asked at unnormalised beliefs.

    At b it is the least of max over a of Q(a).b and of corners.b + phi(b) (v - corners.p) over the points
    (p, v), phi = min over the support of p of b(s) / p(s); phi is 0 where p's support is not inside b's.
    """

    def __init__(self, informed: Array) -> None:
        """`informed`: (A, S) Q values above the truth."""
        self.informed = informed
        self.corners = informed.max(axis=0)
        self.count = 0
        self.next_stamp = 0
        self._values = np.empty(0)
        self._stamps = np.empty(0, dtype=np.intp)
        # the points' entries end to end: state, 1 / p(s) and where each point begins
        self._begins = np.zeros(1, dtype=np.intp)
        self._indices = np.empty(0, dtype=np.intp)
        self._inverses = np.empty(0)
        self._excess = np.empty(0)

    def add(self, belief: Belief, value: float) -> int:
        """Lower the bound at a belief (S,) to `value`; the new point's stamp, -1 where a corner took it."""
        support = np.flatnonzero(belief)
        if len(support) == 1:
            self.corners = self.corners.copy()
            self.corners[support[0]] = min(self.corners[support[0]], value)
            self._refresh_excess()
            return -1
        begin = int(self._begins[self.count])
        end = begin + len(support)
        self._grow(end)
        self._indices[begin:end] = support
        self._inverses[begin:end] = 1.0 / belief[support]
        self._values[self.count] = value
        self._excess[self.count] = min(0.0, value - float(belief @ self.corners))
        self._stamps[self.count] = self.next_stamp
        self._begins[self.count + 1] = end
        # counted last: an interrupt before this line leaves the set as it was
        self.next_stamp += 1
        self.count += 1
        return self.next_stamp - 1

    def drop(self, stamps: set[int]) -> None:
        """Forget points by their stamps; nodes keep the bounds these points gave them."""
        alive = [i for i in range(self.count) if int(self._stamps[i]) not in stamps]
        begins, ends = self._begins[:-1][alive], self._begins[1:][alive]
        entries = [np.arange(b, e) for b, e in zip(begins.tolist(), ends.tolist(), strict=True)]
        chosen = np.concatenate([np.empty(0, dtype=np.intp), *entries])
        joined = np.concatenate([[0], np.cumsum(ends - begins)]).astype(np.intp)
        kept = self._values[alive], self._excess[alive], self._stamps[alive]
        entries_kept = self._indices[chosen], self._inverses[chosen]
        # all is computed before anything is replaced: an interrupt is unlikely to fall in between
        self._indices, self._inverses = entries_kept
        self._values, self._excess, self._stamps = kept
        self._begins, self.count = joined, len(alive)

    def value(self, belief: Belief) -> float:
        """The bound at a belief (S,)."""
        return float(self.bound(belief[None, :])[0])

    def bound(self, beliefs: Array, since: int = 0) -> Array:
        """(n,) the bound at beliefs (n, S), using the points whose stamp is at least `since`."""
        informed = (beliefs @ self.informed.T).max(axis=1)
        corners = beliefs @ self.corners
        return np.asarray(np.minimum(informed, corners + self._lowering(beliefs, since)))

    def _lowering(self, beliefs: Array, since: int) -> Array:
        """(n,) the most that any point lowers the corners' plane, not above 0."""
        lowest = np.zeros(len(beliefs))
        first = int(np.searchsorted(self._stamps[: self.count], since))
        while first < self.count:
            begin = int(self._begins[first])
            room = begin + max(1, _BLOCK // len(beliefs))
            last = max(
                first + 1, int(np.searchsorted(self._begins[: self.count + 1], room, side="right")) - 1
            )
            end = int(self._begins[last])
            ratios = beliefs[:, self._indices[begin:end]] * self._inverses[begin:end]
            phi = np.minimum.reduceat(ratios, self._begins[first:last] - begin, axis=1)
            np.minimum(lowest, (phi * self._excess[first:last]).min(axis=1), out=lowest)
            first = last
        return lowest

    def _refresh_excess(self) -> None:
        """A corner fell: each point lies less below the corners' plane."""
        n = self.count
        if n:
            end = int(self._begins[n])
            weighed = self.corners[self._indices[:end]] / self._inverses[:end]
            plane = np.add.reduceat(weighed, self._begins[:n])
            self._excess[:n] = np.minimum(0.0, self._values[:n] - plane)

    def _grow(self, entries: int) -> None:
        """Make room for one more point and for `entries` entries."""
        if entries > len(self._indices):
            self._indices = _room(self._indices, entries)
            self._inverses = _room(self._inverses, entries)
        if self.count + 1 > len(self._values):
            self._values = _room(self._values, self.count + 1)
            self._excess = _room(self._excess, self.count + 1)
            self._stamps = _room(self._stamps, self.count + 1)
        if self.count + 2 > len(self._begins):
            self._begins = _room(self._begins, self.count + 2)


def _room(array: npt.NDArray[_Kind], needed: int) -> npt.NDArray[_Kind]:
    """A longer array that begins with `array`; its length doubles so that appending stays cheap."""
    longer = np.zeros(max(needed, 2 * len(array), 64), dtype=array.dtype)
    longer[: len(array)] = array
    return longer
