"""The fact of the robot's place, and the initial pose of its localisation."""

from math import cos, pi, sin

import pytest

from lcorpp.errors import DomainError, WorldError
from lcorpp.robot.facts import PlaceFact, is_inside
from lcorpp.robot.reading import read_robot_config
from lcorpp.worlds.ros import initial_pose as initial_pose_module
from lcorpp.worlds.ros.connection import Subscription
from lcorpp.worlds.ros.initial_pose import InitialPose
from lcorpp.worlds.ros.perception import Frames, Perception
from lcorpp.worlds.ros.pose import Pose
from tests.worlds.ros.stand_in import robot_toml

AMCL = "geometry_msgs/PoseWithCovarianceStamped"
PLACES = """library = [[0, 0], [10, 0], [10, 5], [0, 5]]
classroom = [[[20, 0], [22, 0], [21, 3]], [[30, 0], [31, 0], [31, 1]]]"""


def read(folder, *, pose=None, **changes):
    (folder / "robot.toml").write_text(robot_toml("ws://127.0.0.1:9", **changes))
    return read_robot_config(folder / "robot.toml", initial_pose=pose)[0]


def localised(kind=AMCL, lines=""):
    return {"robot": f'[robot]\npose = {{{{ topic = "/amcl_pose", type = "{kind}" }}}}\n{lines}'}


def test_the_place_follows_from_the_pose(folder):
    config = read(folder, facts=f"[facts.location]\n{PLACES}")
    fact, pose = config.facts["location"], [Pose(1.0, 1.0, 0.0)]
    assert fact.read() is None
    fact.start(None, lambda: pose[0])
    for x, y, place in ((1, 1, "library"), (21, 1, "classroom"), (30.8, 0.2, "classroom"), (15, 1, None)):
        pose[0] = Pose(x, y, 0.0)
        assert fact.read() == place


def test_a_place_is_unknown_while_the_pose_is():
    def fail():
        raise WorldError("the robot's pose is unknown")

    fact = PlaceFact({"library": [((0.0, 0.0), (4.0, 0.0), (4.0, 4.0))]})
    fact.start(None, fail)
    assert fact.read() is None


def test_a_regular_polygon_contains_the_points_nearer_than_its_edges():
    """Law: of a polygon with n corners on the unit circle, all points within cos(pi / n) are inside."""
    for n in (3, 4, 7):
        corners = tuple((cos(2 * pi * k / n), sin(2 * pi * k / n)) for k in range(n))
        for turn in range(97):
            x, y = cos(turn), sin(turn)
            assert is_inside(0.99 * cos(pi / n) * x, 0.99 * cos(pi / n) * y, corners)
            assert not is_inside(1.01 * x, 1.01 * y, corners)


@pytest.mark.parametrize(
    ("area", "words"),
    [
        ("[[0, 0], [1, 1]]", r"library: \[\[0, 0\], \[1, 1\]\]; expected a polygon \[\[x, y\]"),
        ("[[0, 0, 0], [1, 1, 0], [2, 0, 0]]", "expected a polygon"),
        ('[[0, 0], [1, 1], [2, "a"]]', "expected a polygon"),
        ("[[0, 0], [1, nan], [2, 0]]", "expected a polygon"),
        ("[1, 2, 3]", "expected a polygon"),
        ("[]", "expected a polygon"),
        ("[[0, 0], [1, 0], 5]", "expected a polygon"),
        ("[[0, 0], 1, [1, 1]]", "expected a polygon"),
        ("[[0, 0], [1, 1], [2, 2]]", "expected three corners that are not in"),
    ],
)
def test_areas_that_are_wrong(folder, area, words):
    with pytest.raises(DomainError, match=words):
        read(folder, facts=f"[facts.location]\nlibrary = {area}")


def test_places_that_the_knowledge_does_not_have(folder):
    with pytest.raises(DomainError, match="'kitchen'; expected one of library, classroom"):
        read(folder, facts="[facts.location]\nkitchen = [[0, 0], [1, 1], [2, 0]]")


