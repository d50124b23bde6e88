"""Frames of a robot as a tree, from the messages of tf2: where one frame is in another."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import hypot
from typing import Any

import numpy as np

from lcorpp.errors import WorldError
from lcorpp.values import Array
from lcorpp.worlds.ros.connection import Message
from lcorpp.worlds.ros.fields import FaultLog, name_kind, read_field, read_list, read_number, read_text_field

TRANSFORMS = "tf2_msgs/TFMessage"
"""The type of messages with frames."""

UNIT_TOLERANCE = 0.01
"""Difference from 1 that the length of a quaternion may have, as in tf2."""

MAX_DEPTH = 100
"""Frames on the way to the root of a tree; more are a loop."""


@dataclass(frozen=True, eq=False)
class Transform:
    """A frame in another one, its parent: a point p of the frame is rotation @ p + translation in the parent.

    rotation: (3, 3). translation: (3,) metres.
    """

    rotation: Array
    translation: Array

    def __matmul__(self, other: Transform) -> Transform:
        """Return a frame of this frame, in the parent of this one."""
        return Transform(self.rotation @ other.rotation, self.place(other.translation))

    def place(self, point: Array) -> Array:
        """(3,) a point of the frame in the parent."""
        return np.asarray(self.rotation @ point + self.translation)

    @cached_property
    def inverse(self) -> Transform:
        """The parent in the frame."""
        return Transform(self.rotation.T, -self.rotation.T @ self.translation)


IDENTITY = Transform(np.eye(3), np.zeros(3))


class TransformTree:
    """The latest transform of each frame in its parent.

    Args:
        place: the topic or file that warnings name.

    Examples:
        >>> from lcorpp.worlds.ros.transforms import TransformTree
        >>> tree = TransformTree("/tf")
        >>> turn = {"x": 0.0, "y": 0.0, "z": 1.0, "w": 0.0}  # half a turn to the left
        >>> ahead = {"translation": {"x": 2.0, "y": 0.0, "z": 0.0}, "rotation": turn}
        >>> link = {"header": {"frame_id": "base_link"}, "child_frame_id": "camera_link", "transform": ahead}
        >>> tree.add({"transforms": [link]})
        >>> tree.find("base_link", "camera_link").translation.round(1).tolist()  # the robot, two metres ahead
        [2.0, 0.0, 0.0]
    """

    def __init__(self, place: str) -> None:
        self._faults = FaultLog(place)
        self._links = dict[str, tuple[str, Transform]]()  # frame -> parent, transform

    def __contains__(self, frame: str) -> bool:
        return frame in self._links

    def add(self, message: Message) -> None:
        """Take the frames of a message; a transform that cannot be read is left out, with a warning."""
        try:
            items = read_list(message, "transforms")
        except WorldError as fault:
            self._faults.warn(f"a message that is not {TRANSFORMS} is left out: {fault}")
            return
        for item in items:
            self.add_transform(item)

    def add_transform(self, item: Any) -> None:
        """Take one frame, a geometry_msgs/TransformStamped; as `add`."""
        try:
            child = read_frame(item, "child_frame_id")
            self.forget(child)  # the last transform is old, also if this one cannot be read
            parent = read_frame(item, "header", "frame_id")
            if child == parent:
                raise WorldError(f"the frame {child!r} is its own parent")
            self._links[child] = parent, read_transform(read_field(item, "transform"), child)
        except WorldError as fault:
            self._faults.warn(f"a transform is left out: {fault}", name_kind(str(fault)))

    def forget(self, frame: str) -> None:
        """Remove a frame."""
        self._links.pop(frame, None)

    def find(self, frame: str, target: str) -> Transform | None:
        """Return a frame in another one; None if they are not connected."""
        if frame == target:
            return IDENTITY
        to_target = dict(self._climb(target))
        for ancestor, transform in self._climb(frame):
            if ancestor in to_target:
                return to_target[ancestor].inverse @ transform
        return None

    def _climb(self, frame: str) -> Iterator[tuple[str, Transform]]:
        """Yield each frame from this one to the root, with this frame in it."""
        transform = IDENTITY
        yield frame, transform
        for _ in range(MAX_DEPTH):
            if frame not in self._links:
                return
            frame, link = self._links[frame]
            transform = link @ transform
            yield frame, transform
        self._faults.warn(f"the frames above {frame!r} are a loop", "loop")


def read_frame(message: Any, *names: str) -> str:
    """Return the name of a frame.

    Raises:
        WorldError: it is missing, no text or empty.
    """
    name = read_text_field(message, *names).lstrip("/")
    if not name:
        raise WorldError(f"the field {'.'.join(names)!r} is empty; expected the name of a frame")
    return name


def read_point(message: Any, *names: str) -> Array:
    """(3,) the fields x, y and z.

    Raises:
        WorldError: a field is missing, no number or not finite.
    """
    point = np.array([read_number(message, *names, axis) for axis in "xyz"])
    if not np.isfinite(point).all():
        raise WorldError(f"{'.'.join(names)} is {point.tolist()}; expected finite numbers")
    return point


def read_transform(message: Any, frame: str) -> Transform:
    """Return the transform in a geometry_msgs/Transform.

    Args:
        frame: the name of the frame, for messages.

    Raises:
        WorldError: a field is missing or not finite, or the quaternion has not length 1.
    """
    numbers = [read_number(message, "rotation", axis) for axis in "xyzw"]
    length = hypot(*numbers)
    if not abs(length - 1) <= UNIT_TOLERANCE:  # also NaN
        raise WorldError(
            f"the quaternion {[round(n, 3) for n in numbers]} of the frame {frame!r} has length {length:.3g};"
            " expected 1"
        )
    x, y, z, w = (n / length for n in numbers)
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    return Transform(rotation, read_point(message, "translation"))


def is_optical(frame: str) -> bool:
    """Return whether a frame is that of a camera's image (REP 103): z ahead, x to the right, y down."""
    return frame.endswith(("_optical_frame", "_optical"))


def to_body_axes(vector: Array, frame: str) -> Array:
    """(3,) a vector of a frame along x ahead, y to the left and z up."""
    if not is_optical(frame):
        return vector
    right, down, ahead = vector
    return np.array([ahead, -right, -down])
