"""Explain a foreground mask by people on the floor, each a box of human size in the image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcorpp.camera.ground_camera import GroundCamera
from lcorpp.values import Array

Mask = npt.NDArray[np.bool_]
Integral = npt.NDArray[np.int32]
Box = tuple[slice, slice]

HEIGHT, RADIUS = 1.75, 0.25
"""Of a person in metres: a cylinder, whose bounding box in the image has the width of the shoulders."""

MIN_PIXELS = 10
"""Boxes of people that are lower than this are too small to be told from noise."""

MIN_VISIBLE = 0.4
"""Minimum share of a box inside of the image."""

CELLS = 8
"""Candidates of a box's height are this part of it, or half of it, apart."""

FILL = 0.4
"""Share of a box in the foreground above which it is more probably a person: people fill .5 to .6."""

RING, RING_WEIGHT = 0.12, 0.3
"""Width of the ring around a box, as share of the box, and the weight of its foreground, which speaks against
the box: the person is larger, i.e. nearer."""

MIN_SCORE = 0.08
"""Minimum score of a person, per pixel of the box: the foreground above `FILL`, less the ring."""

MAX_PEOPLE = 50
"""Maximum number of people in an image."""

OFFSETS = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 5), np.linspace(-0.5, 0.5, 5)), axis=-1).reshape(-1, 2)
"""(25, 2) refinement of a candidate, in distances of candidates."""


@dataclass(frozen=True, eq=False)
class Person:
    """A person in an image.

    foot: (2,) column and row in pixels of the image. box: rows and columns of the person in the mask.
    surroundings: those of the box and its ring.
    """

    foot: Array
    box: Box
    surroundings: Box


class OccupancySearch:
    """Search the people who explain a foreground mask best.

    Candidates are boxes of people at points of the floor, dense compared with their size. The best one is a
    person, the foreground inside of it is explained and left out, and so on while the score is high enough.
    So people who overlap or touch in the image are separated if their boxes are.

    Args:
        camera: of the image. size: width and height of the mask, a reduced image.

    Attributes:
        feet: (n, 2) the candidates, in pixels of the image.

    Source: after Fleuret, Berclaz, Lengagne and Fua, Multicamera People Tracking with a Probabilistic
    Occupancy Map, PAMI 2008 (boxes on the floor, integral images); the search here is greedy.
    """

    def __init__(self, camera: GroundCamera, size: tuple[int, int]) -> None:
        width, height = camera.size
        scale = size[0] / width
        self._camera, self._scale, self._shape = camera, scale, (size[1], size[0])
        feet, steps = [], []
        step = 2 / scale
        while step < max(camera.size):
            columns = np.arange(-0.1 * width, 1.1 * width, step)
            rows = np.arange(0, 1.5 * height, step)
            lattice = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
            boxes, visible = self._find_boxes(lattice)
            heights = boxes[:, 3] - boxes[:, 1]
            finest = step == 2 / scale
            fits = (heights < 2 * CELLS * step * scale) & (finest | (heights >= CELLS * step * scale))
            kept = fits & (heights >= MIN_PIXELS) & (visible >= MIN_VISIBLE)
            feet.append(lattice[kept])
            steps.append(np.full(int(kept.sum()), step))
            step *= 2
        self.feet, self._steps = np.concatenate(feet), np.concatenate(steps)
        self._candidates = _Boxes(self._find_boxes(self.feet)[0], self._shape)

    def search(self, foreground: Mask) -> list[Person]:
        """Return the people in a mask, the best first."""
        rest = foreground.copy()
        people: list[Person] = []
        promising = np.flatnonzero(self._candidates.bound(_integrate(rest)) > 0)
        candidates = self._candidates.take(promising)
        while len(promising) and len(people) < MAX_PEOPLE:
            integral = _integrate(rest)
            scores = candidates.score(integral)
            best = int(np.argmax(scores))
            if scores[best] <= 0:
                break
            near = self.feet[promising[best]] + OFFSETS * self._steps[promising[best]]
            boxes = self._find_boxes(near)[0]
            nearest = int(np.argmax(_Boxes(boxes, self._shape).score(integral)))
            box = boxes[nearest : nearest + 1]
            people.append(Person(near[nearest], _slices(box[0]), _slices(_widen(box)[0])))
            rest[people[-1].box] = False
        return people

    def _find_boxes(self, feet: Array) -> tuple[Array, Array]:
        """Return (n, 4) left, top, right, bottom of people, in pixels of the mask, and the visible shares."""
        points = self._camera.to_metres(feet)
        corners = np.array([(RADIUS, 0), (-RADIUS, 0), (0, RADIUS), (0, -RADIUS)])
        rim = np.stack([points + corner for corner in corners])
        body = np.concatenate([np.pad(rim, ((0, 0), (0, 0), (0, 1)), constant_values=z) for z in (0, HEIGHT)])
        pixels = self._camera.project(body) * self._scale
        boxes = np.nan_to_num(np.concatenate([pixels.min(axis=0), pixels.max(axis=0)], axis=1), nan=-1.0)
        areas = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1)
        return boxes, _Boxes(boxes, self._shape).areas / np.maximum(areas, 1)


