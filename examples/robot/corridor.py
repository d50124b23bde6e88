"""A corridor in ir-sim: a robot that drives, and people who come, wait and leave (`walkers.py`).

No ROS here: `bridge.py` serves it to a robot client. Everything is single-threaded; `step` advances the time.
ir-sim integrates the motion of robot and people; the world file `corridor.yaml` has the walls and the robot.

Units are metres, seconds and radians; the robot starts at (0, 0), its back to the wall, and faces +y.
"""

from __future__ import annotations

import contextlib
import io
import math
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from walkers import Visitor, Walker

from lcorpp import Domain
from lcorpp.errors import DecisionError
from lcorpp.simulation import SimulatedWorld, SimulationModel

WORLD_FILE = Path(__file__).with_name("corridor.yaml")
TRACKER_ERROR = 0.02
"""Standard deviation of a tracked position per coordinate."""
MAX_SPEED, MAX_TURN_SPEED = 0.8, 1.6
"""Of the robot, in metres and radians per second; as in the world file."""
GOAL_DISTANCE, GOAL_ANGLE = 0.1, 0.1
"""Errors of position and heading at which a goal is reached."""
ROBOT_RADIUS, PERSON_RADIUS, CLEARANCE = 0.3, 0.2, 0.1
"""Radii, as in the world file, and the distance at which the robot stops before an obstacle."""
MAX_BLOCKED = 3.0
"""Seconds on a blocked path after which a goal is aborted."""
HEARING_DISTANCE = 4.0
"""Distance from the robot within which people answer."""
OUTSIDE = -50.0
"""y at which ir-sim keeps the people who are not in the corridor."""

Pose = tuple[float, float, float]


class TrackedPosition(NamedTuple):
    """What a tracker reports of a person at one time."""

    person: int
    x: float
    y: float


@dataclass(frozen=True)
class Outcome:
    """How a visit ended, for scores; the robot does not see it.

    end: "served" (the robot reported the interest of an interested person), "dismissed" (any other report),
        "left", or "turned away" at the door, as the corridor was full.
    """

    visitor: Visitor
    time: float
    end: str


