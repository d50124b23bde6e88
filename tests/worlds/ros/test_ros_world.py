"""Actions of a robot behind rosbridge: what they send, what they observe, and how they end."""

import json
import threading
import time
from dataclasses import replace
from math import pi

import numpy as np
import pytest

from lcorpp.errors import ActionFailedError, ConnectionLostError, DecisionError, PersonLeftError, WorldError
from lcorpp.values import Distribution
from lcorpp.worlds.ros.belief_messages import BeliefTopics
from lcorpp.worlds.ros.perception import Frames, Perception
from lcorpp.worlds.ros.pose import Pose
from lcorpp.worlds.ros.ros_world import Behaviour, RosWorld, TopicListener, normalise_text
from lcorpp.worlds.ros.rosbridge import RosbridgeConnection
from lcorpp.worlds.ros.skills import Body, CallAction, CallService, Drive, Navigate, Say, Turn
from tests.worlds.ros.stand_in import StandIn, published
from tests.worlds.ros.test_rosbridge import WAIT, wait_until

NAVIGATE = Navigate("/navigate_to_pose", "nav2_msgs/NavigateToPose")
SAY = Say("Hello!", "/say", "std_msgs/String", 0.05)
MAP = Frames()
LOCALISED = ("/pose", "geometry_msgs/PoseStamped")


class Robot:
    """A stand-in with the world of its person 7."""

    def __init__(self, behaviours, *, pose=LOCALISED, frames=MAP, **options):
        self.stand_in = StandIn(**options)
        self.connection = RosbridgeConnection(self.stand_in.url, timeout=WAIT)
        people = ("/people", "people_msgs/People")
        self.perception = Perception(self.connection, people, pose, frames, timeout=WAIT)
        while self.stand_in.people and not self.perception.update(1.0):
            pass
        heard = self.connection.subscribe("/speech", "std_msgs/String")
        observations = ("pos", "neg", "none")
        listener = TopicListener(heard, "std_msgs/String", observations, {"pos": ("Yes, please!",)})
        self.body = Body(self.connection, self.perception, "7")
        self.world = RosWorld(self.body, behaviours, listener)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.connection.close()
        self.stand_in.close()


def test_silence_is_the_observation_none():
    with Robot({"greet": Behaviour(SAY, listen=0.1)}, answer=None) as robot:
        assert robot.world.act("greet") == "none"
        assert robot.stand_in.says == ["Hello!"]


@pytest.mark.parametrize(
    ("answer", "heard", "seconds"),
    [("yes  please", "pos", WAIT), ("neg", "neg", WAIT), ("the weather", "none", 0.6)],
)
def test_an_answer_is_found_by_its_words_or_is_an_observation(answer, heard, seconds):
    with Robot({"greet": Behaviour(SAY, listen=seconds)}, answer=answer) as robot:
        assert robot.world.act("greet") == heard


def test_what_was_said_before_is_no_answer():
    with Robot({"greet": Behaviour(SAY, listen=0.1)}, answer=None) as robot:
        wait_until(lambda: robot.stand_in.server.is_subscribed("/speech"))
        robot.stand_in.server.publish("/speech", {"data": "yes please"})
        time.sleep(0.2)
        assert robot.world.act("greet") == "none"


def test_navigation_goes_half_a_metre_towards_the_person_and_faces_them():
    with Robot({"move": Behaviour(NAVIGATE, listen=0.0)}, people={"7": (3.0, 4.0)}) as robot:
        robot.world.act("move")
        goal = robot.stand_in.goals[0]["pose"]
        assert goal["header"]["frame_id"] == "map"
        assert goal["pose"]["position"] == pytest.approx({"x": 0.3, "y": 0.4, "z": 0.0}, abs=0.02)
        assert goal["pose"]["orientation"]["z"] == pytest.approx(0.447, abs=0.01)  # sin(atan2(4, 3) / 2)


