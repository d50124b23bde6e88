"""What a classifier may be told of a person at a point of a track: place, speed, directions.

Each channel is made from the track so far, so it is the same however the track goes on. A direction is two
numbers, its cosine and its sine, which do not jump where an angle does, and (0, 0) where there is none: at
the first point, and where somebody stands still.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lcorpp.errors import DataError, expected_one_of
from lcorpp.values import CHANNELS as INPUTS, Array

Pose = tuple[float, float, float]
"""x and y in metres and heading in radians."""

ANGLES = ("heading", "facing")
"""The inputs that are angles, in radians, anticlockwise from the x axis of the tracks."""


class Points:
    """Successive points of tracks, seen from the robot.

    now, before, first: (..., inputs, points) the points, the one before each, and the first of each track;
        for a first point `before` is the point itself.
    """

    def __init__(
        self, now: Array, before: Array, first: Array, *, inputs: Sequence[str], robot: Pose, rate: float
    ) -> None:
        self.now, self.before, self.first = now, before, first
        self.robot, self.rate = robot, rate
        self._row = {name: index for index, name in enumerate(inputs)}

    def measured(self, name: str) -> Array | None:
        """(..., points) an input, None where it was not measured."""
        return self.now[..., self._row[name], :] if name in self._row else None

    @cached_property
    def way(self) -> Array:
        """(2, ..., points) from the first point to here, in metres, along the robot's axes."""
        return self._since(self.first)

    @cached_property
    def step(self) -> Array:
        """(2, ..., points) from the point before to here, in metres, along the robot's axes."""
        return self._since(self.before)

    @cached_property
    def place(self) -> Array:
        """(2, ..., points) where the robot sees the person: metres ahead and to the left of it."""
        x, y = (self.now[..., self._row[name], :] for name in ("x", "y"))
        return self._turned(x - self.robot[0], y - self.robot[1])

    def heading(self) -> Array:
        """(2, ..., points) the direction of motion: as measured, or else from the point before to here."""
        angle = self.measured("heading")
        return _unit(self.step) if angle is None else self._direction(angle)

    def facing(self) -> Array:
        """(2, ..., points) the direction in which the body or head is turned, as measured."""
        angle = self.measured("facing")
        assert angle is not None  # `check_channels`
        return self._direction(angle)

    def velocity(self) -> Array:
        """(1, ..., points) the speed, m/s: as measured, or else over the way from the point before."""
        speed = self.measured("velocity")
        return (np.hypot(*self.step) * self.rate if speed is None else speed)[None]

    def _since(self, other: Array) -> Array:
        x, y = self._row["x"], self._row["y"]
        return self._turned(self.now[..., x, :] - other[..., x, :], self.now[..., y, :] - other[..., y, :])

    def _direction(self, angle: Array) -> Array:
        seen = angle - self.robot[2]
        return np.stack([np.cos(seen), np.sin(seen)])

    def _turned(self, x: Array, y: Array) -> Array:
        cosine, sine = np.cos(self.robot[2]), np.sin(self.robot[2])
        return np.stack([cosine * x + sine * y, cosine * y - sine * x])


@dataclass(frozen=True)
class Channel:
    """One thing to be told: its rows, how it is made, and the inputs without which it cannot be.

    rows: the names of its numbers. of: from points to (rows, ..., points). needs: sets of inputs, any of
    which will do.
    """

    rows: tuple[str, ...]
    of: Callable[[Points], Array]
    needs: tuple[frozenset[str], ...]


def _unit(vector: Array) -> Array:
    """(2, ...) of length 1, or (0, 0) where there is no length."""
    length = np.hypot(vector[0], vector[1])
    unit: Array = vector / np.where(length > 0, length, 1.0)
    return unit


def _relative(direction: Array, reference: Array) -> Array:
    """A direction counted anticlockwise from another one, both (2, ...) of length 1 or 0."""
    (dx, dy), (rx, ry) = direction, reference
    return np.stack([rx * dx + ry * dy, rx * dy - ry * dx])


_PLACE = frozenset({"x", "y"})
_TWO = ("cos", "sin")

CHANNELS = {
    "x": Channel(("x",), lambda p: p.way[:1], (_PLACE,)),
    "y": Channel(("y",), lambda p: p.way[1:], (_PLACE,)),
    "velocity": Channel(("velocity",), Points.velocity, (frozenset({"velocity"}), _PLACE)),
    "heading": Channel(
        tuple(f"heading_{part}" for part in _TWO), Points.heading, (frozenset({"heading"}), _PLACE)
    ),
    "facing": Channel(tuple(f"facing_{part}" for part in _TWO), Points.facing, (frozenset({"facing"}),)),
    "approach": Channel(
        tuple(f"approach_{part}" for part in _TWO),
        lambda p: _relative(p.heading(), _unit(-p.place)),
        (_PLACE,),
    ),
    "attention": Channel(
        tuple(f"attention_{part}" for part in _TWO),
        lambda p: _relative(p.facing(), _unit(-p.place)),
        (_PLACE | {"facing"},),
    ),
    "distance": Channel(("distance",), lambda p: np.hypot(*p.place)[None], (_PLACE,)),
    "bearing": Channel(tuple(f"bearing_{part}" for part in _TWO), lambda p: _unit(p.place), (_PLACE,)),
}
"""Every channel by its name; `Motion` says in words what each is."""


def check_channels(channels: Sequence[str], inputs: Sequence[str]) -> None:
    """Return if `channels` can be made from `inputs`.

    Raises:
        DataError: a name is unknown or given twice, none is given, or an input that is needed is missing.
    """
    for what, names, known in (("channel", channels, tuple(CHANNELS)), ("input", inputs, INPUTS)):
        if isinstance(names, str) or not isinstance(names, Sequence) or not names:
            raise DataError(
                f"{what}s are given as a sequence of names, not {names!r}; {expected_one_of(known)}"
            )
        for name in names:
            if name not in known:
                raise DataError(f"unknown {what} {name!r}; {expected_one_of(known)}")
        if len(set(names)) < len(names):
            raise DataError(f"the {what}s are {', '.join(names)}; expected every name once")
    for name in channels:
        needs = CHANNELS[name].needs
        if not any(need <= set(inputs) for need in needs):
            wanted = " or ".join(" and ".join(n for n in INPUTS if n in need) for need in needs)
            raise DataError(f"channel {name!r} needs the input {wanted}; the inputs are {', '.join(inputs)}")


def rows_of(channels: Sequence[str]) -> tuple[str, ...]:
    """The names of the numbers that the channels give, in their order."""
    return tuple(row for name in channels for row in CHANNELS[name].rows)


def told(channels: Sequence[str], points: Points) -> Array:
    """(..., rows, points) what the channels tell of the points; rows as `rows_of`."""
    return np.moveaxis(np.concatenate([CHANNELS[name].of(points) for name in channels]), 0, -2)
