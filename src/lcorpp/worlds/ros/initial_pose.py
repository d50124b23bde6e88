"""The initial pose that a person gives the robot's localisation, as RViz does."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

from lcorpp.worlds.ros.connection import RosConnection
from lcorpp.worlds.ros.pose import Pose

TOPIC, KIND = "/initialpose", "geometry_msgs/PoseWithCovarianceStamped"
"""Where AMCL and others take it, and its type."""

LOCALISATIONS = ("geometry_msgs/PoseWithCovarianceStamped", "geometry_msgs/PoseStamped")
"""Types of the messages of a localisation, which takes an initial pose; odometry has none."""

VARIANCES = (0.25, 0.25, 0.0685)
"""Variances of x and y in m^2 and of the heading in rad^2: those that RViz sends, .5 m and 15 degrees."""

MAX_DISTANCE, MAX_TURN = 1.0, 0.6
"""A pose within these metres and radians is one that the localisation has found from the initial pose."""

PERIOD = 1.0
"""Seconds after which it is sent again: a subscriber that ROS has not found yet gets no message."""


@dataclass(frozen=True)
class InitialPose:
    """A pose in the fixed frame from which the localisation begins.

    topic: that the localisation subscribes to.
    """

    pose: Pose
    topic: str = TOPIC

    def publish(self, connection: RosConnection, frame: str) -> None:
        """Send the pose; frame: the fixed one."""
        covariance = [0.0] * 36  # of x, y, z and the turns around them, row by row
        for place, variance in zip((0, 7, 35), VARIANCES, strict=True):
            covariance[place] = variance
        position = {"x": self.pose.x, "y": self.pose.y, "z": 0.0}
        pose = {"position": position, "orientation": self.pose.quaternion()}
        message = {"header": {"frame_id": frame}, "pose": {"pose": pose, "covariance": covariance}}
        connection.publish(self.topic, KIND, message)

    def is_reached(self, pose: Pose) -> bool:
        """Return whether a pose of the localisation is near this one."""
        turn = abs(Pose(0.0, 0.0, pose.heading - self.pose.heading).face(1.0, 0.0))
        return hypot(pose.x - self.pose.x, pose.y - self.pose.y) <= MAX_DISTANCE and turn <= MAX_TURN
