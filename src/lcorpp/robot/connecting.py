"""Connect to the robot as its configuration says."""

from __future__ import annotations

from lcorpp.errors import ConnectionLostError
from lcorpp.robot.config import ConnectionConfig
from lcorpp.worlds.ros.connection import RosConnection


def connect(config: ConnectionConfig) -> RosConnection:
    """Return a connection of the configured kind.

    Raises:
        ConnectionLostError: the packages of the connection are missing, or nothing answers.
    """
    if config.kind == "rospy":
        from lcorpp.worlds.ros.rospy_connection import RospyConnection

        return RospyConnection()
    if config.kind == "rclpy":
        from lcorpp.worlds.ros.rclpy_connection import RclpyConnection

        return RclpyConnection()
    try:
        from lcorpp.worlds.ros.rosbridge import RosbridgeConnection
    except ImportError as error:
        raise ConnectionLostError(
            f"rosbridge needs the package {error.name}: pip install 'lcorpp[ros]'"
        ) from None
    return RosbridgeConnection(config.url, version=config.version, timeout=config.timeout)
