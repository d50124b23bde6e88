"""A robot whose senses have trackers of their own: people whom only one of them detects."""

from math import sin

import pytest

from lcorpp.decision.strategies import LCORPP
from lcorpp.errors import DomainError
from lcorpp.robot.connecting import connect
from lcorpp.robot.loop import RobotLoop
from lcorpp.robot.reading import read_robot_config
from lcorpp.worlds.ros.pose import Pose
from tests.worlds.ros.stand_in import BASE, StandIn, robot_toml
from tests.worlds.ros.test_laser_scan import RADIUS, message, scan

LASER = '[people.senses.motion]\ntopic = "/scan"\ntype = "sensor_msgs/msg/LaserScan"\nmounting = [0.1, 0, 0]'


class StandInWithLaser(StandIn):
    """A person walks to and fro ahead of the laser scanner, from scan to scan, whatever the clock shows."""

    n_scans = 0

    def publish_once(self):
        super().publish_once()
        self.n_scans += 1
        seconds = self.n_scans / 20
        ahead = 2.5 + 0.7 * sin(seconds)
        legs = [(ahead, 0.15, RADIUS), (ahead, -0.15, RADIUS)]
        self.server.publish("/scan", message(1000 + seconds, scan(legs)))


def decide_once(folder, parts, stand_in):
    file = folder / "robot.toml"
    file.write_text(robot_toml(stand_in.url, people=BASE["people"] + "\n" + LASER))
    config, _ = read_robot_config(file)
    connection = connect(config.connection)
    try:
        (decision,) = RobotLoop(config, *parts, LCORPP, connection).run(1)
    finally:
        connection.close()
        stand_in.close()
    assert decision.error is None
    return decision


def test_a_person_whom_only_the_laser_sees_has_its_label(folder, parts):
    decision = decide_once(folder, parts, StandInWithLaser(people={}))
    assert decision.person.startswith("motion 1-")
    assert set(decision.episode.labels) == {"motion"}


def test_a_person_whom_the_laser_does_not_see_has_no_label(folder, parts):
    decision = decide_once(folder, parts, StandIn(people={"7": (0.0, 3.0)}))
    assert decision.person == "7"
    assert decision.episode.labels == {}
    assert "classifier" not in decision.episode.evidence
    assert decision.episode.report in ("interested", "not_interested")


def test_the_configuration(folder):
    file = folder / "robot.toml"
    file.write_text(robot_toml("ws://localhost:1", people=BASE["people"] + "\n" + LASER))
    config, _ = read_robot_config(file)
    own = config.people.senses["motion"]
    assert (own.topic, own.mounting) == (("/scan", "sensor_msgs/LaserScan"), Pose(0.1, 0.0, 0.0))
    assert config.people.tracker.topic == ("/people", "people_msgs/People")


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (LASER.replace("motion", "smell"), r"smell: no sense; expected one of motion"),
        (
            LASER.replace("sensor_msgs/msg/LaserScan", "sensor_msgs/msg/Image"),
            r"'sensor_msgs/msg/Image'; exp",
        ),
        (
            LASER.replace("[0.1, 0, 0]", "[0.1, 0]"),
            r"mounting: \[0.1, 0\]; expected \[x, y, heading\] in met",
        ),
        (
            LASER.replace("sensor_msgs/msg/LaserScan", "people_msgs/msg/People"),
            r"mounting: is for sensor_msgs",
        ),
        (LASER + "\nrate = 3", r"rate.*unknown"),
        (LASER + '\nclasses = ["person"]', r"classes: is for detections; sensor_msgs/LaserScan has none"),
    ],
)
def test_errors_of_the_configuration(folder, lines, words):
    file = folder / "robot.toml"
    file.write_text(robot_toml("ws://localhost:1", people=BASE["people"] + "\n" + lines))
    with pytest.raises(DomainError, match=words):
        read_robot_config(file)