class Corridor:
    """The simulated corridor with one robot.

    Args:
        visitors: who comes, in the order of arrival.
        domain: its feedback model draws the people's answers.
        max_people: in the corridor at a time; others turn away at the door.
        step: seconds of a step.
        boxes: obstacles, each the centre and the lengths (x, y, length in x, length in y).
        seed: of the tracker's errors.
        real_time_factor: simulated seconds per second that `step` waits for; None does not wait.

    Attributes:
        time: simulated seconds. goal_state: "none", "active", "succeeded", "aborted" or "cancelled".
        outcomes: of the visits that ended.
    """

    def __init__(
        self,
        visitors: Iterable[Visitor],
        domain: Domain,
        *,
        max_people: int = 5,
        step: float = 0.25,
        boxes: Iterable[tuple[float, float, float, float]] = (),
        seed: int = 0,
        real_time_factor: float | None = None,
    ) -> None:
        self._coming = deque(sorted(visitors, key=lambda visitor: visitor.arrival))
        self._answers, self._worlds = SimulationModel(domain), dict[int, SimulatedWorld]()
        self._walkers, self._rng = dict[int, Walker](), np.random.default_rng(seed)
        self._env, self._bodies, self._fixed = _make_world(max_people, step, boxes)
        self._step_time = step
        self._reported = set[int]()
        self._free, self._body_of = list(range(max_people)), dict[int, int]()
        self._pace, self._began = real_time_factor, time.monotonic()
        self._goal: tuple[float, float, float | None] | None = None
        self._blocked, self._command, self._steps = 0.0, (0.0, 0.0), 0
        self.goal_state, self.outcomes = "none", list[Outcome]()
        self.people: list[TrackedPosition] = []

    @property
    def time(self) -> float:
        """Simulated seconds."""
        return self._steps * self._step_time

    @property
    def pose(self) -> Pose:
        """The robot's x, y and heading."""
        x, y, heading = self._env.robot.state[:3, 0].tolist()
        return x, y, heading

    @property
    def kinds(self) -> dict[int, str]:
        """What a camera sees of each person in the corridor, e.g. whether they are in a hurry."""
        return {number: walker.visitor.kind for number, walker in self._walkers.items()}

    @property
    def visitors(self) -> dict[int, Visitor]:
        """The truth about the people in the corridor, by their ids."""
        return {number: walker.visitor for number, walker in self._walkers.items()}

    def step(self) -> None:
        """Advance the simulation by a step; the tracker then reports `people`."""
        self._admit()
        x, y, _ = self.pose
        walkers = list(self._walkers.values())
        actions: list[list[float]] = [list(self._drive())]
        ids = [self._env.robot.id]
        for walker in walkers:
            actions.append(list(walker.choose_velocity(walkers, (x, y), self._step_time)))
            ids.append(self._bodies[self._body_of[walker.visitor.number]].id)
        self._env.step(actions, ids)
        self._steps += 1
        for body in (self._env.robot, *self._bodies):
            body.trajectory.clear()  # for plots; it grows without end
        for walker in walkers:
            number = walker.visitor.number
            body_x, body_y = self._bodies[self._body_of[number]].state[:2, 0].tolist()
            walker.position = body_x, body_y
            if walker.is_gone:
                self._remove(number)
        errors = self._rng.normal(0, TRACKER_ERROR, (len(self._walkers), 2)).tolist()
        self.people = [
            TrackedPosition(number, walker.position[0] + error_x, walker.position[1] + error_y)
            for (number, walker), (error_x, error_y) in zip(self._walkers.items(), errors, strict=True)
        ]
        if self._pace is not None:
            time.sleep(max(0.0, self._began + self.time / self._pace - time.monotonic()))

    def navigate(self, x: float, y: float, heading: float | None = None) -> None:
        """Drive to a goal; it replaces the current one. heading: at the goal, None for any."""
        if self.goal_state != "active":
            self._blocked = 0.0
        self._goal, self.goal_state = (x, y, heading), "active"

    def cancel(self) -> None:
        """Stop, and give up the goal if there is one."""
        self._command = 0.0, 0.0
        if self.goal_state == "active":
            self._goal, self.goal_state = None, "cancelled"

    def set_velocity(self, speed: float, turn_speed: float) -> None:
        """Drive at a velocity until the next command, in metres and radians per second; it ends a goal."""
        self.cancel()
        self._command = _clip(speed, MAX_SPEED), _clip(turn_speed, MAX_TURN_SPEED)

    def can_hear(self, person: int) -> bool:
        """Whether a person is in the corridor and near enough to answer."""
        walker, (x, y, _) = self._walkers.get(person), self.pose
        return walker is not None and math.dist(walker.position, (x, y)) <= HEARING_DISTANCE

    def answer(self, person: int, action: str) -> str:
        """Return the answer of a person to an action of the robot, by the domain's feedback model.

        The robot attends to this person then: interested people wait. Who is too far away does not answer.

        Raises:
            DecisionError: the domain has no such action.
        """
        self._answers.check_action(action)
        if not self.can_hear(person):
            return "none"
        walker = self._walkers[person]
        walker.attended = walker.visitor.is_interested
        if person not in self._worlds:
            rng = np.random.default_rng(walker.visitor.seed)
            self._worlds[person] = self._answers.make_world(walker.visitor.attributes, rng)
        return self._worlds[person].act(action)

    def release(self, person: int) -> None:
        """Give up a decision without a report; nothing happens if the person has left."""
        if person in self._walkers:
            self._walkers[person].attended = False

    def report(self, person: int, value: str) -> bool:
        """End the decision about a person; return whether they are served, as their interest was reported.

        Interested people then leave, served or disappointed; the others go on with what they do.

        Args:
            value: the reported intention.

        Raises:
            DecisionError: the person is not in the corridor.
        """
        if person not in self._walkers:
            raise DecisionError(f"person {person} is not in the corridor; it has {list(self._walkers)}")
        walker = self._walkers[person]
        served = walker.visitor.is_interested and value == "interested"
        self._reported.add(person)
        self.outcomes.append(Outcome(walker.visitor, self.time, "served" if served else "dismissed"))
        if walker.visitor.is_interested:
            walker.leave()
        return served

    def _admit(self) -> None:
        while self._coming and self._coming[0].arrival <= self.time:
            visitor = self._coming.popleft()
            if not self._free:
                self.outcomes.append(Outcome(visitor, self.time, "turned away"))
                continue
            walker, body = Walker.enter(visitor), self._free.pop()
            self._walkers[visitor.number], self._body_of[visitor.number] = walker, body
            self._bodies[body].static = False
            self._bodies[body].set_state([*walker.position, 0.0])

    def _remove(self, number: int) -> None:
        visitor, body = self._walkers.pop(number).visitor, self._body_of.pop(number)
        self._worlds.pop(number, None)
        self._bodies[body].set_state([2.0 * body, OUTSIDE, 0.0])
        self._bodies[body].static = True
        self._free.append(body)
        if number not in self._reported:
            self.outcomes.append(Outcome(visitor, self.time, "left"))

    def _drive(self) -> tuple[float, float]:
        """Return the robot's velocity for the next step: of the goal, or as commanded."""
        speed, turn_speed = self._command if self._goal is None else self._approach(*self._goal)
        if speed and self._is_blocked(math.copysign(1.0, speed)):
            self._blocked += self._step_time
            speed = 0.0
            if self._goal is not None and self._blocked > MAX_BLOCKED:
                self._goal, self.goal_state, turn_speed = None, "aborted", 0.0
        else:
            self._blocked = 0.0 if speed else self._blocked
        return speed, turn_speed

    def _approach(self, goal_x: float, goal_y: float, goal_heading: float | None) -> tuple[float, float]:
        x, y, heading = self.pose
        dx, dy = goal_x - x, goal_y - y
        distance = math.hypot(dx, dy)
        is_there = distance < GOAL_DISTANCE
        if is_there and goal_heading is None:
            turn = 0.0
        else:
            wanted = goal_heading if is_there and goal_heading is not None else math.atan2(dy, dx)
            turn = math.remainder(wanted - heading, math.tau)
        if is_there and abs(turn) < GOAL_ANGLE:
            self._goal, self.goal_state = None, "succeeded"
            return 0.0, 0.0
        turn_speed = _clip(turn / (2 * self._step_time), MAX_TURN_SPEED)
        ahead = not is_there and abs(turn) < math.pi / 6
        return (min(MAX_SPEED, distance / (2 * self._step_time)) if ahead else 0.0), turn_speed

    def _is_blocked(self, direction: float) -> bool:
        """Whether an obstacle is where the robot would be next. direction: 1 forward, -1 backward."""
        x, y, heading = self.pose
        reach = CLEARANCE + MAX_SPEED * self._step_time
        next_x, next_y = x + direction * reach * math.cos(heading), y + direction * reach * math.sin(heading)
        gap = ROBOT_RADIUS + PERSON_RADIUS
        if any(math.dist(walker.position, (next_x, next_y)) < gap for walker in self._walkers.values()):
            return True
        return any(
            math.hypot(max(low_x - next_x, 0, next_x - high_x), max(low_y - next_y, 0, next_y - high_y))
            < ROBOT_RADIUS
            for low_x, low_y, high_x, high_y in self._fixed
        )


