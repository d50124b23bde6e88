"""Motion features: displacement, speed and directions of a person at each point of a track.

Each feature depends on the track up to its point only. A direction is stored as cosine and sine, which do not
jump as an angle does; it is (0, 0) if there is no direction: at the first point, and if the person stands
still.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lcorpp.errors import DataError, expected_one_of
from lcorpp.values import CHANNELS, Array

Pose = tuple[float, float, float]
"""x and y in metres and heading in radians."""

ANGLES = ("heading", "facing")
"""The inputs that are angles, in radians, anticlockwise from the x axis of the tracks."""


@dataclass(eq=False)
class TrackPoints:
    """Consecutive points of tracks in the robot's frame.

    points, previous: (..., inputs, points) the points, and the predecessor of each; a first point is its own
        predecessor. first: (..., inputs, points or 1) the first point of each track.
    inputs: the names of the inputs. robot: the robot's pose in the frame of the tracks. rate: points per
        second.
    """

    points: Array
    previous: Array
    first: Array
    inputs: Sequence[str]
    robot: Pose
    rate: float

    @cached_property
    def displacement(self) -> Array:
        """(2, ..., points) vector from the first point, in metres, along the robot's axes."""
        return self._compute_vector_from(self.first)

    @cached_property
    def increment(self) -> Array:
        """(2, ..., points) vector from the previous point, in metres, along the robot's axes."""
        return self._compute_vector_from(self.previous)

    @cached_property
    def position(self) -> Array:
        """(2, ..., points) position relative to the robot: metres ahead of it and to its left."""
        return self._rotate(self._find("x") - self.robot[0], self._find("y") - self.robot[1])

    @property
    def heading(self) -> Array:
        """(2, ..., points) direction of motion: measured, else that of the increment."""
        measured = "heading" in self.inputs
        return self._compute_direction("heading") if measured else _normalize(self.increment)

    @property
    def facing(self) -> Array:
        """(2, ..., points) measured direction of the body or head."""
        return self._compute_direction("facing")

    @property
    def velocity(self) -> Array:
        """(1, ..., points) speed, m/s: measured, else length of the increment times the rate."""
        measured = "velocity" in self.inputs
        return (self._find("velocity") if measured else np.hypot(*self.increment) * self.rate)[None]

    def _find(self, name: str) -> Array:
        """(..., points) the input of this name."""
        return self.points[..., self.inputs.index(name), :]

    def _compute_vector_from(self, other: Array) -> Array:
        rows = [self.inputs.index("x"), self.inputs.index("y")]
        return self._rotate(*(self.points[..., row, :] - other[..., row, :] for row in rows))

    def _compute_direction(self, name: str) -> Array:
        relative = self._find(name) - self.robot[2]
        return np.stack([np.cos(relative), np.sin(relative)])

    def _rotate(self, x: Array, y: Array) -> Array:
        """(2, ..., points) a vector along the axes of the tracks, rotated to the axes of the robot."""
        cosine, sine = np.cos(self.robot[2]), np.sin(self.robot[2])
        return np.stack([cosine * x + sine * y, cosine * y - sine * x])


@dataclass(frozen=True)
class MotionFeature:
    """One feature of motion.

    compute: points -> (rows, ..., points): one row, or cosine and sine of a direction.
    needs: alternative sets of inputs; the feature needs all inputs of one of them.
    """

    compute: Callable[[TrackPoints], Array]
    needs: tuple[set[str], ...]
    is_direction: bool = False


def _normalize(vector: Array) -> Array:
    """(2, ...) scaled to length 1; a zero vector stays (0, 0)."""
    length = np.hypot(vector[0], vector[1])
    unit: Array = vector / np.where(length > 0, length, 1.0)
    return unit


def _rotate_relative(direction: Array, reference: Array) -> Array:
    """(2, ...) a direction measured anticlockwise from a reference; both are (2, ...) of length 1 or 0."""
    (dx, dy), (rx, ry) = direction, reference
    return np.stack([rx * dx + ry * dy, rx * dy - ry * dx])


_XY = {"x", "y"}

MOTION_FEATURES = {
    "x": MotionFeature(lambda p: p.displacement[:1], (_XY,)),
    "y": MotionFeature(lambda p: p.displacement[1:], (_XY,)),
    "velocity": MotionFeature(lambda p: p.velocity, ({"velocity"}, _XY)),
    "heading": MotionFeature(lambda p: p.heading, ({"heading"}, _XY), is_direction=True),
    "facing": MotionFeature(lambda p: p.facing, ({"facing"},), is_direction=True),
    "approach": MotionFeature(
        lambda p: _rotate_relative(p.heading, _normalize(-p.position)), (_XY,), is_direction=True
    ),
    "attention": MotionFeature(
        lambda p: _rotate_relative(p.facing, _normalize(-p.position)), ({*_XY, "facing"},), is_direction=True
    ),
    "distance": MotionFeature(lambda p: np.hypot(*p.position)[None], (_XY,)),
    "bearing": MotionFeature(lambda p: _normalize(p.position), (_XY,), is_direction=True),
}
"""The motion features by name; the docstring of `Motion` describes each."""


def check_features(features: Sequence[str], inputs: Sequence[str]) -> None:
    """Check that `features` can be computed from `inputs`.

    Raises:
        DataError: a name is unknown or repeated, a list is empty, or a feature lacks an input.
    """
    for kind, names, known in (("feature", features, tuple(MOTION_FEATURES)), ("input", inputs, CHANNELS)):
        if isinstance(names, str) or not isinstance(names, Sequence) or not names:
            raise DataError(
                f"{kind}s must be a non-empty sequence of names, not {names!r}; {expected_one_of(known)}"
            )
        for name in names:
            if name not in known:
                raise DataError(f"unknown {kind} {name!r}; {expected_one_of(known)}")
        if len(set(names)) < len(names):
            raise DataError(f"the {kind}s are {', '.join(names)}; expected every name once")
    for name in features:
        needs = MOTION_FEATURES[name].needs
        if not any(need <= set(inputs) for need in needs):
            alternatives = " or ".join(" and ".join(n for n in CHANNELS if n in need) for need in needs)
            raise DataError(
                f"feature {name!r} needs the input {alternatives}; the inputs are {', '.join(inputs)}"
            )


def list_feature_rows(features: Sequence[str]) -> tuple[str, ...]:
    """The names of the numbers that the features consist of, in order."""
    rows: list[str] = []
    for name in features:
        rows += [f"{name}_cos", f"{name}_sin"] if MOTION_FEATURES[name].is_direction else [name]
    return tuple(rows)


def compute_features(features: Sequence[str], points: TrackPoints) -> Array:
    """(..., rows, points) the features of the points; rows as in `list_feature_rows`."""
    return np.moveaxis(np.concatenate([MOTION_FEATURES[name].compute(points) for name in features]), 0, -2)
