"""The upper bound: the fast informed bound and the sawtooth interpolation of points.

Source: Hauskrecht, JAIR 2000, section 4.4; Smith and Simmons, UAI 2005, section 4.2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from lcorpp.planning.belief import MIN_PROBABILITY
from lcorpp.planning.sarsop.kernel_protocols import PointArrays
from lcorpp.planning.sarsop.numpy_kernels.model import BeliefBatch, Model
from lcorpp.planning.sparse import ragged_indices
from lcorpp.values import Array, Indices

CHUNK_SIZE = 1 << 21
"""Numbers processed at once (16 MB): large enough for numpy, small enough for memory."""

COMPACTION_MARGIN = 96
"""Memory is released if three times the number of removed points exceeds that of others by more than this."""


@dataclass(frozen=True, eq=False)
class Points:
    """K points (p, v) of one group: the upper bound at belief p is at most v.

    A stamp numbers changes of the bound: it identifies a point and increases with every point added. The
    entries of a point are the states of the support of p, as positions in the group, with their weights p(s);
    the entries of all points are concatenated.

    stamps: (K,) rising. values: (K,) v, NaN for a removed point.
    excess: (K,) v - corners.p, not above 0; 0 for a removed point.
    begins: (K + 1,) index of the first entry of each point. positions, weights: (entries,).
    rarest: (K,) the position in the support of p that the fewest points contained when p was added.
    counts: (size,) number of points, removed ones included, that contain each position of the group.
    """

    stamps: npt.NDArray[np.int64]
    values: Array
    excess: Array
    begins: Indices
    positions: Indices
    weights: Array
    rarest: Indices
    counts: Indices

    @classmethod
    def empty(cls, size: int) -> Points:
        """Return no points, of a group of `size` states."""
        stamps, numbers, indices = np.empty(0, np.int64), np.empty(0), np.empty(0, np.intp)
        begins, counts = np.zeros(1, np.intp), np.zeros(size, np.intp)
        return cls(stamps, numbers, numbers, begins, indices, numbers, indices, counts)

    @property
    def alive(self) -> Indices:
        """Indices of the points that were not removed."""
        return np.flatnonzero(~np.isnan(self.values))

    def get_point(self, k: int) -> tuple[int, Indices, Array, float]:
        """Return the stamp, the positions (n,), the weights (n,) and the value of point k."""
        part = slice(int(self.begins[k]), int(self.begins[k + 1]))
        return int(self.stamps[k]), self.positions[part], self.weights[part], float(self.values[k])

    def append(self, positions: Indices, weights: Array, value: float, corners: Array, stamp: int) -> Points:
        """Return the points and one more, for the bound at the corners (size,) of the group."""
        counts = self.counts.copy()
        counts[positions] += 1
        return Points(
            stamps=np.append(self.stamps, stamp),
            values=np.append(self.values, value),
            excess=np.append(self.excess, min(0.0, value - float(weights @ corners[positions]))),
            begins=np.append(self.begins, len(self.positions) + len(positions)),
            positions=np.concatenate([self.positions, positions]),
            weights=np.concatenate([self.weights, weights]),
            # a point counts only if all its states are possible: the rarest state excludes most beliefs
            rarest=np.append(self.rarest, positions[counts[positions].argmin()]),
            counts=counts,
        )

    def remove(self, stamp: int) -> bool:
        """Mark the point with a stamp as removed; return whether there was one."""
        k = int(np.searchsorted(self.stamps, stamp))
        if k == len(self.stamps) or self.stamps[k] != stamp or np.isnan(self.values[k]):
            return False
        self.values[k], self.excess[k] = np.nan, 0.0
        return True

    def lower_corners(self, corners: Array) -> Points:
        """Return the points with the excess for lowered corners (size,)."""
        if not len(self.stamps):
            return self
        planes = np.add.reduceat(corners[self.positions] * self.weights, self.begins[:-1])
        excess = np.minimum(0.0, self.values - planes)
        return replace(self, excess=np.where(np.isnan(excess), 0.0, excess))

    def compute_correction(self, beliefs: Array, since: int) -> Array:
        """Return (m,) the minimum over the points of phi (v - corners.p) at beliefs (m, size), at most 0.

        phi = min over the support of p of b(s) / p(s). Only points whose stamp is at least `since` count.
        """
        lowest = np.zeros(len(beliefs))
        first = int(np.searchsorted(self.stamps, since))
        possible = np.asarray((beliefs > 0).any(axis=0))
        relevant = first + np.flatnonzero(possible[self.rarest[first:]] & (self.excess[first:] < 0))
        if not len(relevant):
            return lowest
        # split the points into parts of about CHUNK_SIZE ratios
        work = np.cumsum(self.begins[relevant + 1] - self.begins[relevant]) * len(beliefs)
        for part in np.split(relevant, np.flatnonzero(np.diff(work // CHUNK_SIZE)) + 1):
            sizes = self.begins[part + 1] - self.begins[part]
            index = ragged_indices(self.begins[part], sizes)
            # a weight that is raised makes phi smaller, so the bound stays valid
            ratios = beliefs[:, self.positions[index]] / np.maximum(self.weights[index], MIN_PROBABILITY)
            phi = np.minimum.reduceat(ratios, np.cumsum(sizes) - sizes, axis=1)
            np.minimum(lowest, (phi * self.excess[part]).min(axis=1), out=lowest)
        return lowest

    def compact(self) -> Points:
        """Return the points without the removed ones."""
        alive = self.alive
        sizes = np.diff(self.begins)[alive]
        index = ragged_indices(self.begins[alive], sizes)
        positions = self.positions[index]
        return Points(
            stamps=self.stamps[alive],
            values=self.values[alive],
            excess=self.excess[alive],
            begins=np.concatenate([[0], np.cumsum(sizes)]),
            positions=positions,
            weights=self.weights[index],
            rarest=self.rarest[alive],
            counts=np.bincount(positions, minlength=len(self.counts)),
        )


class Sawtooth:
    """An upper bound on the value. It is positively homogeneous, so beliefs may be times a probability.

    bound(b) = min(max over a of Q(a).b, corners.b + min over the points (p, v) of phi(b, p) (v - corners.p)),
    with phi(b, p) = min over the support of p of b(s) / p(s), which is 0 if b does not contain the support of
    p. A point counts only at beliefs of its own group.

    corners: (S,) the bound at each corner of the belief simplex, where the state is known.
    next_stamp: the stamp of the next point or lowered corner. count: the number of points.
    """

    def __init__(self, model: Model, informed: Array) -> None:
        self.model = model
        self.corners: Array = informed.max(axis=0)
        self.next_stamp = 0
        self.count = self._removed = 0
        self._informed = np.ascontiguousarray(informed.T)
        self._groups: dict[int, Points] = {}

    @property
    def memory_size(self) -> int:
        """Memory of the points in bytes."""
        return sum(points.positions.nbytes + points.weights.nbytes for points in self._groups.values())

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
        stamp, corners = self.next_stamp, self.corners[self.model.group_states(belief.group)]
        points = self._groups.get(belief.group) or Points.empty(len(corners))
        self._groups[belief.group] = points.append(belief.positions, belief.weights[0], value, corners, stamp)
        self.next_stamp, self.count = stamp + 1, self.count + 1
        return stamp

    def remove(self, group: int, stamp: int) -> None:
        """Remove a point of a group. `compact` releases its memory."""
        if self._groups[group].remove(stamp):
            self._removed, self.count = self._removed + 1, self.count - 1

    def compact(self) -> None:
        """Release the memory of removed points if there are many."""
        if 3 * self._removed > self.count + COMPACTION_MARGIN:
            self._release_removed()

    def drop_older_half(self) -> None:
        """Remove the older half of the points: those that no backup has lowered for the longest time."""
        stamps = [
            (int(points.stamps[number]), group)
            for group, points in self._groups.items()
            for number in points.alive.tolist()
        ]
        for stamp, group in sorted(stamps)[: self.count // 2]:
            self.remove(group, stamp)
        self._release_removed()

    def _release_removed(self) -> None:
        self._groups = {group: points.compact() for group, points in self._groups.items()}
        self._removed = 0

    def export_points(self) -> tuple[Array, *PointArrays]:
        """Return the corners (S,) and the points by rising stamp."""
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
        for group in (int(self.model.block[state]), self.model.mixed_group):
            if group in self._groups:
                corners = self.corners[self.model.group_states(group)]
                self._groups[group] = self._groups[group].lower_corners(corners)
        self.next_stamp += 1  # bounds computed earlier may be lower now
