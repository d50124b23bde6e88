"""Regions of the best vectors on the beliefs over two or three states, with exact boundaries."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.belief import check_belief
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array, Belief, Indices

GRID = 120
"""Beliefs along a triangle's edge, of the grid on which the best vectors are determined."""

MIN_REGION = 1e-9
"""Regions below this share of the line or triangle are rounding errors."""


class Region(NamedTuple):
    """The beliefs at which one vector is best.

    vector: its row in `BeliefSlice.values`. action: index of its plan's first action.
    points: (2, 2) ends of an interval or (m, 3) vertices of a polygon, as weights of the slice's corners.
    """

    vector: int
    action: int
    points: Array


@dataclass(frozen=True, eq=False)
class BeliefSlice:
    """A policy on the mixtures of n corner beliefs: with weights w, vector k has the value values[k] @ w.

    states: (n,) indices of the varied states.
    share: total probability of these states.
    corners: (n, S) beliefs. values: (K, n), distinct rows. actions: (K,).
    """

    states: tuple[int, ...]
    share: float
    corners: Array
    values: Array
    actions: Indices

    def regions(self) -> list[Region]:
        """Return the region of each vector that is best at some belief; n is 2 or 3."""
        return _find_intervals(self) if len(self.states) == 2 else _find_polygons(self)

    def belief(self, weights: npt.ArrayLike) -> Belief:
        """Return (S,) the belief with weights (n,) of the corners."""
        return np.asarray(np.asarray(weights, dtype=np.float64) @ self.corners)

    def value(self, weights: Array) -> Array:
        """Return (m,) the policy's value at weights (m, n)."""
        return np.asarray((weights @ self.values.T).max(axis=1))


def slice_policy(
    pomdp: Pomdp, policy: Policy, states: Sequence[str], base: npt.ArrayLike | None = None
) -> BeliefSlice:
    """Restrict a policy to the beliefs over some states.

    Args:
        states: the names of two or three states.
        base: (S,) belief with the probabilities of the other states; only the remaining probability varies
            over `states`. When None the other states have probability 0.

    Raises:
        ModelError: a state is unknown or appears twice, their number is not 2 or 3, or `base` leaves no
            probability for `states`.
    """
    if len(states) not in (2, 3):
        raise ModelError(f"a figure of beliefs is over two or three states, not {len(states)}")
    chosen = tuple(pomdp.state_index(name) for name in states)
    if len(set(chosen)) < len(chosen):
        raise ModelError(f"the states of a figure must differ, not {', '.join(states)}")
    rest = np.zeros(len(pomdp.states))
    if base is not None:
        rest = check_belief(pomdp, base).copy()
    share = 1.0 if base is None else float(rest[list(chosen)].sum())
    if not share > 0:
        raise ModelError(
            f"the belief gives no probability to {' or '.join(states)}, the states of the figure"
        )
    rest[list(chosen)] = 0
    corners = np.tile(rest, (len(chosen), 1))
    corners[np.arange(len(chosen)), chosen] = share
    # the vector sets that cover all possible states; all sets if none does, as in `Policy`
    support = np.flatnonzero(corners.any(axis=0))
    sets = [part for part in policy.vector_sets if np.isin(support, part.states).all()] or policy.vector_sets
    values = np.concatenate([_compute_corner_values(part, policy.floor, corners) for part in sets])
    actions = np.concatenate([part.actions for part in sets])
    _, first = np.unique(values, axis=0, return_index=True)
    first.sort()  # the first of equal vectors, as in `Policy.action`
    return BeliefSlice(chosen, share, corners, values[first], actions[first])


def _compute_corner_values(part: AlphaVectors, floor: float, corners: Array) -> Array:
    """Return (K, n) the values of a set's vectors at the corners."""
    inside = corners[:, part.states]
    outside = np.maximum(0.0, corners.sum(axis=1) - inside.sum(axis=1))
    return np.asarray(part.vectors @ inside.T + floor * outside)


def _find_intervals(line: BeliefSlice) -> list[Region]:
    """Return the upper envelope of lines, from the first corner to the second."""
    heights, slopes = line.values[:, 0], line.values[:, 1] - line.values[:, 0]
    position, best = 0.0, int(np.lexsort((np.arange(len(slopes)), -slopes, -heights))[0])
    pieces = []
    while True:
        steeper = np.flatnonzero(slopes > slopes[best])
        crossings = (heights[best] - heights[steeper]) / (slopes[steeper] - slopes[best])
        ahead = np.flatnonzero(crossings < 1)
        if not len(ahead):
            pieces.append((best, position, 1.0))
            break
        end = max(position, float(crossings[ahead].min()))
        if end - position > MIN_REGION:
            pieces.append((best, position, end))
        crossing = steeper[ahead][crossings[ahead] <= end]
        position, best = end, int(crossing[slopes[crossing].argmax()])
    return [
        Region(k, int(line.actions[k]), np.array([[1 - begin, begin], [1 - end, end]]))
        for k, begin, end in pieces
    ]


def _find_polygons(triangle: BeliefSlice) -> list[Region]:
    """Return each vector's polygon: the triangle clipped by all other vectors."""
    best = np.unique((grid(GRID) @ triangle.values.T).argmax(axis=1))
    values = triangle.values[best]
    regions = []
    for k, own in zip(best.tolist(), values, strict=True):
        points = np.eye(3)
        for other in values:
            points = _clip(points, own - other)
            if not len(points):
                break
        if len(points) and area(points) > MIN_REGION:
            regions.append(Region(k, int(triangle.actions[k]), points))
    return regions


def grid(n: int) -> Array:
    """Return ((n + 1)(n + 2) / 2, 3) weights of three corners on a regular grid."""
    first, second = np.indices((n + 1, n + 1)).reshape(2, -1)
    inside = first + second <= n
    return np.stack([first, second, n - first - second], axis=1)[inside] / np.float64(n)


def _clip(points: Array, normal: Array) -> Array:
    """Clip a convex polygon (m, 3) to the half-plane where normal (3,) @ weights >= 0."""
    distances = points @ normal
    if distances.min() >= 0:
        return points
    clipped = []
    for i, (point, here) in enumerate(zip(points, distances, strict=True)):
        before, there = points[i - 1], distances[i - 1]
        if here * there < 0:
            clipped.append(before + (point - before) * (there / (there - here)))
        if here >= 0:
            clipped.append(point)
    return np.array(clipped).reshape(-1, 3)


def area(points: Array) -> float:
    """Return the area of a polygon (m, 3) relative to the triangle."""
    x, y = points[:, 0], points[:, 1]
    return abs(float(x @ np.roll(y, 1) - y @ np.roll(x, 1)))