def _clip(value: float, limit: float) -> float:
    return min(max(value, -limit), limit)


def _make_world(
    max_people: int, step: float, boxes: Iterable[tuple[float, float, float, float]]
) -> tuple[Any, list[Any], list[tuple[float, float, float, float]]]:
    """Return the environment of ir-sim, its people, and the bounds of what does not move."""
    with contextlib.redirect_stdout(io.StringIO()):  # it prints which windows it cannot open
        import irsim
    env = irsim.make(str(WORLD_FILE), headless=True, log_level="ERROR")
    env.world_param.step_time = step
    make = env.create_obstacle
    circle, limits = {"name": "circle", "radius": PERSON_RADIUS}, {"vel_max": [3, 3], "vel_min": [-3, -3]}
    people = [
        make(kinematics={"name": "omni"}, shape=circle, state=[2.0 * i, OUTSIDE, 0.0], **limits)
        for i in range(max_people)
    ]
    fixed = [
        make(shape={"name": "rectangle", "length": length, "width": width}, state=[x, y, 0.0])
        for x, y, length, width in boxes
    ]
    for body in people:
        body.static = True  # until they come in: ir-sim skips them
    walls = list(env.obstacle_list)
    env.add_objects([*people, *fixed])
    return env, people, [each.geometry.bounds for each in (*walls, *fixed)]
