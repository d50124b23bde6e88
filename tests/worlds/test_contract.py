"""One contract for all worlds: an action gives an observation of the model or a typed error, and ends."""

import sys
import threading

import numpy as np
import pytest

from lcorpp import ConsoleWorld, load_domain
from lcorpp.errors import LcorppError
from lcorpp.simulation import Population, SimulationModel
from lcorpp.worlds.ros.perception import Frames, Perception
from lcorpp.worlds.ros.pose import Pose
from lcorpp.worlds.ros.ros_world import Behaviour, RosWorld, TopicListener
from lcorpp.worlds.ros.rosbridge import RosbridgeConnection
from lcorpp.worlds.ros.skills import Body, Navigate, Say, Turn
from tests.worlds.ros.stand_in import EXAMPLES, StandIn

DOMAIN = load_domain("intention")
ACTIONS = ("move_forward", "greet", "turn")
MAX_WAIT = 30.0
"""Seconds after which a world counts as hanging; every time-out below is at most two."""


def simulated():
    yield SimulationModel(DOMAIN).make_world({"intention": "interested"}, np.random.default_rng(0))


def console():
    lines = iter(["p", "neg", "xx", "none"] * 9)
    yield ConsoleWorld(DOMAIN.pomdp.observations, ask=lambda _: next(lines), show=lambda _: None)


def make_ros_world(robot, *, silence="none", failure=None):
    connection = RosbridgeConnection(robot.url, timeout=2.0)
    perception = Perception(connection, ("/people", "people_msgs/People"), Pose(0, 0, 1.57), Frames())
    while not perception.update(1.0):
        pass
    behaviours = {
        "move_forward": Behaviour(
            Navigate("/navigate_to_pose", "nav2_msgs/NavigateToPose"), 1.0, 0.8, failure
        ),
        "greet": Behaviour(Say("Hello!", "/say", "std_msgs/String", 0.1), 1.0, 0.8),
        "turn": Behaviour(Turn(), 2.0, 0.2),
    }
    heard = connection.subscribe("/speech", "std_msgs/String")
    listener = TopicListener(heard, "std_msgs/String", DOMAIN.pomdp.observations, {"pos": ["Yes, please!"]})
    body = Body(connection, perception, "7")
    return RosWorld(body, behaviours, listener, silence=silence), connection


def ros(**options):
    robot = StandIn(**options)
    world, connection = make_ros_world(robot)
    yield world
    connection.close()
    robot.close()


def silent_ros():
    yield from ros(answer=None)


def failing_ros():
    yield from ros(navigation="abort")


def hanging_ros():
    yield from ros(navigation="hang")


def corridor():
    """ir-sim: the robot of the examples, ten times as fast as time."""
    pytest.importorskip("irsim", reason="needs ir-sim")
    sys.path.insert(0, str(EXAMPLES))
    from corridor import Corridor
    from simulate import SimulatedRobot
    from walkers import draw_visitors

    domain, rng = load_domain("intention", preset="heard"), np.random.default_rng(3)
    visitors = draw_visitors(Population(domain), rng, seconds=600, per_minute=20)
    made = Corridor(visitors, domain, max_people=3, step=0.1, real_time_factor=10.0)
    robot, ends = SimulatedRobot(made, 0), threading.Event()

    def run():
        while not ends.is_set():
            robot.step()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    connection = RosbridgeConnection(robot.server.url, timeout=5.0)
    pose = ("/odom", "nav_msgs/Odometry")
    perception = Perception(connection, ("/people", "people_msgs/People"), pose, Frames("odom"), timeout=30.0)
    while not perception.update(1.0):
        pass
    heard = connection.subscribe("/speech", "std_msgs/String")
    utterances = domain.planning.utterances
    listener = TopicListener(heard, "std_msgs/String", domain.pomdp.observations, utterances)
    behaviours = {
        "move_forward": Behaviour(
            Navigate("/navigate_to_pose", "nav2_msgs/NavigateToPose"), 2.0, 0.2, failure="none"
        ),
        "greet": Behaviour(Say("Hello!", "/say", "std_msgs/String", 0.1), 1.0, 0.8),
        "turn": Behaviour(Turn(), 2.0, 0.2),
    }
    person = next(iter(perception.list_people()))
    yield RosWorld(Body(connection, perception, person), behaviours, listener)
    ends.set()
    thread.join()
    connection.close()
    robot.server.close()


WORLDS = (simulated, console, ros, silent_ros, failing_ros, hanging_ros, corridor)


@pytest.fixture(params=WORLDS, ids=lambda make: make.__name__)
def world(request):
    made = request.param()
    yield next(made)
    assert next(made, None) is None


def call(function, *arguments):
    """Return the result of a call, or its typed error; fail if it does not end."""
    outcome = []

    def run():
        try:
            outcome.append(function(*arguments))
        except LcorppError as error:
            outcome.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(MAX_WAIT)
    assert outcome, f"{function} hangs, or raises an error of another kind"
    return outcome[0]


def test_each_action_ends_in_an_observation_or_a_typed_error(world):
    for action in ACTIONS:
        result = call(world.act, action)
        assert isinstance(result, LcorppError) or result in DOMAIN.pomdp.observations


def test_a_report_ends_a_decision(world):
    result = call(world.report, "report_interested")
    assert result is None
