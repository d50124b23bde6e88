"""The upper bound: the fast informed bound, lowered by points with the sawtooth interpolation.

Source: Hauskrecht, JAIR 2000, section 4.4; Smith and Simmons, UAI 2005, section 4.2.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lcorpp.planning.sarsop.numpy_kernels.model import Beliefs, Model
from lcorpp.planning.sarsop.numpy_kernels.points import Points
from lcorpp.values import Array


class Sawtooth:
    """An upper bound on the value, positively homogeneous: it may be asked at beliefs times a probability.

    At b it is the least of max over a of Q(a).b and of corners.b + phi(b) (v - corners.p) over the points
    (p, v), phi = min over the support of p of b(s) / p(s); phi is 0 where p's support is not inside b's.
    A point is found only by those who ask for its group.
    """

    def __init__(self, model: Model, informed: Array) -> None:
        """`informed`: (A, S) Q values above the truth."""
        self.model = model
        self.corners: Array = informed.max(axis=0)
        self.next_stamp = 0
        self.count = self.retired = 0
        self._informed = np.ascontiguousarray(informed.T)
        self._groups: dict[int, Points] = {}

    def informed(self, beliefs: Beliefs) -> Array:
        """(m, A) the informed Q values at m beliefs."""
        return np.asarray(beliefs.weights @ self._informed[beliefs.states])

    def bound(self, beliefs: Beliefs, since: int = 0) -> Array:
        """(m,) the bound at m beliefs, using the points whose stamp is at least `since`."""
        informed = self.informed(beliefs).max(axis=1)
        plane = beliefs.weights @ self.corners[beliefs.states]
        points = self._groups.get(beliefs.group)
        if points is None:
            return np.asarray(np.minimum(informed, plane))
        dense = np.zeros((len(beliefs.weights), len(self.model.states_of(beliefs.group))))
        dense[:, beliefs.places] = beliefs.weights
        return np.asarray(np.minimum(informed, plane + points.lowering(dense, since)))

    def add(self, belief: Beliefs, value: float) -> int:
        """Lower the bound at a belief (1, n) to `value`; the new point's stamp, -1 where a corner took it."""
        if len(belief.states) == 1:
            self._lower_corner(int(belief.states[0]), value / float(belief.weights[0, 0]))
            return -1
        points = self._groups.get(belief.group)
        if points is None:
            points = self._groups[belief.group] = Points(len(self.model.states_of(belief.group)))
        stamp = self.next_stamp
        corners = self.corners[self.model.states_of(belief.group)]
        points.add(belief.places, belief.weights[0], value, corners, stamp)
        self.next_stamp, self.count = stamp + 1, self.count + 1
        return stamp

    def retire(self, group: int, stamp: int) -> None:
        """Take out a point that another at the same belief has replaced."""
        if self._groups[group].retire(stamp):
            self.retired, self.count = self.retired + 1, self.count - 1

    def compact(self) -> None:
        """Forget the points that were retired, if they are many."""
        if 3 * self.retired > self.count + 96:
            for points in self._groups.values():
                points.compact()
            self.retired = 0

    def points(
        self,
    ) -> tuple[Array, npt.NDArray[np.int64], npt.NDArray[np.int32], Array, Array]:
        """Corners (S,), and of the points, by rising stamp, begins (K + 1,), states, weights, values (K,)."""
        found = [
            (stamp, self.model.states_of(group)[places], weights, value)
            for group, points in self._groups.items()
            for stamp, places, weights, value in map(points.point, points.alive.tolist())
        ]
        found.sort(key=lambda point: point[0])
        begins = np.cumsum([0, *(len(states) for _, states, _, _ in found)])
        return (
            self.corners.copy(),
            begins.astype(np.int64),
            np.concatenate([np.empty(0), *(states for _, states, _, _ in found)]).astype(np.int32),
            np.concatenate([np.empty(0), *(weights for _, _, weights, _ in found)]),
            np.array([value for _, _, _, value in found], dtype=np.float64),
        )

    def _lower_corner(self, state: int, value: float) -> None:
        if value >= self.corners[state]:
            return
        self.corners[state] = value
        for group in (int(self.model.block[state]), len(self.model.members)):
            if group in self._groups:
                self._groups[group].refresh(self.corners[self.model.states_of(group)])
        self.next_stamp += 1  # a bound that was asked before may be lower now