def test_navigation_keeps_the_distance_to_the_person_and_can_go_home():
    behaviours = {"move": Behaviour(NAVIGATE, listen=0.0), "home": Behaviour(replace(NAVIGATE, home=True))}
    with Robot(behaviours, people={"7": (0.0, 1.2)}) as robot:
        robot.world.act("move")
        assert robot.stand_in.goals[0]["pose"]["pose"]["position"]["y"] == pytest.approx(0.2, abs=0.05)
        robot.world.report("home")
        assert robot.stand_in.goals[1]["pose"]["pose"]["position"]["y"] == pytest.approx(0, abs=1e-6)


def test_a_turn_ends_when_the_robot_faces_the_person():
    with Robot({"turn": Behaviour(Turn(speed=2.0), listen=0.0)}, people={"7": (2.0, 2.0)}) as robot:
        robot.world.act("turn")
        assert robot.stand_in.pose[2] == pytest.approx(pi / 4, abs=0.15)
        wait_until(lambda: robot.stand_in.stops == 1)
        assert all(abs(twist["angular"]["z"]) <= 2.0 for twist in robot.stand_in.twists)


def test_a_turn_that_does_not_get_there_in_time_fails_and_stops():
    behaviours = {"turn": Behaviour(Turn(speed=0.01), timeout=0.3)}
    with Robot(behaviours, people={"7": (2.0, 0.0)}) as robot:
        with pytest.raises(ActionFailedError, match=r"turn: the turn is -1.\d+ rad short after 0.3 s"):
            robot.world.act("turn")
        wait_until(lambda: robot.stand_in.stops)


def test_driving_ends_with_a_stop():
    with Robot({"back": Behaviour(Drive(-0.2, 0.0, 0.25), listen=0.0)}) as robot:
        robot.world.act("back")
        wait_until(lambda: robot.stand_in.stops)
        *driving, last = [twist["linear"]["x"] for twist in robot.stand_in.twists]
        assert set(driving) == {-0.2}
        assert len(driving) <= 3  # fewer on a busy machine
        assert last == 0.0


def test_a_failure_is_the_observation_of_its_behaviour_and_stops_the_robot():
    behaviours = {"move": Behaviour(NAVIGATE, failure="none")}
    with Robot(behaviours, navigation="abort") as robot:
        assert robot.world.act("move") == "none"
        assert "refused or aborted" in str(robot.world.failures[0])
        wait_until(lambda: robot.stand_in.stops and robot.stand_in.cancels)


def test_a_failure_without_an_observation_is_an_error_and_stops_the_robot():
    with Robot({"move": Behaviour(NAVIGATE)}, navigation="abort") as robot:
        with pytest.raises(ActionFailedError, match=r"move: .* aborted; an order to stop was sent \(a Twist"):
            robot.world.act("move")
        wait_until(lambda: robot.stand_in.stops and robot.stand_in.cancels)


def test_a_goal_without_a_result_is_cancelled_at_its_time_out():
    with Robot({"move": Behaviour(NAVIGATE, timeout=0.3)}, navigation="hang") as robot:
        with pytest.raises(ActionFailedError, match=r"no result within 0.3 s"):
            robot.world.act("move")
        wait_until(lambda: robot.stand_in.stops and robot.stand_in.cancels)


def test_after_a_lost_connection_the_stop_is_sent_as_soon_as_it_is_back():
    with Robot({"move": Behaviour(NAVIGATE, timeout=60)}, navigation="hang") as robot:
        cut = robot.stand_in.server.cut
        robot.stand_in.server.take_topic("/cmd_vel", robot.stand_in.twists.append)
        threading.Timer(0.2, cut).start()
        with pytest.raises(
            ConnectionLostError,
            match=r"move: the connection was lost during .*; no order to stop can be sent",
        ):
            robot.world.act("move")
        wait_until(lambda: robot.stand_in.stops and robot.stand_in.cancels)


