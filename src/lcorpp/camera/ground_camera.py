"""Camera above a flat floor: a homography between pixels and metres, and what follows from it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments, to_numbers
from lcorpp.errors import DataError, ParseError
from lcorpp.files import read_text
from lcorpp.values import Array, freeze

MIN_DETERMINANT = 1e-9
"""Of the homography between coordinates that are scaled to about 1; a smaller one is singular."""

FOCAL_LENGTHS = np.geomspace(0.2, 20.0, 400)
"""Focal lengths that are compared, in widths of the image: angles of view of 136 to 3 degrees."""


@dataclass(frozen=True, eq=False, repr=False)
class GroundCamera:
    """A camera that sees a flat floor.

    homography: (3, 3) maps (column, row, 1) in pixels to (x, y, 1) in metres on the floor, up to a factor.
    size: width and height of the image in pixels.
    projection: (3, 4) maps (x, y, height, 1) in metres to pixels, up to a positive factor in front of the
        camera. It follows from the homography for square pixels and a principal point in the middle of the
        image: the focal length is that at which the axes of the floor are most nearly orthogonal and of
        equal length.

    Raises:
        DataError: another shape, numbers that are not finite, a singular homography, or a floor that is not
            seen at the middle of the image's bottom.

    Source: Zhang, A Flexible New Technique for Camera Calibration, 2000, equations 3 and 4.

    Examples:
        >>> from lcorpp.camera import GroundCamera
        >>> camera = GroundCamera([[0, 0, 150], [-1.5, 0, 120], [0, 1, -60]], (160, 120))  # 1.5 m high
        >>> camera.to_metres([[80, 110], [60, 110]]).round(2).tolist()  # x ahead, y to the left
        [[3.0, 0.0], [3.0, 0.6]]
        >>> camera.to_pixels([[3, 0.6]]).round(1).tolist()
        [[60.0, 110.0]]
    """

    homography: Array
    size: tuple[int, int]
    projection: Array = field(init=False)
    _to_pixels: Array = field(init=False)

    def __post_init__(self) -> None:
        matrix = to_numbers(self.homography, "the homography")
        if matrix.shape != (3, 3):
            raise DataError(f"the homography has shape {matrix.shape}; expected (3, 3)")
        if not np.isfinite(matrix).all():
            raise DataError("the homography has a number that is not finite")
        width, height = self.size
        if width < 1 or height < 1:
            raise DataError(f"the image has {width} x {height} pixels; expected at least one")
        pixels = np.diag([width, height, 1.0])
        scaled = matrix @ pixels
        scaled = scaled / np.maximum(np.abs(scaled).max(axis=1, keepdims=True), np.finfo(float).tiny)
        if abs(np.linalg.det(scaled)) < MIN_DETERMINANT:
            raise DataError("the homography is singular; expected one that maps the image to the floor")
        depth = matrix[2] @ (width / 2, height, 1)
        if depth == 0:
            raise DataError("the homography has its horizon at the bottom of the image; expected the floor")
        matrix = matrix * np.sign(depth) / np.abs(matrix).max()
        inverse = np.linalg.inv(matrix)
        object.__setattr__(self, "homography", freeze(matrix))
        object.__setattr__(self, "_to_pixels", freeze(inverse))
        object.__setattr__(self, "projection", freeze(_find_projection(inverse, width, height)))

    def __repr__(self) -> str:
        centre = -np.linalg.solve(self.projection[:, :3], self.projection[:, 3])
        return f"<GroundCamera: {self.size[0]} x {self.size[1]} pixels, {centre[2]:.2f} m above the floor>"

    def to_metres(self, pixels: npt.ArrayLike) -> Array:
        """Return the points of the floor at pixels, both (n, 2); NaN at and above the horizon."""
        return _map(self.homography, np.reshape(to_numbers(pixels, "pixels"), (-1, 2)))

    def to_pixels(self, points: npt.ArrayLike) -> Array:
        """Return the pixels of points of the floor, both (n, 2); NaN behind the camera."""
        return _map(self._to_pixels, np.reshape(to_numbers(points, "points"), (-1, 2)))

    def project(self, points: Array) -> Array:
        """Return the pixels (..., 2) of points (..., 3): x, y and height in metres; NaN behind the camera."""
        return _divide(points @ self.projection[:, :3].T + self.projection[:, 3])

    def measure_covariances(self, pixels: Array, points: Array, noise: float) -> Array:
        """Return the (n, 2, 2) covariances, m^2, of points of the floor.

        Args:
            pixels: (n, 2) of the points. points: (n, 2) `to_metres` of the pixels.
            noise: standard deviation of a pixel's column and row, in pixels.
        """
        steps = [self.to_metres(pixels + step) - points for step in (np.array([1.0, 0]), np.array([0, 1.0]))]
        jacobian = np.stack(steps, axis=-1)
        covariances: Array = noise**2 * jacobian @ np.swapaxes(jacobian, -1, -2)
        return covariances


@check_arguments
def read_homography(path: str | Path) -> Array:
    r"""Read a (3, 3) homography from text: three lines of three numbers, separated by spaces or commas.

    Empty lines, and what follows a #, are left out.

    Raises:
        FileError: the file cannot be read.
        ParseError: other than three lines of three finite numbers.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.camera import read_homography
        >>> _ = Path("camera.txt").write_text("0 0 150\n-1.5 0 120\n0 1 -60  # of a level camera\n")
        >>> read_homography("camera.txt").tolist()
        [[0.0, 0.0, 150.0], [-1.5, 0.0, 120.0], [0.0, 1.0, -60.0]]
    """
    rows: list[list[float]] = []
    lines = read_text(path).splitlines()
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words:
            continue
        if len(words) != 3 or len(rows) == 3:
            fault = f"{len(words)} numbers" if len(words) != 3 else "a fourth row"
            raise ParseError(str(path), number, 1, f"{fault}; expected three rows of three numbers", line)
        rows.append([_parse(word, str(path), number, line) for word in words])
    if len(rows) != 3:
        raise ParseError(
            str(path), len(lines) + 1, 1, f"{len(rows)} rows; expected three rows of three numbers"
        )
    return np.array(rows)


def _parse(word: str, file: str, number: int, line: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        message = f"{word!r} is not a finite number; expected an entry of the homography"
        raise ParseError(file, number, line.find(word) + 1, message, line)
    return value


def _map(matrix: Array, points: Array) -> Array:
    return _divide(points @ matrix[:, :2].T + matrix[:, 2])


def _divide(homogeneous: Array) -> Array:
    scale = homogeneous[..., 2:]
    divided: Array = homogeneous[..., :2] / np.where(scale > 0, scale, np.nan)
    return divided


def _find_projection(to_pixels: Array, width: int, height: int) -> Array:
    """Return the (3, 4) projection of a camera whose floor has the homography `to_pixels`."""
    centred = np.array([[1, 0, -width / 2], [0, 1, -height / 2], [0, 0, 1]]) @ to_pixels
    axes = (
        centred[:, :2] / np.stack([width * FOCAL_LENGTHS, width * FOCAL_LENGTHS, np.ones(400)], -1)[..., None]
    )
    lengths = np.linalg.norm(axes, axis=1)
    cosines = np.prod(axes, axis=2).sum(axis=1) / lengths.prod(axis=1)
    focal = width * FOCAL_LENGTHS[np.argmin(cosines**2 + np.log(lengths[:, 0] / lengths[:, 1]) ** 2)]
    intrinsic = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    pose = np.linalg.solve(intrinsic, to_pixels)
    pose = 2 * pose / np.linalg.norm(pose[:, :2], axis=0).sum()
    up = np.cross(pose[:, 0], pose[:, 1])
    if np.linalg.solve(np.stack([pose[:, 0], pose[:, 1], up], axis=1), -pose[:, 2])[2] < 0:
        up = -up  # the axes of the floor are left-handed
    projection: Array = intrinsic @ np.stack([pose[:, 0], pose[:, 1], up, pose[:, 2]], axis=1)
    return projection
