"""Perception from messages that a connection without a robot has received."""

import time

import pytest

from lcorpp.errors import WorldError
from lcorpp.worlds.ros import perception as perception_module
from lcorpp.worlds.ros.connection import Subscription
from lcorpp.worlds.ros.people import positions
from lcorpp.worlds.ros.people.laser_scan import LASER
from lcorpp.worlds.ros.perception import Frames, Perception
from lcorpp.worlds.ros.pose import Pose
from lcorpp.worlds.ros.ros_world import TopicListener
from tests.worlds.ros.test_laser_scan import legs_at, message as make_message, scan

ORIGIN = Pose(0.0, 0.0, 0.0)
TRANSFORMS, PEOPLE, ODOMETRY = "tf2_msgs/TFMessage", "people_msgs/People", "nav_msgs/Odometry"


class Received:
    """A connection; each topic has what `put` adds."""

    def __init__(self):
        self.topics = {}

    def subscribe(self, topic, kind, *, max_messages=64):
        return self.topics.setdefault(topic, Subscription(max_messages=max_messages))

    def put(self, topic, message):
        self.subscribe(topic, "").put(message)


def header(frame):
    return {"stamp": {"sec": 5, "nanosec": 0}, "frame_id": frame}


def people(frame, **positions):
    return {
        "header": header(frame),
        "people": [{"name": n, "position": {"x": x, "y": y, "z": 0.0}} for n, (x, y) in positions.items()],
    }


def vector(x, y=0.0, z=0.0):
    return {"x": x, "y": y, "z": z}


def odometry(x, speed=None):
    twist = {} if speed is None else {"linear": vector(speed), "angular": vector(0.0)}
    pose = {"position": vector(x), "orientation": {**vector(0.0), "w": 1.0}}
    return {"header": header("odom"), "pose": {"pose": pose}, "twist": {"twist": twist}}


def localised(*messages):
    robot = Received()
    for message in messages:
        robot.put("/odom", message)
    return robot, Perception(robot, ("/p", PEOPLE), ("/odom", ODOMETRY), Frames(), timeout=0.0)


def test_poses_that_are_not_finite_are_left_out_with_one_warning(caplog):
    robot, perception = localised(odometry(1.0))
    for x in (None, float("nan"), None):
        robot.put("/odom", odometry(x))
        assert perception.pose == Pose(1.0, 0.0, 0.0)
    robot.put("/odom", {"pose": {"hea": 0}})
    assert perception.pose == Pose(1.0, 0.0, 0.0)
    robot.put("/odom", odometry(2.0))
    assert perception.pose == Pose(2.0, 0.0, 0.0)
    not_finite, half = caplog.messages
    assert not_finite == (
        "/odom: a pose that is not finite, or whose quaternion is 0, is left out; the pose does not change"
    )
    assert half.startswith("/odom: a message that is not nav_msgs/Odometry: it has no field 'pose.pose'")


def test_a_pose_that_is_not_valid_for_seconds_is_unknown(monkeypatch, caplog):
    now = [100.0]
    monkeypatch.setattr(perception_module, "monotonic", lambda: now[0])
    robot, perception = localised(odometry(1.0))
    now[0] = 200.0  # a localisation may be silent while the robot stands
    assert perception.pose == Pose(1.0, 0.0, 0.0)
    for seconds in (0.0, 2.9):
        now[0] = 200.0 + seconds
        robot.put("/odom", odometry(None))
        assert perception.pose == Pose(1.0, 0.0, 0.0)
    now[0] = 203.1
    robot.put("/odom", odometry(None))
    with pytest.raises(WorldError, match="the robot's pose is unknown: no valid one for 3 s"):
        _ = perception.pose
    robot.put("/p", people("base_link", ann=(1.0, 0.0)))
    assert perception.update(0.0) == []
    robot.put("/p", people("map", ann=(1.0, 0.0)))
    assert len(perception.update(0.0)) == 1
    assert "/p: people in the frame of the robot are left out while its pose is unknown" in caplog.messages
    robot.put("/odom", odometry(2.0))
    assert perception.pose == Pose(2.0, 0.0, 0.0)


