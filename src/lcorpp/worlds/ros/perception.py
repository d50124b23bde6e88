"""What the robot perceives: positions of people, and its own pose."""

from __future__ import annotations

import threading
from collections.abc import Collection
from dataclasses import dataclass
from math import pi
from time import monotonic, time

from lcorpp.errors import WorldError
from lcorpp.values import wrap_angle
from lcorpp.worlds.ros.connection import Message, RosConnection, Subscription
from lcorpp.worlds.ros.fields import FaultLog
from lcorpp.worlds.ros.initial_pose import KIND as INITIAL_POSE, PERIOD, InitialPose
from lcorpp.worlds.ros.people.human_stream import HumanStream
from lcorpp.worlds.ros.people.laser_scan import LASER, LaserReader
from lcorpp.worlds.ros.people.positions import PeoplePositions
from lcorpp.worlds.ros.pose import Pose
from lcorpp.worlds.ros.sensor_messages import (
    CLASSES,
    Detection,
    PeopleReader,
    Sample,
    read_pose,
    read_speed,
)
from lcorpp.worlds.ros.transforms import TRANSFORMS

AT_ROBOT = Pose(0.0, 0.0, 0.0)
"""The pose of a laser scanner in the middle of the robot that looks ahead."""

MAX_BAD_POSES = 3.0
"""Seconds of messages without a valid pose after which the robot's pose is unknown."""


@dataclass(frozen=True)
class Frames:
    """Frames of reference.

    fixed: a frame that does not move, e.g. "map". robot: that of the robot's body, x ahead, e.g. "base_link".
    training_heading: radians; the robot's heading in the frame of the tracks that the classifier was trained
        on: pi / 2 for simulated people, 0 for recordings that were read with the robot's pose.
    """

    fixed: str = "map"
    robot: str = "base_link"
    training_heading: float = pi / 2


