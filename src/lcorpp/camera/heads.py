"""Heads in a height map, and the people below them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter

from lcorpp.values import Array

Pixels = npt.NDArray[np.float32]
Cells = npt.NDArray[np.intp]

CELL = 0.06
"""Side of a cell of the height map in metres."""

MAX_HEAD = 2.1
"""Maximum height of a head in metres."""

HEAD_DISTANCE = 0.24
"""A head is higher than all cells so near in metres, in both directions."""

NECK_DISTANCE, NECK_DEPTH = 0.75, 0.08
"""Two heads that are nearer than the first, in metres, have something lower by the second between them."""

MAX_HEAD_SPREAD, HEAD_SLICE = 0.17, 0.2
"""Maximum standard deviation across the line of sight, in metres, of the points within `HEAD_SLICE` below the
top: of a head about .07, of shoulders that the image cuts .13, of the flat top of a cupboard more."""

RING_CELLS = 2
"""Far from the camera points lie on rings, as depths are discrete; up to twice so many empty cells between
rings count as filled."""

BODY_RADIUS = 0.45
"""Points of a person are within this distance of the head in metres, and nearer to it than to another."""

MIN_AREA = 0.06
"""Minimum visible area of a person in m^2; whole people have about .45 above 40 cm."""

TRUNK = 0.7
"""The position of a person is that of the points so far below the top, in metres: head and trunk."""

HALF_DEPTH = 0.11
"""Metres from the visible surface to the axis of the body: the mean over an ellipse, pi / 4 of its radius,
for trunks that are .24 m deep and .4 m wide, from all sides."""


@dataclass(frozen=True, eq=False)
class HeightMap:
    """The greatest height in each cell of the floor in front of a camera, which is at (0, 0).

    heights: (rows, columns) metres, 0 where nothing stands; a row further is `CELL` forward, a column to the
    left. origin: the first column's left coordinate. cells: (m, 2) row and column of each point.
    points: (m, 3) forward, left, height in metres.
    """

    heights: Pixels
    origin: float
    cells: Cells
    points: Pixels

    @classmethod
    def of(cls, points: Pixels, max_range: float) -> HeightMap:
        """Return the map of (m, 3) points in front of the camera, up to a distance."""
        side = int(max_range / CELL) + 1
        cells = np.floor((points[:, :2] + (0, max_range)) / CELL).astype(np.intp)
        inside = (cells >= 0).all(axis=1) & (cells[:, 0] < side) & (cells[:, 1] < 2 * side)
        points, cells = points[inside], cells[inside]
        heights = np.zeros((side, 2 * side), dtype=np.float32)
        np.maximum.at(heights, (cells[:, 0], cells[:, 1]), points[:, 2])
        return cls(heights, -max_range, cells, points)

    def centres(self, cells: Cells) -> Array:
        """Return (n, 2) forward and left coordinates of cells (n, 2)."""
        centres: Array = CELL * (cells.astype(np.float64) + 0.5) + np.array([0.0, self.origin])
        return centres

    def without(self, cells: Cells) -> HeightMap:
        """Return the map without some cells (n, 2) and their points."""
        heights = self.heights.copy()
        heights[cells[:, 0], cells[:, 1]] = 0
        kept = heights[self.cells[:, 0], self.cells[:, 1]] > 0
        return HeightMap(heights, self.origin, self.cells[kept], self.points[kept])


def find_people(height_map: HeightMap, min_heights: Array, measure_areas: Callable[[Pixels], Array]) -> Array:
    """Return the (n, 2) positions of people on the floor in metres, forward and left.

    Args:
        min_heights: (rows,) minimum height of a head in each row of the map.
        measure_areas: returns the areas (m,) that points (m, 3) stand for, m^2.
    """
    heads = _find_heads(height_map, min_heights)
    if not len(heads):
        return np.empty((0, 2))
    places = height_map.centres(heads)
    offsets = height_map.points[:, None, :2] - places
    distances = np.hypot(offsets[..., 0], offsets[..., 1])
    nearest = distances.argmin(axis=1)
    is_near = distances.min(axis=1) <= BODY_RADIUS
    people = []
    for index, (row, column) in enumerate(heads.tolist()):
        own = is_near & (nearest == index)
        points, top = height_map.points[own], height_map.heights[row, column]
        if top <= MAX_HEAD and measure_areas(points).sum() >= MIN_AREA and _is_head(points, top):
            people.append(np.median(points[points[:, 2] > top - TRUNK, :2], axis=0))
    found = np.array(people, dtype=np.float64).reshape(-1, 2)
    ranges = np.maximum(np.linalg.norm(found, axis=1), HALF_DEPTH)
    moved: Array = found * (1 + HALF_DEPTH / ranges)[:, None]
    return moved


def _find_heads(height_map: HeightMap, min_heights: Array) -> Cells:
    """Return the (n, 2) cells of heads: local maxima with something lower between them, the highest first."""
    heights = height_map.heights
    size = 2 * round(HEAD_DISTANCE / CELL) + 1
    is_top = (heights == maximum_filter(heights, size, mode="constant")) & (heights >= min_heights[:, None])
    candidates = np.argwhere(is_top)
    order = np.argsort(-heights[candidates[:, 0], candidates[:, 1]], kind="stable")
    behind = maximum_filter(heights, (2 * RING_CELLS + 1, 1), mode="constant")
    heads: list[Cells] = []
    for cell in candidates[order]:
        if all(_is_separate(behind, heights[tuple(cell)], cell, head) for head in heads):
            heads.append(cell)
    return np.array(heads, dtype=np.intp).reshape(-1, 2)


def _is_separate(heights: Pixels, height: float, cell: Cells, head: Cells) -> bool:
    """Whether something is lower between a local maximum and a higher head, or they are far apart."""
    offset = head - cell
    distance = float(np.hypot(*offset)) * CELL
    if distance > NECK_DISTANCE:
        return True
    if distance <= HEAD_DISTANCE:
        return False
    shares = np.linspace(0.2, 0.8, 7)[:, None]
    rows, columns = np.rint(cell + shares * offset).astype(np.intp).T
    return bool(heights[rows, columns].min() < height - NECK_DEPTH)


def _is_head(points: Pixels, top: float) -> bool:
    """Whether the points of a person have a head's width at the top, seen from the camera."""
    part = points[points[:, 2] > top - HEAD_SLICE, :2]
    centre = part.mean(axis=0)
    across = (part - centre) @ np.array([-centre[1], centre[0]]) / np.linalg.norm(centre)
    return bool(across.std() <= MAX_HEAD_SPREAD)