class _Boxes:
    """The places in an integral image, (height + 1) x (width + 1) numbers, of the corners of boxes and rings.

    areas: (n,) pixels of each box that are inside of the image.
    """

    def __init__(self, boxes: Array, shape: tuple[int, int]) -> None:
        self._inside, self.areas = _find_corners(boxes, shape)
        self._around, _ = _find_corners(_widen(boxes), shape)

    def take(self, rows: npt.NDArray[np.intp]) -> _Boxes:
        """Return some of the boxes."""
        taken = object.__new__(_Boxes)
        taken._inside, taken._around, taken.areas = (
            self._inside[:, rows],
            self._around[:, rows],
            self.areas[rows],
        )
        return taken

    def bound(self, integral: Integral) -> Array:
        """Return (n,) upper bounds on the scores, now and when more of the foreground is left out."""
        bounds: Array = _sum_corners(integral, self._inside) - (FILL + MIN_SCORE) * self.areas
        return bounds

    def score(self, integral: Integral) -> Array:
        """Return (n,) scores, above 0 for a person."""
        filled = _sum_corners(integral, self._inside)
        ring = _sum_corners(integral, self._around) - filled
        scores: Array = filled - (FILL + MIN_SCORE) * self.areas - RING_WEIGHT * ring
        return scores


def _widen(boxes: Array) -> Array:
    """Return the boxes with their rings."""
    margin = RING * (boxes[:, 2:] - boxes[:, :2]) * (2.0, 1.0)
    return np.concatenate([boxes[:, :2] - margin, boxes[:, 2:] + margin], axis=1)


def _integrate(mask: Mask) -> Integral:
    integral = np.zeros((mask.shape[0] + 1, mask.shape[1] + 1), dtype=np.int32)
    np.cumsum(mask, axis=0, dtype=np.int32, out=integral[1:, 1:])
    np.cumsum(integral[1:, 1:], axis=1, out=integral[1:, 1:])
    return integral


def _find_corners(boxes: Array, shape: tuple[int, int]) -> tuple[npt.NDArray[np.intp], Array]:
    """Return (4, n) flat indices of the corners of boxes in an integral image, and the areas inside of it."""
    height, width = shape
    clipped = np.clip(np.rint(boxes), 0, (width, height, width, height)).astype(np.intp)
    left, top, right, bottom = clipped.T
    pairs = ((bottom, right), (top, right), (bottom, left), (top, left))
    corners = np.stack([row * (width + 1) + column for row, column in pairs])
    return corners, ((right - left) * (bottom - top)).astype(np.float64)


def _sum_corners(integral: Integral, corners: npt.NDArray[np.intp]) -> Integral:
    """Return (n,) sums over boxes."""
    lower_right, upper_right, lower_left, upper_left = integral.ravel()[corners]
    total: Integral = lower_right - upper_right - lower_left + upper_left
    return total


def _slices(box: Array) -> Box:
    left, top, right, bottom = np.maximum(np.rint(box), 0).astype(int).tolist()
    return slice(top, bottom), slice(left, right)
