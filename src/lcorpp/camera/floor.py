"""The floor in a depth image: a plane, found without knowing how the camera is mounted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_fields
from lcorpp.errors import DataError
from lcorpp.values import Array

Flags = npt.NDArray[np.bool_]

MAX_TILT = np.radians(55)
"""Maximum angle between the normal of the floor and the image's upward direction."""

MAX_ROLL = np.radians(20)
"""Maximum angle by which the floor is inclined to the left or right in the image."""

MIN_HEIGHT, MAX_HEIGHT = 0.15, 3.5
"""Of the camera above the floor, in metres."""

TOLERANCE = 0.02
"""Disparity, 1/m, between a point and its plane: .02 is 2 cm at 1 m, 32 cm at 4 m."""

HYPOTHESES = 300
"""Planes through three points that are compared: with 20 % floor, one of 125 is of the floor alone."""

MAX_POINTS = 1500
"""Points that the hypotheses are compared on."""

MIN_SHARE = 0.03
"""Minimum share of the known points on the floor."""

MIN_CORE_SHARE = 0.75
"""Minimum share of the points on the floor that are within half the tolerance. Noise leaves most points of a
floor there; a plane that cuts through other surfaces has half of its points there."""

MAX_BELOW_SHARE = 0.25
"""Maximum number of points below the floor, relative to those on it: reflections."""

MIN_CEILING = 2.15
"""Minimum height of a ceiling above the floor, in metres: to a camera that is turned in a corridor, one wall
is the floor, and the other the ceiling."""

CEILING_RANGE, MIN_CEILING_SHARE, CEILING_BIN = 4.0, 0.15, 0.1
"""Range in metres in which a low ceiling is sought, its minimum share of the known points, and the size of
the bins of heights. A group of heads is less."""

CANDIDATES = 5
"""Hypotheses with the most points that are refined, until one is a floor."""

BELOW_WEIGHT = 2.0
"""A point below the plane counts as this many points that are not on it: nothing is below the floor."""


@dataclass(frozen=True)
class Intrinsics:
    """The pinhole camera: focal lengths and principal point in pixels.

    Raises:
        DataError: a focal length is not positive, or a number is not finite.

    Examples:
        >>> from lcorpp.camera import Intrinsics
        >>> Intrinsics(525.0, 525.0, cx=319.5, cy=239.5)  # of a Kinect's images of 640 x 480
        Intrinsics(fx=525.0, fy=525.0, cx=319.5, cy=239.5)
        >>> Intrinsics(0.0, 525.0, 319.5, 239.5)
        Traceback (most recent call last):
            ...
        lcorpp.errors.DataError: Intrinsics(fx=0.0, ...); expected finite numbers and focal lengths above 0
    """

    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        check_fields(self)
        if not np.isfinite((self.fx, self.fy, self.cx, self.cy)).all() or min(self.fx, self.fy) <= 0:
            raise DataError(f"{self}; expected finite numbers and focal lengths above 0")


@dataclass(frozen=True)
class Floor:
    """The plane of the floor in the frame of the camera (x right, y down, z forward).

    normal: unit vector upwards. height: of the camera above the floor in metres.

    Examples:
        >>> from lcorpp.camera import Floor
        >>> floor = Floor((0.0, -1.0, 0.0), 1.2)  # of a level camera
        >>> forward, left, up = floor.axes().tolist()
        >>> forward, left
        ([0.0, 0.0, 1.0], [-1.0, 0.0, 0.0])
    """

    normal: tuple[float, float, float]
    height: float

    def axes(self) -> Array:
        """(3, 3) rows: forward, left and up of the robot, as vectors in the frame of the camera."""
        up = np.array(self.normal)
        forward = np.array([0.0, 0.0, 1.0]) - up[2] * up
        forward = forward / np.linalg.norm(forward)
        return np.stack([forward, np.cross(up, forward), up])


