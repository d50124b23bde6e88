"""Motion features: displacement, speed, turning and directions of a person at each point of a track.

Each feature depends on the track up to its point only: on the point and the few points before it that
`TrackHistory` contains. A direction is stored as cosine and sine, which do not jump as an angle does; it is
(0, 0) if there is no direction: at the first point, and if the person stands still.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.features.gaze import compute_mutual_gaze, compute_social_engagement, is_looking
from lcorpp.values import CHANNELS, Array

Pose = tuple[float, float, float]
"""x and y in metres and heading in radians."""

ANGLES = ("heading", "facing")
"""The inputs that are angles, in radians, anticlockwise from the x axis of the tracks."""


MIN_SPEED = 0.1
"""m/s; below this speed a direction is noise, and the person counts as not turning."""

START_DISTANCE = 0.5
"""Metres from the first point, after which the direction in which a person starts is known."""


@dataclass(frozen=True, eq=False)
class TrackHistory:
    """What the features of points need of the tracks before them; NaN if there is no such point.

    first: (..., inputs, points or 1) the first point of each track.
    start: (..., inputs, points) the first point that is `START_DISTANCE` from the first one; until there is
        such a point, the point itself.
    previous, earlier: (..., inputs, points) the predecessor of each point, and the predecessor of that.
    """

    first: Array
    start: Array
    previous: Array
    earlier: Array

    @classmethod
    def of_tracks(cls, points: Array, inputs: Sequence[str]) -> TrackHistory:
        """Return the history of all points of whole tracks (..., inputs, points)."""
        first = points[..., :1]
        none = np.full_like(first, np.nan)
        previous = np.concatenate([none, points[..., :-1]], axis=-1)
        earlier = np.concatenate([none, previous[..., :-1]], axis=-1)
        is_far = _has_left(first, points, inputs)
        n = points.shape[-1]
        at = np.where(is_far.any(axis=-1), is_far.argmax(axis=-1), n)[..., None]
        start = np.take_along_axis(points, np.minimum(np.arange(n), at)[..., None, :], axis=-1)
        return cls(first, start, previous, earlier)

    def at(self, points: Array, inputs: Sequence[str]) -> TrackHistory:
        """Return the history of the next points (..., inputs, 1), given that `after` the points before."""
        first = np.where(np.isnan(self.first), points, self.first)
        is_known = _has_left(first, self.start, inputs)[..., None, :]
        return TrackHistory(first, np.where(is_known, self.start, points), self.previous, self.earlier)

    def after(self, points: Array) -> TrackHistory:
        """Return the history, which is that of `points`, once they are past."""
        return TrackHistory(self.first, self.start, points, self.previous)


def _has_left(first: Array, points: Array, inputs: Sequence[str]) -> npt.NDArray[np.bool_]:
    """(..., points) whether the points are `START_DISTANCE` from the first ones, if positions are inputs."""
    if not {"x", "y"}.issubset(inputs):
        return np.zeros(points[..., 0, :].shape, dtype=bool)
    x, y = (points[..., row, :] - first[..., row, :] for row in (inputs.index("x"), inputs.index("y")))
    return np.asarray(np.hypot(x, y) >= START_DISTANCE)


@dataclass(eq=False)
class TrackPoints:
    """Points of tracks in the robot's frame.

    points: (..., inputs, points). history: of the points.
    inputs: the names of the inputs. robot: the robot's pose in the frame of the tracks. rate: points per
        second.
    """

    points: Array
    history: TrackHistory
    inputs: Sequence[str]
    robot: Pose
    rate: float

    @cached_property
    def before(self) -> TrackPoints:
        """The predecessors of the points; a first point is its own predecessor."""
        past = self.history
        points = np.where(np.isnan(past.previous), self.points, past.previous)
        history = replace(past, previous=past.earlier, earlier=np.full_like(past.earlier, np.nan))
        return replace(self, points=points, history=history)

    @cached_property
    def displacement(self) -> Array:
        """(2, ..., points) vector from the first point, in metres, along the robot's axes."""
        return self._compute_vector(self.history.first, self.points)

    @cached_property
    def increment(self) -> Array:
        """(2, ..., points) vector from the previous point, in metres, along the robot's axes."""
        return self._compute_vector(self.before.points, self.points)

    @property
    def own_displacement(self) -> Array:
        """(2, ..., points) displacement ahead and to the left, as the person saw it at the start."""
        start = self._compute_vector(self.history.first, self.history.start)
        return _rotate_relative(self.displacement, _normalize(start))

    @cached_property
    def position(self) -> Array:
        """(2, ..., points) position relative to the robot: metres ahead of it and to its left."""
        return self._rotate(self.find("x") - self.robot[0], self.find("y") - self.robot[1])

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
    def direction_to_robot(self) -> Array:
        """(2, ..., points) direction from the person to the robot."""
        return _normalize(-self.position)

    @property
    def velocity(self) -> Array:
        """(1, ..., points) speed, m/s: measured, else length of the increment times the rate."""
        measured = "velocity" in self.inputs
        return (self.find("velocity") if measured else np.hypot(*self.increment) * self.rate)[None]

    @property
    def acceleration(self) -> Array:
        """(1, ..., points) change of speed, m/s²; 0 before there are two speeds."""
        change = (self.velocity - self.before.velocity) * self.rate
        has_two = "velocity" in self.inputs or ~np.isnan(self.history.earlier[..., 0, :])
        return np.asarray(np.where(has_two, change, 0.0 * change))  # the padding of a short track stays NaN

    @property
    def turn_rate(self) -> Array:
        """(1, ..., points) change of heading, rad/s anticlockwise; 0 while standing."""
        is_standing = np.minimum(self.velocity, self.before.velocity) <= MIN_SPEED
        rate = _compute_angle(self.heading, self.before.heading) * self.rate
        return np.asarray(np.where(is_standing, 0.0, rate))

    @property
    def distance(self) -> Array:
        """(1, ..., points) metres from the robot."""
        distance: Array = np.hypot(*self.position)
        return distance[None]

    @property
    def mutual_gaze(self) -> Array:
        """(1, ..., points) how much person and robot look at each other, from 0 to 1."""
        return compute_mutual_gaze(self.find("gaze_angle"), self.find("robot_angle"))[None]

    @property
    def social_engagement(self) -> Array:
        """(1, ..., points) mutual gaze over distance, from 0 to 1."""
        angles = self.find("gaze_angle"), self.find("robot_angle")
        return compute_social_engagement(*angles, self.find("face_distance"))[None]

    def compute_change(self, name: str) -> Array:
        """(1, ..., points) the change of an input since the previous point, per second."""
        return ((self.find(name) - self.before.find(name)) * self.rate)[None]

    def find(self, name: str) -> Array:
        """(..., points) the input of this name."""
        return self.points[..., self.inputs.index(name), :]

    def _compute_vector(self, start: Array, end: Array) -> Array:
        rows = [self.inputs.index("x"), self.inputs.index("y")]
        return self._rotate(*(end[..., row, :] - start[..., row, :] for row in rows))

    def _compute_direction(self, name: str) -> Array:
        relative = self.find(name) - self.robot[2]
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


