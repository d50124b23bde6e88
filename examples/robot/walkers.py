"""People who come through the corridor: who they are, how they walk, and how long they wait.

Their motives are like those of the `intention` domain (`walking.py` there): people who are interested walk
up to the robot and wait, some decide late; of the others some pass by, and some wait near the robot for
something else. All that is random about a person is drawn before the run, so that two rules meet equal
people.

Units are metres, seconds and radians; the robot stands at (0, 0), its back to the wall, and faces +y.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from lcorpp.simulation import Population

DOORS = {"library": -8.0, "classroom": 8.0}
"""Location of the domain -> x of the door through which people from there come."""
LANES = (1.6, 3.2)
"""y of the lines on which people cross the corridor, uniform."""
SPEED, SPEED_DEVIATION, SPEED_RANGE = 1.3, 0.24, (0.5, 2.2)
"""Walking speed, normal and truncated; as in the domain."""
APPROACH_SPEED = (0.45, 0.7)
"""Fraction of the walking speed that is kept on the way to a stop."""
RELAXATION_TIME = 0.6
"""Time constant of the adaptation to the desired velocity."""
P_LATE, P_OTHER_GOAL, P_LINGERS = 0.185, 0.8, 0.05
"""Probability that an interested person walks past before they decide; that a person who is not interested
waits near the robot for something else, e.g. a lecture; that such a person lingers on the way."""
LATE_DISTANCE, LINGER_DISTANCE, LINGER_TIME = (0.5, 3.0), (1.0, 5.0), (2.0, 6.0)
"""How far beyond the robot late people decide; where on their way people linger, and how long."""
STOP_DISTANCE, OTHER_DISTANCE, STOP_ANGLE, STOPS = (1.1, 2.4), (1.4, 3.6), (0.5, math.pi - 0.5), 12
"""Where interested people and others stop around the robot, uniform; the number of places drawn for each."""
ARRIVED, BRAKING_TIME = 0.25, 1.0
"""Distance from a place that counts as there; the speed near it is the distance over this time."""
PERSONAL_SPACE, ROBOT_SPACE, REPULSION = 0.7, 0.75, 1.2
"""Distances within which people step aside, from each other and from the robot; speed at distance 0."""

Point = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Visitor:
    """A person before they come.

    number: their id, from 1. arrival: time at which they come. attributes: of the domain, the truth.
    kind: what a camera sees of how long they may wait, e.g. "hurried". patience: seconds that they wait.
    speed: of walking. lane: y of their line. late, lingers, stops_beside: motives, see the module.
    approach: fraction of the speed. turns_at: x, in the direction of motion, at which a late person decides
        or a person lingers. pause: seconds. places: where to stop, in order.
    seed: of their answers.
    """

    number: int
    arrival: float
    attributes: Mapping[str, str]
    kind: str
    patience: float
    speed: float
    lane: float
    late: bool
    lingers: bool
    stops_beside: bool
    approach: float
    turns_at: float
    pause: float
    places: tuple[Point, ...]
    seed: int

    @property
    def is_interested(self) -> bool:
        return self.attributes["intention"] == "interested"


@dataclass(frozen=True)
class Patience:
    """Patience of a kind of person: gamma distributed.

    share: of the people. mean: seconds. shape: 1 is exponential, larger ones vary less.
    """

    share: float
    mean: float
    shape: float = 4.0


EQUAL_PATIENCE: Mapping[str, Patience] = {"usual": Patience(1.0, 40.0)}
MIXED_PATIENCE: Mapping[str, Patience] = {"hurried": Patience(0.5, 10.0), "patient": Patience(0.5, 70.0)}


def draw_visitors(
    population: Population,
    rng: np.random.Generator,
    *,
    seconds: float,
    per_minute: float,
    patience: Mapping[str, Patience] = EQUAL_PATIENCE,
    time: str | None = None,
    first: int = 1,
) -> list[Visitor]:
    """Draw the people who come in some time, by a Poisson process.

    Args:
        seconds: duration. per_minute: expected number of people in a minute.
        patience: kind -> its patience.
        time: value of the domain's `time` for all of them; None draws it for each.
        first: number of the first person.
    """
    count = int(rng.poisson(per_minute * seconds / 60))
    arrivals = np.sort(rng.uniform(0, seconds, count)).tolist()
    people = population.sample(count, rng, {} if time is None else {"time": time})
    kinds, shares = list(patience), np.array([each.share for each in patience.values()])
    visitors = list[Visitor]()
    for arrival, attributes in zip(arrivals, people, strict=True):
        kind = kinds[int(rng.choice(len(kinds), p=shares / shares.sum()))]
        own = patience[kind]
        motive = rng.uniform()
        interested = attributes["intention"] == "interested"
        late = interested and motive < P_LATE
        beside = not interested and motive < P_OTHER_GOAL
        lingers = not interested and P_OTHER_GOAL <= motive < P_OTHER_GOAL + P_LINGERS
        span = STOP_DISTANCE if interested else OTHER_DISTANCE
        distances, angles = rng.uniform(*span, STOPS), rng.uniform(*STOP_ANGLE, STOPS)
        places = zip(
            (distances * np.cos(angles)).tolist(), (distances * np.sin(angles)).tolist(), strict=True
        )
        waits = own.mean * rng.gamma(own.shape) / own.shape
        speed = float(np.clip(rng.normal(SPEED, SPEED_DEVIATION), *SPEED_RANGE))
        lane, approach = float(rng.uniform(*LANES)), float(rng.uniform(*APPROACH_SPEED))
        late_at, linger_at = float(rng.uniform(*LATE_DISTANCE)), -float(rng.uniform(*LINGER_DISTANCE))
        pause, seed = float(rng.uniform(*LINGER_TIME)), int(rng.integers(2**32))
        number, turns_at = first + len(visitors), late_at if late else linger_at
        visitors.append(
            Visitor(
                number, arrival, attributes, kind, float(waits), speed, lane, late, lingers, beside,
                approach, turns_at, pause, tuple(places), seed,
            )
        )  # fmt: skip
    return visitors


@dataclass(eq=False)
class Walker:
    """A person in the corridor.

    visitor: who they are. position, velocity: the true ones. place: where they stop, None if they walk on.
    waited: seconds at that place. lingered: seconds of the pause on the way. attended: whether the robot
    attends to them. leaves: whether they go to a door; is_gone: whether they went through it.
    """

    visitor: Visitor
    position: Point
    velocity: Point = (0.0, 0.0)
    place: Point | None = None
    waited: float = 0.0
    lingered: float = 0.0
    attended: bool = False
    leaves: bool = False
    is_gone: bool = False
    direction: float = field(init=False)

    def __post_init__(self) -> None:
        self.direction = -1.0 if self.position[0] > 0 else 1.0

    @classmethod
    def enter(cls, visitor: Visitor) -> Walker:
        """Return the person at their door."""
        return cls(visitor, (DOORS[visitor.attributes["location"]], visitor.lane))

    @property
    def wants_to_stop(self) -> bool:
        """Whether the person goes to a place near the robot, or stands there."""
        visitor, ahead = self.visitor, self.direction * self.position[0]
        if self.leaves or self.place is not None:
            return not self.leaves
        if visitor.is_interested:
            return self.attended or not visitor.late or ahead > visitor.turns_at
        return visitor.stops_beside

    def leave(self) -> None:
        """Let the person go to their door."""
        self.attended, self.leaves = False, True

    def choose_velocity(self, others: Sequence[Walker], robot: Point, step: float) -> Point:
        """Return the velocity (x, y) of the next step, and let time pass for the person."""
        if self.direction * self.position[0] >= max(DOORS.values()):
            self.is_gone = True
        wanted = self._go_to_place(others, step) if self.wants_to_stop else self._walk_on(step)
        aside = self._step_aside(others, robot)
        share = min(1.0, step / RELAXATION_TIME)
        vx = self.velocity[0] + share * (wanted[0] + aside[0] - self.velocity[0])
        vy = self.velocity[1] + share * (wanted[1] + aside[1] - self.velocity[1])
        self.velocity = vx, vy
        return vx, vy

    def _go_to_place(self, others: Sequence[Walker], step: float) -> Point:
        visitor = self.visitor
        if self.place is None:
            taken = [other.place for other in others if other.place is not None and not other.leaves]
            free = (
                each for each in visitor.places if all(_distance(each, one) > PERSONAL_SPACE for one in taken)
            )
            self.place = next(free, visitor.places[0])
        dx, dy = self.place[0] - self.position[0], self.place[1] - self.position[1]
        distance = math.hypot(dx, dy)
        if distance < ARRIVED:
            self.waited += step
            if self.waited > visitor.patience and not self.attended:
                self.leave()
            return 0.0, 0.0
        if self.attended and distance < 2 * PERSONAL_SPACE:
            return 0.0, 0.0
        speed = min(visitor.approach * visitor.speed, distance / BRAKING_TIME)
        return speed * dx / distance, speed * dy / distance

    def _walk_on(self, step: float) -> Point:
        visitor, ahead = self.visitor, self.direction * self.position[0]
        if visitor.lingers and ahead > visitor.turns_at and self.lingered < visitor.pause:
            self.lingered += step
            return 0.0, 0.0
        dx, dy = self.direction * 4.0, visitor.lane - self.position[1]
        distance = math.hypot(dx, dy)
        return visitor.speed * dx / distance, visitor.speed * dy / distance

    def _step_aside(self, others: Iterable[Walker], robot: Point) -> Point:
        x, y = self.position
        aside_x = aside_y = 0.0
        spaces = [(other.position, PERSONAL_SPACE) for other in others if other is not self]
        for (other_x, other_y), space in (*spaces, (robot, ROBOT_SPACE)):
            dx, dy = x - other_x, y - other_y
            distance = math.hypot(dx, dy)
            if 1e-6 < distance < space:
                push = REPULSION * (1 - distance / space) / distance
                aside_x, aside_y = aside_x + push * dx, aside_y + push * dy
        return aside_x, aside_y


def _distance(a: Point, b: Point) -> float:
    return math.hypot(a[0] - b[0], a[1] - b[1])