def find_floor(rays: Array, disparities: Array, rng: np.random.Generator) -> Floor | None:
    """Find the plane with most points on it and fewest below it.

    Noise of depth cameras is about constant in the disparity 1/z, and a plane in space is a plane in
    disparity: with the ray (a, b, 1) of a pixel, n . p = -h becomes 1/z = -(n . ray) / h. So the plane is
    linear least squares in disparity, and the tolerance is one number for all distances.

    Args:
        rays: (n, 2) a and b of points. disparities: (n,) 1/z in 1/m, positive.

    Returns:
        The floor, or None if no plane has enough points.

    Source: Fischler and Bolles, Random Sample Consensus, 1981; the disparity after Labayrade et al. 2002.
    """
    if len(disparities) < 50:
        return None
    some = rng.choice(len(disparities), min(MAX_POINTS, len(disparities)), replace=False)
    points, known = _with_one(rays[some]), disparities[some]
    triples = rng.integers(len(some), size=(HYPOTHESES, 3))
    matrices = points[triples]
    valid = np.abs(np.linalg.det(matrices)) > 1e-6
    if not valid.any():
        return None
    planes = np.linalg.solve(matrices[valid], known[triples[valid]][..., None])[..., 0]
    planes = planes[[_is_floor(plane) for plane in planes]]
    if not len(planes):
        return None
    residuals = known - planes @ points.T
    on, below = np.abs(residuals) <= TOLERANCE, residuals < -TOLERANCE
    scores = on.sum(axis=1) - BELOW_WEIGHT * below.sum(axis=1)
    best = np.argsort(-scores, kind="stable")[:CANDIDATES]
    refined = (refine_floor(rays, disparities, planes[index]) for index in best)
    return next((floor for floor in refined if floor is not None), None)


def refine_floor(rays: Array, disparities: Array, plane: Array) -> Floor | None:
    """Fit the floor to the points near a plane by least squares, three times.

    None if the points on it are too few, too far from it for noise, or too many are below it; if the plane
    is inclined, or too near or far, for a floor; or if there is a ceiling lower than `MIN_CEILING` above it.

    plane: (3,) the disparity of a ray (a, b) is its product with (a, b, 1).
    """
    points = _with_one(rays)
    for _ in range(3):
        on = np.abs(disparities - points @ plane) <= TOLERANCE
        if on.sum() < max(3, MIN_SHARE * len(disparities)):
            return None
        chosen = points[on]
        normal_matrix = chosen.T @ chosen
        if np.linalg.cond(normal_matrix) > 1e10:
            return None
        plane = np.asarray(np.linalg.solve(normal_matrix, chosen.T @ disparities[on]), dtype=np.float64)
        if not _is_floor(plane):
            return None
    residuals = disparities - points @ plane
    on = np.abs(residuals) <= TOLERANCE
    if (np.abs(residuals) <= TOLERANCE / 2).sum() < MIN_CORE_SHARE * on.sum():
        return None
    if (residuals < -TOLERANCE).sum() > MAX_BELOW_SHARE * on.sum():
        return None
    if _has_low_ceiling(points, disparities, plane):
        return None
    length = float(np.linalg.norm(plane))
    x, y, z = (-plane / length).tolist()
    return Floor((x, y, z), 1 / length)


def _has_low_ceiling(points: Array, disparities: Array, plane: Array) -> bool:
    """Return whether many points above the camera are at one height that is too low for a ceiling."""
    length = float(np.linalg.norm(plane))
    heights = 1 / length - points @ plane / length / disparities  # above the floor
    above = heights[(heights > 1 / length + CEILING_BIN) & (disparities > 1 / CEILING_RANGE)]
    counts = np.histogram(above, np.arange(0, MIN_CEILING + CEILING_BIN / 2, CEILING_BIN))[0]
    return bool((counts[1:] + counts[:-1]).max() >= MIN_CEILING_SHARE * len(disparities))


def to_plane(floor: Floor) -> Array:
    """Return the floor as a plane in disparity, as `refine_floor` takes it."""
    return -np.array(floor.normal) / floor.height


def _is_floor(plane: Array) -> bool:
    length = float(np.linalg.norm(plane))
    if not 1 / MAX_HEIGHT <= length <= 1 / MIN_HEIGHT:
        return False
    return bool(plane[1] / length >= np.cos(MAX_TILT) and abs(plane[0]) / length <= np.sin(MAX_ROLL))


def _with_one(rays: Array) -> Array:
    return np.concatenate([rays, np.ones((len(rays), 1))], axis=1)
