"""Depth images of people in a corridor, by ray casting, with the noise of a structured-light camera.

The robot is at the origin and looks along x; y is to the left, heights are above the floor, in metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcorpp.camera import Intrinsics
from lcorpp.values import Array

DISPARITY_STEP = 0.0029
"""1/m: an eighth of a pixel of a camera with a focal length of 570 pixels and a baseline of 75 mm."""

EDGE = 0.03
"""1/m: at larger steps of disparity between two pixels the depth is unknown."""

NEAR, FAR = 0.5, 9.0
"""Range of the camera in metres."""


@dataclass(frozen=True)
class Mount:
    """A depth camera: size and focal length in pixels, height in metres, tilt downwards in radians."""

    width: int = 640
    height: int = 480
    focal: float = 570.0
    camera_height: float = 1.2
    tilt: float = 0.15

    @property
    def intrinsics(self) -> Intrinsics:
        return Intrinsics(self.focal, self.focal, (self.width - 1) / 2, (self.height - 1) / 2)

    def sees(self, x: float, y: float, max_range: float = 7.5) -> bool:
        """Whether a body's axis is inside of the image, at most so far away."""
        return 1 < x < max_range and abs(y) / x < self.width / 2 / self.focal - 0.02


@dataclass(frozen=True)
class Person:
    """A person: position in metres, direction in radians, height in metres."""

    x: float
    y: float
    direction: float = 0.0
    height: float = 1.75


@dataclass(frozen=True)
class Corridor:
    """Walls on both sides, at the end, and a ceiling, in metres."""

    half_width: float = 1.5
    end: float = 9.0
    ceiling: float = 2.8


def render(mount: Mount, people: Sequence[Person], corridor: Corridor | None = None) -> Array:
    """Return (height, width) exact depths in metres along the optical axis."""
    corridor = corridor or Corridor()
    columns, rows = np.meshgrid(np.arange(mount.width), np.arange(mount.height))
    a, b = (columns - (mount.width - 1) / 2) / mount.focal, (rows - (mount.height - 1) / 2) / mount.focal
    sine, cosine = np.sin(mount.tilt), np.cos(mount.tilt)
    rays = np.stack([cosine - b * sine, -a, -sine - b * cosine], axis=-1)
    origin = np.array([0, 0, mount.camera_height])
    depths = np.full(rays.shape[:2], np.inf)
    planes = ((2, 0.0), (2, corridor.ceiling), (1, corridor.half_width), (1, -corridor.half_width))
    with np.errstate(divide="ignore", invalid="ignore"):
        for axis, level in (*planes, (0, corridor.end)):
            hits = (level - origin[axis]) / rays[..., axis]
            depths = np.minimum(depths, np.where(hits > 0, hits, np.inf))
        for person in people:
            middle = (mount.width - 1) / 2 - mount.focal * person.y / person.x
            margin = 0.6 * mount.focal / max(person.x - 0.3, 0.3)
            part = slice(max(0, int(middle - margin)), max(0, int(middle + margin)))
            depths[:, part] = np.minimum(depths[:, part], _cast(origin, rays[:, part], person))
    return depths


def _cast(origin: Array, rays: Array, person: Person) -> Array:
    """Return the depths of a person: head and trunk are ellipsoids, the legs one elliptic cylinder."""
    k = person.height / 1.75
    cosine, sine = np.cos(person.direction), np.sin(person.direction)
    turn = np.array([[cosine, sine, 0], [-sine, cosine, 0], [0, 0, 1]])
    depths = np.full(rays.shape[:2], np.inf)
    for centre, axes in (
        (1.64 * k, (0.10, 0.08, 0.11 * k)),
        (1.18 * k, (0.13, 0.22, 0.36 * k)),
        (0.0, (0.10, 0.15)),
    ):
        used = len(axes)  # the cylinder has no third axis
        start = (turn @ (origin - (person.x, person.y, centre)))[:used] / axes
        steps = (rays @ turn.T)[..., :used] / axes
        square, product = (steps**2).sum(axis=-1), steps @ start
        root = np.sqrt(product**2 - square * (start @ start - 1))  # NaN beside the body
        hits = (-product - root) / square
        heights = origin[2] + hits * rays[..., 2]
        is_hit = (hits > 0) & ((used == 3) | ((heights > 0) & (heights < 0.95 * k)))
        depths = np.where(is_hit, np.fmin(depths, hits), depths)
    return depths


def add_noise(
    depths: Array, rng: np.random.Generator, *, step: float = DISPARITY_STEP
) -> npt.NDArray[np.uint16]:
    """Return depths in whole millimetres, 0 unknown: discrete disparity, holes at edges, lost pixels."""
    disparities = np.rint((1 / depths + rng.normal(0, 0.5 * step, depths.shape)) / step) * step
    noisy = 1 / np.maximum(disparities, 1e-6)
    holes = rng.random(depths.shape) < 0.02
    for axis in (0, 1):
        edges = np.abs(np.diff(1 / depths, axis=axis)) > EDGE
        holes |= np.pad(edges, [(1, 0) if i == axis else (0, 0) for i in (0, 1)])
        holes |= np.pad(edges, [(0, 1) if i == axis else (0, 0) for i in (0, 1)])
    holes[:, 2:] |= holes[:, :-2]  # the projector's shadow
    noisy[holes | (noisy < NEAR) | (noisy > FAR)] = 0
    return np.rint(1000 * noisy).astype(np.uint16)


def walk(count: int, seconds: float, rng: np.random.Generator, hz: float = 10.0) -> list[list[Person]]:
    """Return the people of each image: they walk to and fro, each in a lane of its own."""
    lanes = rng.permutation(np.linspace(-1.0, 1.0, max(count, 2)))[:count] + rng.uniform(-0.1, 0.1, count)
    speeds, starts = rng.uniform(0.6, 1.3, count), rng.uniform(0, 12, count)
    heights = rng.uniform(1.55, 1.9, count)
    images = []
    for time in np.arange(round(seconds * hz)) / hz:
        ways = (starts + speeds * time) % 12
        away = ways < 6
        x = 1.5 + np.where(away, ways, 12 - ways)
        y = lanes + 0.1 * np.sin(time + np.arange(count))
        images.append([Person(*p) for p in np.stack([x, y, np.where(away, 0, np.pi), heights], 1).tolist()])
    return images


def walk_side_by_side(
    count: int, seconds: float, rng: np.random.Generator, hz: float = 10.0, gap: float = 0.5
) -> list[list[Person]]:
    """Return the people of each image: they walk to and fro side by side, `gap` metres from axis to axis."""
    heights = rng.uniform(1.55, 1.9, count)
    images = []
    for time in np.arange(round(seconds * hz)) / hz:
        way = (0.9 * time + 0.3) % 11
        x, middle = 1.8 + (way if way < 5.5 else 11 - way), 0.25 * np.sin(0.4 * time)
        direction = 0.0 if way < 5.5 else np.pi
        images.append(
            [
                Person(
                    x + 0.05 * np.sin(i + time), middle + (i - (count - 1) / 2) * gap, direction, heights[i]
                )
                for i in range(count)
            ]
        )
    return images
