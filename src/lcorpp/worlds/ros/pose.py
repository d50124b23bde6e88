"""Pose of the robot on the floor, and points relative to it."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, isfinite, pi, sin

from lcorpp.errors import WorldError


@dataclass(frozen=True)
class Pose:
    """Position in metres and heading in radians, counterclockwise from the x axis, of a frame.

    Raises:
        WorldError: a number is not finite.
    """

    x: float
    y: float
    heading: float

    def __post_init__(self) -> None:
        if not all(map(isfinite, (self.x, self.y, self.heading))):
            raise WorldError(f"the pose {self.x} {self.y} {self.heading}; expected finite numbers")

    def relate(self, x: float, y: float, heading: float = 0.0) -> tuple[float, float]:
        """Return a point of the frame in the coordinates of this pose, in which it faces `heading`.

        With heading 0, x is ahead and y to the left (ROS REP 103).
        """
        turn = heading - self.heading
        dx, dy = x - self.x, y - self.y
        return cos(turn) * dx - sin(turn) * dy, sin(turn) * dx + cos(turn) * dy

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Return a point that is x metres ahead and y to the left in the coordinates of the frame."""
        ahead, left = cos(self.heading), sin(self.heading)
        return self.x + ahead * x - left * y, self.y + left * x + ahead * y

    def face(self, x: float, y: float) -> float:
        """Return the angle in (-pi, pi] by which to turn to a point of the frame."""
        turn = atan2(y - self.y, x - self.x) - self.heading
        return pi - (pi - turn) % (2 * pi)

    def quaternion(self) -> dict[str, float]:
        """Return the heading as geometry_msgs/Quaternion."""
        return {"x": 0.0, "y": 0.0, "z": sin(self.heading / 2), "w": cos(self.heading / 2)}