def _compute_angle(direction: Array, reference: Array) -> Array:
    """(1, ...) the angle from a reference to a direction in [-pi, pi], 0 if one of them is (0, 0)."""
    cosine, sine = _rotate_relative(direction, reference)
    angle: Array = np.arctan2(sine, cosine)
    return angle[None]


_XY = {"x", "y"}

MOTION_FEATURES = {
    "x": MotionFeature(lambda p: p.displacement[:1], (_XY,)),
    "y": MotionFeature(lambda p: p.displacement[1:], (_XY,)),
    "velocity": MotionFeature(lambda p: p.velocity, ({"velocity"}, _XY)),
    "heading": MotionFeature(lambda p: p.heading, ({"heading"}, _XY), is_direction=True),
    "facing": MotionFeature(lambda p: p.facing, ({"facing"},), is_direction=True),
    "acceleration": MotionFeature(lambda p: p.acceleration, ({"velocity"}, _XY)),
    "turn_rate": MotionFeature(lambda p: p.turn_rate, ({"velocity", "heading"}, _XY)),
    "ahead": MotionFeature(lambda p: p.own_displacement[:1], (_XY,)),
    "left": MotionFeature(lambda p: p.own_displacement[1:], (_XY,)),
    "facing_ahead": MotionFeature(
        lambda p: _rotate_relative(p.facing, p.heading),
        ({"heading", "facing"}, {*_XY, "facing"}),
        is_direction=True,
    ),
    "approach": MotionFeature(
        lambda p: _rotate_relative(p.heading, p.direction_to_robot), (_XY,), is_direction=True
    ),
    "attention": MotionFeature(
        lambda p: _rotate_relative(p.facing, p.direction_to_robot), ({*_XY, "facing"},), is_direction=True
    ),
    "distance": MotionFeature(lambda p: p.distance, (_XY,)),
    "distance_rate": MotionFeature(lambda p: (p.distance - p.before.distance) * p.rate, (_XY,)),
    "bearing": MotionFeature(lambda p: _normalize(p.position), (_XY,), is_direction=True),
    "bearing_rate": MotionFeature(lambda p: _compute_angle(p.position, p.before.position) * p.rate, (_XY,)),
    "gaze_angle": MotionFeature(lambda p: p.find("gaze_angle")[None], ({"gaze_angle"},)),
    "gaze_rate": MotionFeature(lambda p: p.compute_change("gaze_angle"), ({"gaze_angle"},)),
    "looks": MotionFeature(lambda p: is_looking(p.find("gaze_angle"))[None], ({"gaze_angle"},)),
    "mutual_gaze": MotionFeature(lambda p: p.mutual_gaze, ({"gaze_angle", "robot_angle"},)),
    "social_engagement": MotionFeature(
        lambda p: p.social_engagement, ({"gaze_angle", "robot_angle", "face_distance"},)
    ),
    "face_distance": MotionFeature(lambda p: p.find("face_distance")[None], ({"face_distance"},)),
    "face_distance_rate": MotionFeature(lambda p: p.compute_change("face_distance"), ({"face_distance"},)),
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
