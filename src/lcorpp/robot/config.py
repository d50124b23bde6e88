"""Configuration of a robot: the content of `robot.toml` as values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from lcorpp.robot.facts import Fact
from lcorpp.values import SharedValue
from lcorpp.worlds.ros.belief_messages import BeliefTopics
from lcorpp.worlds.ros.initial_pose import InitialPose
from lcorpp.worlds.ros.perception import AT_ROBOT, Frames
from lcorpp.worlds.ros.pose import Pose
from lcorpp.worlds.ros.ros_world import Behaviour
from lcorpp.worlds.ros.sensor_messages import CLASSES

Topic = tuple[str, str]
"""Name of a topic and type of its messages."""

AFTER = "[after]"
"""What follows a decision, among the behaviours; no action of a POMDP has brackets in its name."""

CONNECTIONS = ("rosbridge", "rospy", "rclpy")


@dataclass(frozen=True)
class ConnectionConfig:
    """How to connect to ROS.

    kind: one of `CONNECTIONS`. version: of ROS. url: of the rosbridge server.
    timeout: seconds to connect. max_outage: seconds to wait for a lost connection before the robot gives up.
    """

    kind: str = "rosbridge"
    version: int = 2
    url: str = "ws://localhost:9090"
    timeout: float = 5.0
    max_outage: float = 30.0


@dataclass(frozen=True)
class TrackerConfig:
    """A source of people's positions.

    topic: of a people tracker or a laser scanner. classes: of detections that are people, in lower case.
    mounting: the pose of a laser scanner in the robot's frame.
    head_frame: of frames: that of the robot's head, to which the gaze of people is related; None takes that
        in which their faces come.
    """

    topic: Topic
    classes: tuple[str, ...] = CLASSES
    mounting: Pose = AT_ROBOT
    head_frame: str | None = None


@dataclass(frozen=True)
class PeopleConfig:
    """People as the robot tracks them.

    tracker: of all senses without their own. senses: sense -> its own tracker.
    decide_after: seconds of a track before the robot decides.
    max_silence: seconds without a sample after which a person has left.
    permanent_ids: whether a person who comes back has the id of before, e.g. by the face.
    """

    tracker: TrackerConfig
    senses: Mapping[str, TrackerConfig] = field(default_factory=dict)
    decide_after: float = 10.0
    max_silence: float = 3.0
    permanent_ids: bool = False

    @property
    def trackers(self) -> dict[str, TrackerConfig]:
        """All trackers: "" -> the robot's, sense -> its own."""
        return {"": self.tracker, **self.senses}


@dataclass(frozen=True)
class AnswersConfig:
    """Answers of people.

    topic: of a speech recogniser, or None. microphone: whether the robot's own recogniser listens instead.
    silence: the observation without an answer. utterances: observation -> sentences.
    """

    topic: Topic | None = None
    microphone: bool = False
    silence: str = "none"
    utterances: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class RobotConfig:
    """Content of a `robot.toml`, checked against its domain by `read_robot_config`.

    file: for messages. domain, preset, strategy: their names. classifiers: sense -> file.
    value: the shared value that means engagement, e.g. "interested".
    max_actions: for one person; then the decision fails, e.g. because the person says nothing.
    pose: topic of the localisation, or the pose of a robot that stays.
    initial_pose: that the localisation is given at first, None for none.
    behaviours: action -> how to execute it; `AFTER` -> what the robot does after each decision, if anything.
    beliefs: the topics of the belief, None to publish none.
    """

    file: Path
    domain: str
    preset: str | None
    strategy: str
    classifiers: Mapping[str, Path]
    value: SharedValue
    max_actions: int
    connection: ConnectionConfig
    frames: Frames
    pose: Topic | Pose
    initial_pose: InitialPose | None
    cmd_vel: str
    people: PeopleConfig
    answers: AnswersConfig
    facts: Mapping[str, Fact]
    behaviours: Mapping[str, Behaviour]
    beliefs: BeliefTopics | None