def test_an_initial_pose_is_that_of_the_option_or_of_the_file(folder):
    assert read(folder).initial_pose is None
    lines = 'initial_pose = [1, 2, 0.5]\ninitial_pose_topic = "/begin"'
    assert read(folder, **localised(lines=lines)).initial_pose == InitialPose(Pose(1, 2, 0.5), "/begin")
    given = read(folder, pose=(3.0, 4.0, 0.0), **localised()).initial_pose
    assert given == InitialPose(Pose(3, 4, 0), "/initialpose")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            localised("nav_msgs/Odometry", "initial_pose = [0, 0, 0]"),
            "that of nav_msgs/Odometry; expected",
        ),
        (
            {"robot": "[robot]\ninitial_pose = [0, 0, 0]"},
            "`pose` is that of a robot that stays; exp",
        ),
        (localised(lines="initial_pose = [0, 0]"), r"initial_pose: \[0, 0\]; expected \[x, y, heading\]"),
    ],
)
def test_initial_poses_that_are_wrong(folder, changes, words):
    with pytest.raises(DomainError, match=words):
        read(folder, **changes)


def test_a_wrong_option_is_named_not_the_file(folder):
    with pytest.raises(DomainError, match=r"^--pose: is for a localisation"):
        read(folder, pose=(1.0, 2.0, 0.0), robot="[robot]\npose = [0, 0, 0]")


class Localisation:
    """A localisation at a wrong place, which moves to each initial pose that it receives after some."""

    def __init__(self, deaf):
        self.poses, self.received, self.deaf = Subscription(), [], deaf
        self.advertised = []
        self._put(Pose(50.0, 0.0, 0.0))

    def subscribe(self, topic, kind, *, max_messages=64):
        return self.poses if topic == "/amcl_pose" else Subscription()

    def advertise(self, topic, kind):
        self.advertised.append((topic, kind))

    def publish(self, topic, kind, message):
        self.received.append((topic, kind, message))
        if len(self.received) > self.deaf:
            position = message["pose"]["pose"]["position"]
            self._put(Pose(position["x"] + 0.1, position["y"], 0.5))

    def _put(self, pose):
        position = {"x": pose.x, "y": pose.y, "z": 0.0}
        stamped = {"pose": {"position": position, "orientation": pose.quaternion()}}
        self.poses.put({"header": {}, "pose": stamped})


def perceive(robot, timeout=60.0):
    return Perception(
        robot,
        ("/people", "people_msgs/People"),
        ("/amcl_pose", AMCL),
        Frames(),
        timeout=timeout,
        initial=InitialPose(Pose(3.0, 4.0, 0.4)),
    )


def test_the_initial_pose_is_sent_until_the_localisation_is_there(monkeypatch):
    monkeypatch.setattr("lcorpp.worlds.ros.perception.PERIOD", 0.01)
    robot = Localisation(deaf=2)
    home = perceive(robot).home
    assert (home.x, home.y, home.heading) == pytest.approx((3.1, 4.0, 0.5))
    assert robot.advertised == [("/initialpose", AMCL)]
    assert [(topic, kind) for topic, kind, _ in robot.received] == [("/initialpose", AMCL)] * 3
    message = robot.received[0][2]
    assert message["header"] == {"frame_id": "map"}
    covariance = message["pose"]["covariance"]
    assert [covariance[0], covariance[7], covariance[35]] == list(initial_pose_module.VARIANCES)
    assert sum(covariance) == sum(initial_pose_module.VARIANCES)


def test_a_localisation_that_does_not_take_the_initial_pose_is_named():
    with pytest.raises(
        WorldError, match=r"stays at x=50.00, y=0.00, heading 0.00, 0.05 s after the initial pose was sent to"
    ):
        perceive(Localisation(deaf=100), timeout=0.05)


def test_near_poses_are_reached():
    start = InitialPose(Pose(0.0, 0.0, 3.1))
    assert start.is_reached(Pose(0.9, 0.0, -3.1))  # the headings are .08 apart
    assert not start.is_reached(Pose(1.1, 0.0, 3.1))
    assert not start.is_reached(Pose(0.0, 0.0, 2.4))