def test_an_interrupt_stops_the_robot():
    class Interrupted:
        def run(self, body, timeout):
            raise KeyboardInterrupt

    with Robot({"wave": Behaviour(Interrupted())}) as robot:
        with pytest.raises(KeyboardInterrupt):
            robot.world.act("wave")
        wait_until(lambda: robot.stand_in.stops)


def test_services_and_other_actions():
    behaviours = {
        "wave": Behaviour(CallService("/wave", "std_srvs/SetBool", {"data": True}), listen=0.0),
        "refuse": Behaviour(CallService("/wave", "std_srvs/SetBool", {"success": False, "data": False})),
        "go": Behaviour(CallAction("/nobody", "x/Go", {"n": 1}), timeout=0.2),
    }
    with Robot(behaviours) as robot:
        assert robot.world.act("wave") == "none"
        with pytest.raises(ActionFailedError, match="refuse: the service /wave failed: no reason"):
            robot.world.act("refuse")
        with pytest.raises(ActionFailedError, match="/nobody has no result"):
            robot.world.act("go")


def test_unknown_actions_and_people_who_left_are_errors():
    with Robot({"move": Behaviour(NAVIGATE)}, people={}) as robot:
        with pytest.raises(DecisionError, match="the robot has no action 'jump'; expected one of move"):
            robot.world.act("jump")
        with pytest.raises(PersonLeftError, match="the person 7 is no longer detected"):
            robot.world.act("move")


def test_people_in_the_frame_of_the_robot_are_placed_by_its_pose():
    frames = Frames(fixed="odom", robot="map")  # the stand-in's frame is that of the robot's body now
    pose = Pose(1.0, 1.0, pi / 2)
    with Robot({}, people={"7": (2.0, 0.5)}, pose=pose, frames=frames) as robot:
        assert robot.perception.locate("7") == pytest.approx((0.5, 3.0), abs=0.02)
        assert robot.perception.list_people().keys() == {"7"}


def test_people_in_another_frame_are_an_error_that_names_both():
    with Robot({}, people={}, frames=Frames(fixed="odom", robot="base")) as robot:
        robot.stand_in.people["7"] = 1.0, 1.0
        with pytest.raises(WorldError, match="people are in the frame 'map'; expected 'odom' or 'base'"):
            robot.perception.update(WAIT)


def test_no_pose_is_an_error():
    with Robot({}) as robot, pytest.raises(WorldError, match=r"/amcl: no nav_msgs/Odometry within 0.1 s"):
        Perception(
            robot.connection,
            ("/people", "people_msgs/People"),
            ("/amcl", "nav_msgs/Odometry"),
            Frames(),
            timeout=0.1,
        )


def test_the_belief_is_published_as_engagement_json_and_intent():
    topics = BeliefTopics("interested", "/intents", "/humans/persons/{person}/engagement_status", "/belief")
    with Robot({}) as robot:
        for p in (0.1, 0.5, 0.9):
            marginal = Distribution(("interested", "not_interested"), np.array([p, 1 - p]))
            topics.publish(robot.connection, "7", marginal, "greet")
        topics.publish_intent(robot.connection, "7", marginal, has_answered=False)
        wait_until(lambda: published(robot.stand_in, "/intents"))
        levels = published(robot.stand_in, "/humans/persons/p7/engagement_status")
        assert [level["level"] for level in levels] == [1, 2, 3]
        state = json.loads(published(robot.stand_in, "/belief")[-1]["data"])
        assert state == {
            "person": "7",
            "belief": {"interested": 0.9, "not_interested": 0.1},
            "action": "greet",
        }
        (intent,) = published(robot.stand_in, "/intents")
        assert (intent["intent"], intent["source"]) == ("__intent_engage_with__", "7")
        assert intent["modality"] == "__modality_motion__"
        assert intent["confidence"] == pytest.approx(0.9)


def test_sentences_are_compared_by_their_words():
    assert normalise_text(" Yes,  I'd like to! ") == "yes i'd like to"
