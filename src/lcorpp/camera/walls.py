"""Straight walls in a map of what stands on the floor."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lcorpp.values import Array

Flags = npt.NDArray[np.bool_]

MAX_WALLS, HYPOTHESES = 6, 100
"""Lines searched, and those through two points that are compared for each."""

MIN_POINTS = 8
"""Fewer points are not a wall."""

MIN_LENGTH, MIN_CUT_LENGTH, MAX_HOLE = 1.5, 2.5, 0.4
"""In metres: of a wall, of one whose top is mostly outside of the image, as of people side by side, and of a
hole in it."""

TOLERANCE, NOISE = 0.08, 0.003
"""Metres from the line of a wall, and metres more for each square metre of the distance to the camera."""


def find_walls(points: Array, is_tall: Flags, is_cut: Flags, rng: np.random.Generator) -> Flags:
    """Return (n,) which points belong to walls.

    Args:
        points: (n, 2) metres on the floor, the camera at the origin.
        is_tall: (n,) whether what stands there is higher than people.
        is_cut: (n,) whether it is as high as the image shows.
    """
    in_wall = np.zeros(len(points), dtype=np.bool_)
    tolerance = TOLERANCE + NOISE * (points**2).sum(axis=1)
    for _ in range(MAX_WALLS):
        open_points = np.flatnonzero((is_tall | is_cut) & ~in_wall)
        line = _fit_line(points[open_points], tolerance[open_points], rng)
        if line is None:
            break
        centre, direction = line
        offsets = points - centre
        near = np.abs(offsets @ (-direction[1], direction[0])) <= tolerance
        places = offsets @ direction
        low, high = _find_longest_run(np.sort(places[near & (is_tall | is_cut)]))
        mostly_cut = (near & is_tall).sum() < (near & is_cut & ~is_tall).sum()
        if high - low >= (MIN_CUT_LENGTH if mostly_cut else MIN_LENGTH):
            in_wall |= near & (places >= low - MAX_HOLE) & (places <= high + MAX_HOLE)
    return in_wall


def _fit_line(points: Array, tolerance: Array, rng: np.random.Generator) -> tuple[Array, Array] | None:
    """Return a point and the direction of the line with most of the points (n, 2); None if they are few."""
    if len(points) < MIN_POINTS:
        return None
    ends = points[rng.integers(len(points), size=(HYPOTHESES, 2))]
    along = ends[:, 1] - ends[:, 0]
    lengths = np.hypot(along[:, 0], along[:, 1])
    is_long = lengths > MIN_LENGTH / 3
    if not is_long.any():
        return None
    normals = np.stack([-along[:, 1], along[:, 0]], axis=1)[is_long] / lengths[is_long, None]
    near = np.abs(points @ normals.T - (ends[is_long, 0] * normals).sum(axis=1)) <= tolerance[:, None]
    chosen = points[near[:, int(np.argmax(near.sum(axis=0)))]]
    centre = chosen.mean(axis=0)
    return centre, np.linalg.svd(chosen - centre, full_matrices=False)[2][0]


def _find_longest_run(places: Array) -> tuple[float, float]:
    """Return the ends of the longest run of sorted places without a hole."""
    breaks = np.flatnonzero(np.diff(places) > MAX_HOLE)
    starts, ends = np.append(0, breaks + 1), np.append(breaks, len(places) - 1)
    longest = int(np.argmax(places[ends] - places[starts]))
    return float(places[starts[longest]]), float(places[ends[longest]])