def test_the_first_pose_is_the_first_that_is_finite():
    with pytest.raises(WorldError, match=r"/odom: no nav_msgs/Odometry within 0 s; is the robot localised\?"):
        localised(odometry(None))


def test_the_speed_is_known_from_messages_after_a_time():
    robot, perception = localised(odometry(0.0, 0.4))
    assert perception.find_speed(0.0) == 0.4
    now = time.monotonic()
    assert perception.find_speed(now) is None
    robot.put("/odom", odometry(0.0, 0.0))
    assert perception.find_speed(now) == 0.0
    robot.put("/odom", odometry(0.0))  # without a velocity
    assert perception.find_speed(time.monotonic()) is None


def test_people_in_another_frame_are_left_out_once_there_were_some_in_a_known_one(caplog):
    robot = Received()
    perception = Perception(robot, ("/p", PEOPLE), ORIGIN, Frames("/map", "base"))
    robot.put("/p", people("camera", a=(1.0, 1.0)))
    with pytest.raises(WorldError, match="people are in the frame 'camera'; expected '/map' or 'base'"):
        perception.update(0.0)
    for message in (people("map", a=(1.0, 1.0)), people("camera", b=(1.0, 1.0)), people("camera")):
        robot.put("/p", message)
    robot.put("/p", people("", c=(1.0, 1.0)))
    perception.update(0.0)
    assert perception.list_people() == {"a": (1.0, 1.0)}
    assert ["camera" in text for text in caplog.messages] == [True, False]


def test_frames_of_faces_below_a_camera_do_not_end_the_tracking(caplog):
    robot = Received()
    perception = Perception(robot, ("/tf", TRANSFORMS), ORIGIN, Frames())
    frames = ("camera_optical_frame", "face_1", 0.0), ("face_1", "gaze_1", 0.0), ("map", "person_ann", 3.0)
    for parent, child, x in frames:
        rotation = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
        at = {"translation": {"x": x, "y": 1.0, "z": 2.0}, "rotation": rotation}
        transform = {"header": header(parent), "child_frame_id": child, "transform": at}
        robot.put("/tf", {"transforms": [transform]})
    perception.update(0.0)
    assert perception.list_people() == {"ann": (3.0, 1.0)}
    assert len(caplog.messages) == 1


def test_texts_of_another_type_are_no_answers(caplog):
    heard = Subscription()
    for message in ({"data": None}, {"dat": "yes"}, {"data": 3}, {"data": "pos"}):
        heard.put(message)
    assert TopicListener(heard, "std_msgs/String", ("pos", "neg")).listen(0.0) == "pos"
    assert len(caplog.messages) == 3


def test_a_walker_whom_a_slow_scanner_sees_is_the_person_of_the_camera(monkeypatch):
    """Five scans a second: the samples of a new track come at once, the first of them from a metre away."""
    now = [0.0]
    monkeypatch.setattr(positions, "monotonic", lambda: now[0])
    robot, everyone = Received(), positions.PeoplePositions()
    camera = Perception(robot, ("/p", PEOPLE), ORIGIN, Frames(), positions=everyone)
    laser = Perception(robot, ("/scan", LASER), ORIGIN, Frames(), positions=everyone, tracker="legs")
    seen = list[tuple[float, str]]()
    for k in range(18):
        now[0] = k / 5
        x = 6 - 1.2 * now[0]
        robot.put("/p", people("map", ann=(x, 0.0)))
        camera.update(0.0)
        robot.put("/scan", make_message(100 + now[0], scan(legs_at(x, 0.0), noise=0.01, seed=k)))
        seen += [(x, person) for _, person, x, _, _ in laser.update(0.0)]
    assert {person for _, person in seen} == {"ann"}
    assert len(seen) >= 10
