"""What an action of the robot does: navigate, turn, drive, speak, watch, or a ROS action, service or message.

Each skill is a value that `run` executes with the parts of the robot's body. It ends within its time-out,
with an `ActionFailedError` if it could not be completed; `RosWorld` then stops the robot.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import atan2, hypot
from time import monotonic, sleep
from typing import Protocol

from lcorpp.errors import ActionFailedError, PersonLeftError
from lcorpp.values import Label
from lcorpp.worlds.ros.connection import Message, RosConnection
from lcorpp.worlds.ros.perception import Perception
from lcorpp.worlds.ros.pose import Pose
from lcorpp.worlds.speech import Voice

TWIST = "geometry_msgs/Twist"
PERIOD = 0.1
"""Seconds between two Twists: drivers of robots stop if none comes for about half a second."""
ANGLE_TOLERANCE = 0.1
"""Radians within which the robot faces a person."""
SLOWDOWN = 1.5
"""Turn rate in 1/s per radian that is left, near the end of a turn."""


def make_twist(linear: float, angular: float) -> Message:
    """Return a geometry_msgs/Twist; linear in m/s ahead, angular in rad/s to the left."""
    return {"linear": {"x": linear, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": angular}}


class PeopleView(Protocol):
    """The people whom the robot tracks, with the outputs of its classifiers."""

    @property
    def now(self) -> float:
        """The time in seconds, on the clock of time-outs."""

    def wait(self) -> bool:
        """Wait for more samples; return False if no more will come."""

    def list_people(self) -> dict[str, float]:
        """Return the people who are present, with the seconds of their tracks."""

    def classify(self, person: str, sense: str) -> Label | None:
        """Return the current output of a sense for a person; None without one."""


@dataclass(frozen=True, eq=False)
class Body:
    """The parts of the robot that skills use, and the person whom it attends to.

    cmd_vel: topic of the Twists. people: for skills that watch the person; None without classifiers.
    """

    connection: RosConnection
    perception: Perception
    person: str
    cmd_vel: str = "/cmd_vel"
    people: PeopleView | None = None

    def locate_person(self) -> tuple[float, float]:
        """Return the person's position in the fixed frame.

        Raises:
            PersonLeftError: the person is no longer detected.
        """
        position = self.perception.locate(self.person)
        if position is None:
            raise PersonLeftError(f"the person {self.person} is no longer detected")
        return position

    def drive(self, linear: float, angular: float) -> None:
        """Send a Twist, see `make_twist`."""
        self.connection.publish(self.cmd_vel, TWIST, make_twist(linear, angular))


class Skill(Protocol):
    """What an action of the robot does."""

    def run(self, body: Body, timeout: float) -> str | None:
        """Execute the action; return the observation, None if it is the person's answer.

        Raises:
            ActionFailedError: it is refused, fails, or does not end within `timeout` seconds.
            PersonLeftError: it needs the person, who left.
            ConnectionLostError: the connection is lost.
        """


MOVE_BASE = "move_base_msgs/MoveBase"
"""The navigation action of ROS 1."""

NAVIGATION: Mapping[str, str] = {
    "nav2_msgs/NavigateToPose": "pose",
    MOVE_BASE: "target_pose",
}
"""Type of a navigation action -> the field of the goal that contains the pose."""


@dataclass(frozen=True)
class Navigate:
    """Navigate towards the person, or back to where the robot started.

    name, kind: of the action server, see `NAVIGATION`.
    distance: metres towards the person. min_distance: metres to the person at the end.
    home: whether to go back instead.
    """

    name: str
    kind: str
    distance: float = 0.5
    min_distance: float = 1.0
    home: bool = False

    def run(self, body: Body, timeout: float) -> None:
        """As `Skill.run`."""
        pose = body.perception.home if self.home else self._approach(body)
        stamped = {
            "header": {"frame_id": body.perception.frames.fixed},
            "pose": {"position": {"x": pose.x, "y": pose.y, "z": 0.0}, "orientation": pose.quaternion()},
        }
        goal = {NAVIGATION[self.kind]: stamped}
        body.connection.run_action(self.name, self.kind, goal, timeout=timeout)

    def _approach(self, body: Body) -> Pose:
        """Return the pose on the way to the person, which faces the person."""
        robot, (x, y) = body.perception.pose, body.locate_person()
        dx, dy = x - robot.x, y - robot.y
        away = hypot(dx, dy)
        step = max(0.0, min(self.distance, away - self.min_distance)) / max(away, 1e-9)
        return Pose(robot.x + step * dx, robot.y + step * dy, atan2(dy, dx))


@dataclass(frozen=True)
class Turn:
    """Rotate until the robot faces the person, by Twists.

    speed: maximum, rad/s. Without a localisation the pose does not change, and the turn ends when it should
    have been completed.
    """

    speed: float = 0.6

    def run(self, body: Body, timeout: float) -> None:
        """As `Skill.run`."""
        began = monotonic()
        expected = abs(self._find_angle(body)) / self.speed
        while abs(angle := self._find_angle(body)) > ANGLE_TOLERANCE:
            elapsed = monotonic() - began
            if not body.perception.is_localised and elapsed >= expected:
                break
            if elapsed > timeout:
                raise ActionFailedError(f"the turn is {angle:+.2f} rad short after {timeout:g} s")
            rate = self.speed
            if body.perception.is_localised:  # slower near the end: poses come late
                rate = min(rate, SLOWDOWN * abs(angle))
            body.drive(0.0, rate if angle > 0 else -rate)
            sleep(PERIOD)
        body.drive(0.0, 0.0)

    def _find_angle(self, body: Body) -> float:
        return body.perception.pose.face(*body.locate_person())


@dataclass(frozen=True)
class Drive:
    """Drive at a constant velocity. linear: m/s. angular: rad/s. seconds: the duration."""

    linear: float
    angular: float
    seconds: float

    def run(self, body: Body, timeout: float) -> None:
        """As `Skill.run`."""
        end = monotonic() + min(self.seconds, timeout)
        while (left := end - monotonic()) > 0:
            body.drive(self.linear, self.angular)
            sleep(min(PERIOD, left))
        body.drive(0.0, 0.0)


SPEECH_MESSAGES: Mapping[str, Message] = {
    "std_msgs/String": {"data": "{text}"},
    "sound_play/SoundRequest": {"sound": -3, "command": 1, "volume": 1.0, "arg": "{text}", "arg2": ""},
}
"""Type of a speech topic's messages -> a message with the place of the text; -3 is SAY, 1 is PLAY_ONCE."""

