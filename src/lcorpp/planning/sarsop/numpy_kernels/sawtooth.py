"""The upper bound: the fast informed bound and the sawtooth interpolation of points.

Source: Hauskrecht, JAIR 2000, section 4.4; Smith and Simmons, UAI 2005, section 4.2.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt

from lcorpp.planning.belief import MIN_PROBABILITY
from lcorpp.planning.sarsop.numpy_kernels.model import BeliefBatch, Indices, Model, concatenate_ranges
from lcorpp.values import Array

_Kind = TypeVar("_Kind", bound=np.generic)

CHUNK_SIZE = 1 << 21
"""Numbers processed at once (16 MB): large enough for numpy, small enough for memory."""

COMPACTION_MARGIN = 96
"""Memory is released if three times the number of removed points exceeds that of others by more than this."""


class Points:
    """K points (p, v) of one group: the upper bound at belief p is at most v.

    A stamp numbers changes of the bound: it identifies a point and increases with every point added. The
    points lie in the order of their stamps. The entries of a point are the states of the support of p, as
    positions in the group, with their weights p(s); the entries of all points are concatenated.

    Private arrays, longer than needed: the first `count` = K numbers are used, and the entries before
    _begins[K].
    _stamps: (K,). _values: (K,) v, NaN for a removed point.
    _excess: (K,) v - corners.p, not above 0; 0 for a removed point.
    _begins: (K + 1,) index of the first entry of each point. _positions, _weights: (entries,).
    _rarest: (K,) the position in the support of p that the fewest points contained when p was added.
    _counts: (size,) number of points that contain each position.
    """

    def __init__(self, size: int) -> None:
        """
        Args:
            size: the number of states of the group.
        """
        self.count = 0
        self._stamps = np.empty(0, dtype=np.int64)
        self._values, self._excess = np.empty(0), np.empty(0)
        self._begins = np.zeros(1, dtype=np.intp)
        self._positions, self._weights = np.empty(0, dtype=np.intp), np.empty(0)
        self._rarest = np.empty(0, dtype=np.intp)
        self._counts = np.zeros(size, dtype=np.intp)

    @property
    def alive(self) -> Indices:
        """Indices of the points that were not removed."""
        return np.flatnonzero(~np.isnan(self._values[: self.count]))

    def get_point(self, k: int) -> tuple[int, Indices, Array, float]:
        """Return the stamp, the positions (n,), the weights (n,) and the value of point k."""
        part = slice(int(self._begins[k]), int(self._begins[k + 1]))
        return int(self._stamps[k]), self._positions[part], self._weights[part], float(self._values[k])

    def add(self, positions: Indices, weights: Array, value: float, corners: Array, stamp: int) -> None:
        """Append a point with weights (n,) at positions (n,); its stamp is larger than all others.

        Args:
            corners: (size,) the bound at the corners of the group.
        """
        k, begin = self.count, int(self._begins[self.count])
        end = begin + len(positions)
        self._grow(end)
        self._counts[positions] += 1
        self._positions[begin:end], self._weights[begin:end] = positions, weights
        self._values[k], self._stamps[k], self._begins[k + 1] = value, stamp, end
        self._excess[k] = min(0.0, value - float(weights @ corners[positions]))
        # a point counts only if all its states are possible: the rarest state excludes most beliefs
        self._rarest[k] = positions[self._counts[positions].argmin()]
        self.count += 1  # last, so that an interrupt before this line leaves the set unchanged

    def remove(self, stamp: int) -> bool:
        """Remove the point with a stamp; return whether there was one. `compact` releases its memory."""
        k = int(np.searchsorted(self._stamps[: self.count], stamp))
        if k == self.count or self._stamps[k] != stamp or np.isnan(self._values[k]):
            return False
        self._values[k], self._excess[k] = np.nan, 0.0
        return True

    def refresh(self, corners: Array) -> None:
        """Recompute the excess of all points after a corner (size,) was lowered."""
        if not self.count:
            return
        entries = slice(int(self._begins[self.count]))
        planes = np.add.reduceat(
            corners[self._positions[entries]] * self._weights[entries], self._begins[: self.count]
        )
        excess = np.minimum(0.0, self._values[: self.count] - planes)
        self._excess[: self.count] = np.where(np.isnan(excess), 0.0, excess)

    def compute_correction(self, beliefs: Array, since: int) -> Array:
        """Return (m,) the minimum over the points of phi (v - corners.p) at beliefs (m, size), at most 0.

        phi = min over the support of p of b(s) / p(s). Only points whose stamp is at least `since` count.
        """
        lowest = np.zeros(len(beliefs))
        first = int(np.searchsorted(self._stamps[: self.count], since))
        possible = np.asarray((beliefs > 0).any(axis=0))
        useful = possible[self._rarest[first : self.count]] & (self._excess[first : self.count] < 0)
        relevant = first + np.flatnonzero(useful)
        if not len(relevant):
            return lowest
        work = np.cumsum(self._begins[relevant + 1] - self._begins[relevant]) * len(beliefs)
        for part in np.split(relevant, np.flatnonzero(np.diff(work // CHUNK_SIZE)) + 1):
            begins, ends = self._begins[part], self._begins[part + 1]
            index, _ = concatenate_ranges(begins, ends)
            ratios = beliefs[:, self._positions[index]] / np.maximum(self._weights[index], MIN_PROBABILITY)
            phi = np.minimum.reduceat(ratios, np.cumsum(ends - begins) - (ends - begins), axis=1)
            np.minimum(lowest, (phi * self._excess[part]).min(axis=1), out=lowest)
        return lowest

    def compact(self) -> None:
        """Release the memory of removed points."""
        alive = self.alive
        index, owner = concatenate_ranges(self._begins[alive], self._begins[alive + 1])
        begins = np.searchsorted(owner, np.arange(len(alive) + 1))
        stamps, values, excess = self._stamps[alive], self._values[alive], self._excess[alive]
        positions, weights, rarest = self._positions[index], self._weights[index], self._rarest[alive]
        counts = np.bincount(positions, minlength=len(self._counts))
        # replace the arrays only now, so that an interrupt leaves the points unchanged
        self._stamps, self._values, self._excess, self._rarest = stamps, values, excess, rarest
        self._begins, self._positions, self._weights, self._counts = begins, positions, weights, counts
        self.count = len(alive)

    def _grow(self, entries: int) -> None:
        """Enlarge the arrays for one more point and for `entries` entries."""
        self._positions, self._weights = _enlarge(self._positions, entries), _enlarge(self._weights, entries)
        self._values, self._excess = (
            _enlarge(self._values, self.count + 1),
            _enlarge(self._excess, self.count + 1),
        )
        self._stamps, self._rarest = (
            _enlarge(self._stamps, self.count + 1),
            _enlarge(self._rarest, self.count + 1),
        )
        self._begins = _enlarge(self._begins, self.count + 2)


class Sawtooth:
    """An upper bound on the value, positively homogeneous: arguments are beliefs times a probability.

    bound(b) = min(max over a of Q(a).b, corners.b + min over the points (p, v) of phi(b, p) (v - corners.p)),
    with phi(b, p) = min over the support of p of b(s) / p(s), which is 0 if b does not contain the support of
    p. A point counts only at beliefs of its own group.

    corners: (S,) the bound at each corner of the belief simplex, where the state is known.
    next_stamp: the stamp of the next point. count: the number of points.
    """

    def __init__(self, model: Model, informed: Array) -> None:
        """
        Args:
            informed: (A, S) the fast informed bound: upper bounds on the Q values.
        """
        self.model = model
        self.corners: Array = informed.max(axis=0)
        self.next_stamp = 0
        self.count = self._removed = 0
        self._informed = np.ascontiguousarray(informed.T)
        self._groups: dict[int, Points] = {}

    def compute_informed_values(self, beliefs: BeliefBatch) -> Array:
        """Return (m, A) the upper bounds on the Q values at m beliefs, by the fast informed bound."""
        return np.asarray(beliefs.weights @ self._informed[beliefs.states])

    def compute_bound(self, beliefs: BeliefBatch, since: int = 0) -> Array:
        """Return (m,) the bound at m beliefs, by the points whose stamp is at least `since`."""
        informed = self.compute_informed_values(beliefs).max(axis=1)
        plane = beliefs.weights @ self.corners[beliefs.states]
        points = self._groups.get(beliefs.group)
        if points is None:
            return np.asarray(np.minimum(informed, plane))
        dense = np.zeros((len(beliefs.weights), len(self.model.group_states(beliefs.group))))
        dense[:, beliefs.positions] = beliefs.weights
        return np.asarray(np.minimum(informed, plane + points.compute_correction(dense, since)))

    def add(self, belief: BeliefBatch, value: float) -> int:
        """Lower the bound at one belief; return the stamp of the new point, -1 if the belief is a corner."""
        if len(belief.states) == 1:
            self._lower_corner(int(belief.states[0]), value / float(belief.weights[0, 0]))
            return -1
        points = self._groups.get(belief.group)
        if points is None:
            points = self._groups[belief.group] = Points(len(self.model.group_states(belief.group)))
        stamp = self.next_stamp
        corners = self.corners[self.model.group_states(belief.group)]
        points.add(belief.positions, belief.weights[0], value, corners, stamp)
        self.next_stamp, self.count = stamp + 1, self.count + 1
        return stamp

    def remove(self, group: int, stamp: int) -> None:
        """Remove a point that a newer one at the same belief has replaced."""
        if self._groups[group].remove(stamp):
            self._removed, self.count = self._removed + 1, self.count - 1

    def compact(self) -> None:
        """Release the memory of removed points if there are many."""
        if 3 * self._removed > self.count + COMPACTION_MARGIN:
            for points in self._groups.values():
                points.compact()
            self._removed = 0

    def export_points(
        self,
    ) -> tuple[Array, npt.NDArray[np.int64], npt.NDArray[np.int32], Array, Array]:
        """Return the corners (S,), and the points by rising stamp: begins (K + 1,), states and weights
        (entries,), values (K,)."""
        by_stamp = [
            (stamp, self.model.group_states(group)[positions], weights, value)
            for group, points in self._groups.items()
            for stamp, positions, weights, value in map(points.get_point, points.alive.tolist())
        ]
        by_stamp.sort(key=lambda point: point[0])
        begins = np.cumsum([0, *(len(states) for _, states, _, _ in by_stamp)])
        return (
            self.corners.copy(),
            begins.astype(np.int64),
            np.concatenate([np.empty(0), *(states for _, states, _, _ in by_stamp)]).astype(np.int32),
            np.concatenate([np.empty(0), *(weights for _, _, weights, _ in by_stamp)]),
            np.array([value for _, _, _, value in by_stamp], dtype=np.float64),
        )

    def _lower_corner(self, state: int, value: float) -> None:
        if value >= self.corners[state]:
            return
        self.corners[state] = value
        for group in (int(self.model.block[state]), len(self.model.members)):
            if group in self._groups:
                self._groups[group].refresh(self.corners[self.model.group_states(group)])
        self.next_stamp += 1  # bounds computed earlier may be lower now


def _enlarge(array: npt.NDArray[_Kind], needed: int) -> npt.NDArray[_Kind]:
    """Return the array if it is long enough, otherwise a copy of at least double length."""
    if needed <= len(array):
        return array
    longer = np.zeros(max(needed, 2 * len(array), 8), dtype=array.dtype)
    longer[: len(array)] = array
    return longer