class Perception:
    """Positions of people and the robot's pose, from the latest messages.

    One thread calls `update`, any other may call `locate` and `pose`. The samples for the classifier are in
    the frame of the robot's first pose, `home`, so that people do not seem to move when the robot does.

    last_message: time of the tracker's last message on the monotonic clock; None before the first.

    Args:
        connection: of the robot.
        people: topic and type of the tracker's messages, see `PEOPLE`, or of a laser scanner's.
        pose: topic and type of the localisation's messages, see `POSES`; or the pose of a robot that stays.
        initial: the pose that the localisation is given; its first pose is one near it. None gives none.
        timeout: seconds to wait for the first pose. classes: of detections that are people.
        mounting: the pose of a laser scanner in the robot's frame.
        positions: of people whom other trackers detect, too. tracker: the name of this one.
        head_frame: the frame of the robot's head, to which the gaze of people is related; None takes that in
            which their faces come.
        home: the robot's first pose; None takes that of the first message.

    Raises:
        WorldError: no pose comes. ConnectionLostError: there is no connection.
    """

    def __init__(
        self,
        connection: RosConnection,
        people: tuple[str, str],
        pose: tuple[str, str] | Pose,
        frames: Frames,
        *,
        timeout: float = 5.0,
        classes: Collection[str] = CLASSES,
        mounting: Pose = AT_ROBOT,
        positions: PeoplePositions | None = None,
        tracker: str = "",
        home: Pose | None = None,
        initial: InitialPose | None = None,
        head_frame: str | None = None,
    ) -> None:
        self.frames, self._people_kind = frames, people[1]
        self._lock = threading.Lock()
        self._faults, self._mounting, self._tracker = FaultLog(people[0]), mounting, tracker
        self._has_located = False
        self.positions = PeoplePositions(tracker) if positions is None else positions
        self._poses: Subscription | None = None
        self._pose_kind = ""
        self._bad_since: float | None = (
            None  # the first message without a valid pose after the last valid one
        )
        self._is_lost = False
        self._speed: tuple[float, float] | None = None  # m/s plus rad/s, and when it was received
        if isinstance(pose, Pose):
            self._pose = pose
        else:
            topic, self._pose_kind = pose
            self._pose_faults = FaultLog(topic)
            self._poses = connection.subscribe(topic, self._pose_kind, max_messages=1)
            self._pose = self._wait_for_pose(connection, topic, timeout, initial)
        self.home = self._pose if home is None else home
        self._people = connection.subscribe(*people)
        self._reader: PeopleReader | LaserReader | HumanStream
        if people[1] == LASER:
            self._reader = LaserReader(people[0], frames.fixed, self._place_scan)
        elif people[1] == TRANSFORMS:
            targets = frames.fixed, frames.robot
            self._reader = HumanStream(connection, people[0], targets=targets, head=head_frame)
        else:
            self._reader = PeopleReader(*reversed(people), classes=classes)
        self.last_message: float | None = None

    @property
    def is_localised(self) -> bool:
        """Whether messages update the pose."""
        return self._poses is not None

    @property
    def measures_speed(self) -> bool:
        """Whether the pose comes from odometry."""
        return self._pose_kind == "nav_msgs/Odometry"

    def find_speed(self, since: float) -> float | None:
        """Return the speed that odometry has measured after a time on the monotonic clock.

        Returns:
            m/s plus rad/s, 0 at standstill; None if there is no measurement.
        """
        self._update_pose()
        with self._lock:
            return None if self._speed is None or self._speed[1] < since else self._speed[0]

    @property
    def pose(self) -> Pose:
        """The robot's pose in the fixed frame.

        Raises:
            WorldError: the localisation has sent no valid pose for `MAX_BAD_POSES` seconds.
        """
        self._update_pose()
        with self._lock:
            if self._is_lost:
                raise WorldError(f"the robot's pose is unknown: no valid one for {MAX_BAD_POSES:g} s")
            return self._pose

    def locate(self, person: str) -> tuple[float, float] | None:
        """Return the position of a person in the fixed frame; None if the person is no longer detected."""
        return self.positions.locate(person)

    def list_people(self) -> dict[str, tuple[float, float]]:
        """Return the people who are detected, with their positions in the fixed frame."""
        return self.positions.list_people()

    def update(self, timeout: float) -> list[Sample]:
        """Return the samples of new messages; wait for one at most `timeout` seconds.

        Messages that cannot be read are left out with a warning, and so are people in another frame, once
        there were people in one that is known.

        Raises:
            WorldError: people are in another frame. ConnectionLostError: there is no connection.
        """
        first = self._people.wait(timeout)
        if first is None:
            return []
        self.last_message = monotonic()
        self._update_pose()
        samples, heading = list[Sample](), self.frames.training_heading
        for message in (first, *self._people.take()):
            if self._people_kind == LASER and self._is_lost:
                self._faults.warn("scans are left out while the robot's pose is unknown")
                continue
            located = [(d, self._locate_detection(d)) for d in self._reader.read(message)]
            newest = {detection.id: place for detection, place in located if place is not None}
            names = {id: self.positions.update(self._tracker, id, *place) for id, place in newest.items()}
            for detection, place in located:
                if place is not None:
                    x, y = self.home.relate(*place, heading)
                    columns = dict(detection.columns)
                    if "facing" in columns:
                        columns["facing"] = wrap_angle(columns["facing"] + self._find_turn(detection))
                    samples.append(Sample(detection.time or time(), names[detection.id], x, y, columns))
        return samples

    def _find_turn(self, detection: Detection) -> float:
        """Return the angle from directions in the frame of a detection to those in that of the samples."""
        is_fixed = detection.frame == self.frames.fixed.lstrip("/")
        return (0.0 if is_fixed else self._pose.heading) - self.home.heading + self.frames.training_heading

    def _place_scan(self, x: float, y: float) -> tuple[float, float]:
        """Return a point of the laser scanner's frame in the fixed frame."""
        return self._pose.place(*self._mounting.place(x, y))

    def _locate_detection(self, detection: Detection) -> tuple[float, float] | None:
        """Return the position of a detection in the fixed frame; None in a frame that is unknown."""
        is_fixed = detection.frame == self.frames.fixed.lstrip("/")
        if is_fixed or detection.frame == self.frames.robot.lstrip("/"):
            self._has_located = True
            if is_fixed:
                return detection.x, detection.y
            if self._is_lost:
                self._faults.warn("people in the frame of the robot are left out while its pose is unknown")
                return None
            return self._pose.place(detection.x, detection.y)
        fault = (
            f"people are in the frame {detection.frame!r}; expected {self.frames.fixed!r} or"
            f" {self.frames.robot!r} (robot.toml: [robot] fixed_frame and frame)"
        )
        if not self._has_located and self._people_kind != TRANSFORMS:
            raise WorldError(fault)
        self._faults.warn(fault)
        return None

    def _wait_for_pose(
        self, connection: RosConnection, topic: str, timeout: float, initial: InitialPose | None
    ) -> Pose:
        """Return the first pose; with an initial one, the first that is near it.

        Raises:
            WorldError: none comes in time.
        """
        assert self._poses is not None
        end, last = monotonic() + timeout, None
        if initial is not None:
            connection.advertise(initial.topic, INITIAL_POSE)
        while True:
            if initial is not None:
                initial.publish(connection, self.frames.fixed)
            soon = end if initial is None else min(end, monotonic() + PERIOD)
            while (message := self._poses.wait(max(0.0, soon - monotonic()))) is not None:
                last = self._read_pose(message) or last
                if last is not None and (initial is None or initial.is_reached(last)):
                    return last
            if monotonic() >= end:
                break
        if last is not None and initial is not None:
            raise WorldError(
                f"{topic}: the localisation stays at x={last.x:.2f}, y={last.y:.2f}, heading"
                f" {last.heading:.2f}, {timeout:g} s after the initial pose was sent to {initial.topic}; does"
                " it subscribe to this topic?"
            )
        raise WorldError(f"{topic}: no {self._pose_kind} within {timeout:g} s; is the robot localised?")

    def _update_pose(self) -> None:
        if self._poses is not None:
            with self._lock:
                for message in self._poses.take():
                    pose = self._read_pose(message)
                    if pose is not None:
                        self._pose, self._bad_since, self._is_lost = pose, None, False
                        continue
                    now = monotonic()
                    self._bad_since = now if self._bad_since is None else self._bad_since
                    self._is_lost = now - self._bad_since > MAX_BAD_POSES

    def _read_pose(self, message: Message) -> Pose | None:
        """Return the pose in a message, and keep its speed; None for a pose that is left out."""
        speed = read_speed(message)
        if speed is not None:
            self._speed = speed, monotonic()
        try:
            pose = read_pose(self._pose_kind, message)
        except WorldError as fault:
            self._pose_faults.warn(f"{fault}; it is left out, the pose does not change")
            return None
        if pose is None:
            self._pose_faults.warn(
                "a pose that is not finite, or whose quaternion is 0, is left out; the pose does not change"
            )
        return pose