SPEECH_RATE = 0.07
"""Seconds a character takes to be spoken, about 170 words a minute."""


@dataclass(frozen=True)
class Say:
    """Speak a sentence through a speech topic, and wait until it is spoken.

    topic, kind: see `SPEECH_MESSAGES`. seconds: the duration; None estimates it.
    """

    text: str
    topic: str
    kind: str
    seconds: float | None = None

    def run(self, body: Body, timeout: float) -> None:
        """As `Skill.run`."""
        fields = SPEECH_MESSAGES[self.kind].items()
        message = {name: self.text if value == "{text}" else value for name, value in fields}
        body.connection.publish(self.topic, self.kind, message)
        sleep(min(timeout, SPEECH_RATE * len(self.text) if self.seconds is None else self.seconds))


@dataclass(frozen=True)
class Speak:
    """Speak a sentence by a voice on this computer, and wait until it is spoken."""

    text: str
    voice: Voice

    def run(self, body: Body, timeout: float) -> None:
        """As `Skill.run`; the voice has its own time-out."""
        self.voice.say(self.text)


@dataclass(frozen=True)
class Watch:
    """Watch the person for some more seconds; the observation is the label that a sense gives then.

    Without a label then, e.g. of a face that is turned away, it goes on until there is one.

    sense: its name. seconds: by which the person's track grows. label_of: class -> label, an observation.
    """

    sense: str
    seconds: float
    label_of: Mapping[str, str] = field(default_factory=dict)

    def run(self, body: Body, timeout: float) -> str | None:
        """As `Skill.run`."""
        if body.people is None:
            raise ActionFailedError("there are no classifiers to watch people with")
        return self.observe(body.people, body.person, timeout)

    def observe(self, people: PeopleView, person: str, timeout: float) -> str:
        """Return the label of a person after some more seconds.

        Raises:
            ActionFailedError: there is none within `timeout` seconds.
            PersonLeftError: the person has left, or no more samples come.
        """
        began, start = people.now, self._measure_track(people, person)
        while True:
            seen = self._measure_track(people, person)
            start = min(start, seen)  # the track may have begun anew
            label = people.classify(person, self.sense) if seen >= start + self.seconds else None
            if isinstance(label, str) and label in self.label_of:
                return self.label_of[label]
            watched = f"{seen - start:.1f} s of {self.seconds:g} s"
            fault = f"{self.sense} has no label of {person}, who was watched for {watched}"
            if people.now - began > timeout:
                raise ActionFailedError(f"{fault}, within {timeout:g} s")
            if not people.wait():
                raise PersonLeftError(f"{fault}, and the recording ends")

    def _measure_track(self, people: PeopleView, person: str) -> float:
        present = people.list_people()
        if person not in present:
            raise PersonLeftError(f"the person {person} is no longer detected")
        return present[person]


@dataclass(frozen=True)
class CallAction:
    """Send a goal to any action server, and wait for the result."""

    name: str
    kind: str
    goal: Message = field(default_factory=dict)

    def run(self, body: Body, timeout: float) -> None:
        """As `Skill.run`."""
        body.connection.run_action(self.name, self.kind, self.goal, timeout=timeout)


@dataclass(frozen=True)
class CallService:
    """Call a service; a field `success` of the response that is False is a failure."""

    name: str
    kind: str
    request: Message = field(default_factory=dict)

    def run(self, body: Body, timeout: float) -> None:
        """As `Skill.run`."""
        response = body.connection.call_service(self.name, self.kind, self.request, timeout=timeout)
        if response.get("success") is False:
            raise ActionFailedError(
                f"the service {self.name} failed: {response.get('message') or 'no reason'}"
            )
