"""A policy on the beliefs over two or three states: few numbers, and the exact places where it changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.belief import check_belief
from lcorpp.planning.policy import AlphaVectors, Indices, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array, Belief

GRID = 120
"""Beliefs along an edge of a triangle at which the vectors are looked for that are best somewhere in it."""

SMALLEST = 1e-9
"""Share of the line or triangle below which a region comes from rounding."""


class Region(NamedTuple):
    """Where one vector is the best: among corners' weights, the ends of an interval or a polygon's corners.

    vector: its row in `Slice.values`. action: index of the action its plan begins with.
    points: (2, 2) or (m, 3) weights of the slice's corners.
    """

    vector: int
    action: int
    points: Array


@dataclass(frozen=True, eq=False)
class Slice:
    """A policy between n corner beliefs: at the belief sum of w_i corner_i, vector k is worth values[k] @ w.

    states: (n,) indices of the states that the corners are about.
    share: the probability that the states of the corners have together.
    corners: (n, S) beliefs. values: (K, n), each row once. actions: (K,).
    """

    states: tuple[int, ...]
    share: float
    corners: Array
    values: Array
    actions: Indices

    def regions(self) -> list[Region]:
        """The vectors that are best somewhere, each with the beliefs where it is; n is 2 or 3."""
        return _intervals(self) if len(self.states) == 2 else _polygons(self)

    def belief(self, weights: npt.ArrayLike) -> Belief:
        """(S,) the belief with some weights (n,) of the corners."""
        mixed: Belief = np.asarray(weights, dtype=np.float64) @ self.corners
        return mixed

    def value(self, weights: Array) -> Array:
        """(m,) what the policy is worth at weights (m, n)."""
        worth: Array = (weights @ self.values.T).max(axis=1)
        return worth


def slice_of(pomdp: Pomdp, policy: Policy, states: Sequence[str], base: npt.ArrayLike | None = None) -> Slice:
    """A policy on the beliefs over some states.

    Args:
        states: the names of two states or three.
        base: (S,) a belief: the other states keep its probabilities, and what it gives to `states` is shared
            out among them anew. When None the other states have none.

    Raises:
        ModelError: a state is unknown, named twice or too many, or `base` gives nothing to `states`.
    """
    if len(states) not in (2, 3):
        raise ModelError(f"a picture of beliefs is over two states or three, not {len(states)}")
    chosen = tuple(pomdp.state_index(name) for name in states)
    if len(set(chosen)) < len(chosen):
        raise ModelError(f"the states of a picture differ; given are {', '.join(states)}")
    rest = np.zeros(len(pomdp.states))
    if base is not None:
        rest = check_belief(pomdp, base).copy()
    share = 1.0 if base is None else float(rest[list(chosen)].sum())
    if not share > 0:
        raise ModelError(
            f"the belief gives no probability to {' or '.join(states)}, which the picture is about"
        )
    rest[list(chosen)] = 0
    corners = np.tile(rest, (len(chosen), 1))
    corners[np.arange(len(chosen)), chosen] = share
    pieces = _speaking(policy, corners.sum(axis=0))
    values = np.concatenate([_at(piece, policy.floor, corners) for piece in pieces])
    actions = np.concatenate([piece.actions for piece in pieces])
    _, first = np.unique(values, axis=0, return_index=True)
    first.sort()  # of equals the first one counts, as for `Policy.action`
    return Slice(chosen, share, corners, values[first], actions[first])


def _speaking(policy: Policy, support: Array) -> Sequence[AlphaVectors]:
    """The pieces that hold all states with any weight; every piece where none does, as in `Policy`."""
    needed = np.flatnonzero(support)
    return [
        piece for piece in policy.vector_sets if np.isin(needed, piece.states).all()
    ] or policy.vector_sets


def _at(piece: AlphaVectors, floor: float, corners: Array) -> Array:
    """(K, n) the values of a piece's vectors at the corners."""
    inside = corners[:, piece.states]
    values: Array = piece.vectors @ inside.T + floor * np.maximum(
        0.0, corners.sum(axis=1) - inside.sum(axis=1)
    )
    return values


def _intervals(line: Slice) -> list[Region]:
    """The upper envelope of straight lines, from the first corner to the second."""
    heights, slopes = line.values[:, 0], line.values[:, 1] - line.values[:, 0]
    at, here = 0.0, int(np.lexsort((np.arange(len(slopes)), -slopes, -heights))[0])
    found = []
    while True:
        steeper = np.flatnonzero(slopes > slopes[here])
        meets = (heights[here] - heights[steeper]) / (slopes[steeper] - slopes[here])
        ahead = np.flatnonzero(meets < 1)
        if not len(ahead):
            found.append((here, at, 1.0))
            break
        end = max(at, float(meets[ahead].min()))
        if end - at > SMALLEST:
            found.append((here, at, end))
        level = steeper[ahead][meets[ahead] <= end]
        at, here = end, int(level[slopes[level].argmax()])
    return [
        Region(k, int(line.actions[k]), np.array([[1 - begin, begin], [1 - end, end]]))
        for k, begin, end in found
    ]


def _polygons(triangle: Slice) -> list[Region]:
    """Each vector's part of the triangle: what is left of it when the others have taken theirs."""
    best = np.unique((grid(GRID) @ triangle.values.T).argmax(axis=1))
    values = triangle.values[best]
    found = []
    for k, own in zip(best.tolist(), values, strict=True):
        points = np.eye(3)
        for other in values:
            points = _clipped(points, own - other)
            if not len(points):
                break
        if len(points) and area(points) > SMALLEST:
            found.append(Region(k, int(triangle.actions[k]), points))
    return found


def grid(n: int) -> Array:
    """((n + 1)(n + 2) / 2, 3) weights of three corners, evenly spread."""
    first, second = np.indices((n + 1, n + 1)).reshape(2, -1)
    inside = first + second <= n
    weights: Array = np.stack([first, second, n - first - second], axis=1)[inside] / n
    return weights


def _clipped(points: Array, normal: Array) -> Array:
    """The part of a convex polygon (m, 3) where normal (3,) times the weights is not negative."""
    side = points @ normal
    if side.min() >= 0:
        return points
    kept = []
    for i, (point, here) in enumerate(zip(points, side, strict=True)):
        before, there = points[i - 1], side[i - 1]
        if here * there < 0:
            kept.append(before + (point - before) * (there / (there - here)))
        if here >= 0:
            kept.append(point)
    return np.array(kept).reshape(-1, 3)


def area(points: Array) -> float:
    """The area of a polygon (m, 3) as a share of the whole triangle."""
    x, y = points[:, 0], points[:, 1]
    return abs(float(x @ np.roll(y, 1) - y @ np.roll(x, 1)))
