"""People in depth images without learnt weights: the floor, a height map above it, and its heads."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments
from lcorpp.camera.floor import Floor, Intrinsics, find_floor, refine_floor, to_plane
from lcorpp.camera.heads import CELL, MAX_HEAD, HeightMap, find_people
from lcorpp.camera.walls import find_walls
from lcorpp.errors import DataError
from lcorpp.values import Array

Pixels = npt.NDArray[np.float32]

MAX_COLUMNS = 220
"""Images are reduced by a whole factor, without averaging, to at most this width."""

MIN_RANGE, MAX_RANGE = 0.3, 8.0
"""Of used depths, in metres."""

MIN_POINT, MAX_POINT = 0.4, 2.25
"""Heights of the points in the height map, in metres: legs and low things are left out, and ceilings."""

MIN_HEAD, MIN_CUT_HEAD, CUT_MARGIN = 1.1, 0.7, 0.1
"""Minimum height of a head in metres; where the image ends lower, a little below its end, but
at least the second."""

MAX_JUMP_ANGLE, MAX_JUMP_HEIGHT = np.radians(10), 0.2
"""A floor that differs more from the one before, the height relative to it, must be found in two images."""

MAX_FLOOR_POINTS = 4000
"""Points of an image that the floor is fitted to."""

RADIAL_NOISE, RADIAL_GROWTH, LATERAL_NOISE = 0.04, 0.001, 0.04
"""Standard deviation of a position in metres: away from the camera, its increase for each square metre of the
distance, and across."""


class DepthLocator:
    """Locate people in depth images of one camera, e.g. on a robot that drives.

    The floor is found in the first image that shows it, and followed; if it is suddenly elsewhere, no people
    are located until a second image shows it there. What is above it makes a height map; straight walls are
    left out. The map's local maxima are heads if they have human height and width and enough points have the
    head as their nearest: so people who touch are separated, each with a head.

    Args:
        intrinsics: of the images. rng: draws hypotheses of floor and walls; None uses a generator of seed 0.

    Attributes:
        floor: the floor in the last image that shows it; None before.
        sees_floor: whether the last image shows it.

    Source: Munaro and Menegatti, Fast RGB-D People Tracking for Service Robots, Autonomous Robots 37, 2014
    (floor, height map, clusters split at head maxima).

    Examples:
        >>> import numpy as np
        >>> from lcorpp.camera import DepthLocator, Intrinsics
        >>> rows, columns = np.mgrid[:120, :160]  # of a level camera, 1.2 m above the floor
        >>> depths = np.where(rows > 60, 120 / np.maximum(rows - 60, 1), np.nan)
        >>> person = (abs(columns - 60) < 6) & (rows > 45) & (rows < 100)  # 3 m away, 1.65 m tall
        >>> locator = DepthLocator(Intrinsics(100, 100, 80, 60))
        >>> positions, covariances = locator.locate(np.where(person, 3.0, depths))
        >>> positions.round(1).tolist(), round(locator.floor.height, 2)
        ([[3.1, 0.6]], 1.2)
    """

    @check_arguments
    def __init__(self, intrinsics: Intrinsics, *, rng: np.random.Generator | None = None) -> None:
        self._intrinsics, self._rng = intrinsics, rng or np.random.default_rng(0)
        self._size: tuple[int, ...] | None = None
        self._step, self._rays = 1, np.empty((0, 0, 2), dtype=np.float32)
        self.floor: Floor | None = None
        self.sees_floor = False
        self._jump: Floor | None = None

    def __repr__(self) -> str:
        return f"<DepthLocator: {self._intrinsics}; {self.floor or 'no floor yet'}>"

    def locate(self, image: Pixels, /) -> tuple[Array, Array]:
        """Locate the people in an image.

        Args:
            image: (height, width) depths along the optical axis in metres; what is not finite or not positive
                is unknown.

        Returns:
            (n, 2) positions in metres on the floor, x forward and y to the left of the point below the
            camera, and their (n, 2, 2) covariances. Both are empty while no floor has been seen, and while
            it is uncertain.

        Raises:
            DataError: the image is not a depth image, or has another size than the first one.
        """
        depths, rays = self._reduce(image)
        self._follow_floor(depths, rays)
        if self.floor is None or self._jump is not None:
            return np.empty((0, 2)), np.empty((0, 2, 2))
        axes = self.floor.axes().astype(np.float32)
        points = (rays @ axes[:, :2].T + axes[:, 2]) * depths[:, None]
        points[:, 2] += np.float32(self.floor.height)
        kept = (points[:, 2] > MIN_POINT) & (points[:, 2] < MAX_POINT)
        height_map = HeightMap.of(points[kept], MAX_RANGE)
        rows = CELL * np.arange(0.5, len(height_map.heights))
        limits = self._limit_heights(self.floor, rows) - CUT_MARGIN
        occupied = np.argwhere(height_map.heights > 0)
        tops = height_map.heights[occupied[:, 0], occupied[:, 1]]
        is_tall, is_cut = tops > MAX_HEAD, tops > limits[occupied[:, 0]]
        is_wall = find_walls(height_map.centres(occupied), is_tall, is_cut, self._rng)
        min_heights = np.maximum(MIN_CUT_HEAD, np.minimum(MIN_HEAD, limits))
        positions = find_people(height_map.without(occupied[is_wall]), min_heights, self._measure_areas)
        return positions, _measure_covariances(positions)

    def _reduce(self, image: Pixels) -> tuple[Pixels, Pixels]:
        """Return the known depths (n,), reduced, and the first two coordinates of their rays, (n, 2)."""
        if image.ndim != 2 or image.dtype.kind != "f":
            raise DataError(
                f"an image of shape {image.shape}, {image.dtype}; expected depths in metres, float"
            )
        if self._size is None:
            self._size, k = image.shape, self._intrinsics
            self._step = max(1, -(-image.shape[1] // MAX_COLUMNS))
            half = self._step // 2
            rows, columns = np.mgrid[half : image.shape[0] : self._step, half : image.shape[1] : self._step]
            self._rays = np.stack([(columns - k.cx) / k.fx, (rows - k.cy) / k.fy], axis=-1).astype(np.float32)
        if image.shape != self._size:
            raise DataError(f"an image of shape {image.shape}; expected {self._size}, as the first one")
        half = self._step // 2
        depths = image[half :: self._step, half :: self._step].astype(np.float32)
        known = (depths > MIN_RANGE) & (depths < MAX_RANGE)  # False for NaN
        return depths[known], self._rays[known]

    def _follow_floor(self, depths: Pixels, rays: Pixels) -> None:
        some = slice(None, None, max(1, len(depths) // MAX_FLOOR_POINTS))
        wide, disparities = rays[some].astype(np.float64), 1 / depths[some].astype(np.float64)
        found = None if self.floor is None else refine_floor(wide, disparities, to_plane(self.floor))
        found = found or find_floor(wide, disparities, self._rng)
        is_new = found is not None and self.floor is not None and _is_jump(self.floor, found)
        is_jump = is_new and (self._jump is None or found is None or _is_jump(self._jump, found))
        self._jump = found if is_jump else None
        self.sees_floor = found is not None and not is_jump
        if self.sees_floor:
            self.floor = found

    def _limit_heights(self, floor: Floor, forward: Array) -> Array:
        """Return the heights, m, at which the image ends, at distances forward in metres."""
        top = floor.axes() @ (0, -self._intrinsics.cy / self._intrinsics.fy, 1)
        limits: Array = (
            floor.height + forward * top[2] / top[0] if top[0] > 0 else np.full_like(forward, np.inf)
        )
        return limits

    def _measure_areas(self, points: Pixels) -> Array:
        """Return (m,) the areas, m^2, that points stand for: the square of distance by focal length."""
        areas: Array = (points**2).sum(axis=1) * self._step**2 / (self._intrinsics.fx * self._intrinsics.fy)
        return areas


def _is_jump(before: Floor, after: Floor) -> bool:
    """Return whether a floor is elsewhere than one image before."""
    turn = np.arccos(np.clip(np.dot(before.normal, after.normal), -1, 1))
    return bool(turn > MAX_JUMP_ANGLE or abs(after.height / before.height - 1) > MAX_JUMP_HEIGHT)


def _measure_covariances(positions: Array) -> Array:
    """Return (n, 2, 2) covariances of positions (n, 2)."""
    distances = np.linalg.norm(positions, axis=1)
    radial = positions / np.maximum(distances, 1e-9)[:, None]
    spread = (RADIAL_NOISE + RADIAL_GROWTH * distances**2) ** 2 - LATERAL_NOISE**2
    covariances: Array = (
        LATERAL_NOISE**2 * np.eye(2) + spread[:, None, None] * radial[:, :, None] * radial[:, None]
    )
    return covariances
