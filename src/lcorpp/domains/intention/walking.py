"""How people walk by a robot in a shopping mall, and how those walk up to it who want something there.

The robot stands at the origin with its back to a wall, between doors and shops; people come across the hall
before it. Intention drives motion only through where a person wants to go and how fast:

- Interested people walk up to the robot, slowly. Some are decided before they come into view, some decide
  on the way, some hesitate, and some come too late to show it: what is seen of them is a passer-by.
- Of the others most pass by in a straight line. Some have something to do beside the robot, a shop window, a
  friend, and walk wholly like interested people; some are curious, slow down and veer; some linger.

So the classes overlap by people who behave as the other class does, not by noise: a learner that is trained
for long finds little to learn by heart. The model is a social force: acceleration towards the wanted
velocity, pushed away by wall and robot (Helbing and Molnar, Social force model for pedestrian dynamics,
Physical Review E 51, 1995). Units are metres, seconds and radians.

Sources of numbers. "Walkers": pedestrians at 2.5 Hz of ETH (Pellegrini et al., You'll never walk alone, ICCV
2009) and UCY (Lerner et al., Crowds by example, 2007); the numbers here were fitted to them by hand, see
benchmarks/generator.py. "Rates": chosen so that the paper's LSTM errs as in the paper. Others are plain
assumptions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

STEP = 0.1
"""Seconds between two steps of the simulation."""
LONGEST = 90.0
"""Seconds after which a walk that did not come near the robot is given up."""

WALL = -1.0
"""Where the wall is, behind the robot: y of all people is above."""
BEARING = (np.pi / 4, 3 * np.pi / 4)
"""Whence people come, seen from the robot, which looks to pi/2; 0 and pi are along the wall."""
LANE = (0.4, 1.9)
"""How far from the robot a passer-by's line runs, on the side away from the wall; uniform."""
SPEED, SPEED_DEVIATION, SPEED_RANGE = 1.3, 0.24, (0.5, 2.2)
"""Walking speed, normal and truncated; near 1.34 and .26 of Weidmann, Transporttechnik der Fussgaenger, 1993.
Walkers have medians of .77 to 1.50, one scene with the other."""
RELAXATION = 0.6
"""Time in which velocity adapts to the wanted one; .5 in Helbing and Molnar."""
STEERING, STEERING_TIME = 0.03, 3.0
"""Deviation and correlation time of the wander around the wanted heading; walkers go straight."""
PACE, PACE_TIME = 0.05, 3.0
"""Relative deviation and correlation time of the wanted speed; walkers."""
LOOK_AHEAD = 5.0
"""How far ahead a passer-by aims along the own line."""
WALL_PUSH, WALL_RANGE = 1.0, 0.3
"""Acceleration at the wall and the distance over which it fades."""
ROBOT_PUSH, ROBOT_RADIUS, ROBOT_RANGE = 1.0, 0.6, 0.25
"""Acceleration at the robot's radius and the distance over which it fades."""

KEEN, NOTICE = 0.66, (4.6, 7.0)
"""Share of those who come to the robot that are decided from the start; at which distance from it the others
decide. Rates: how much the first quarter of a track shows."""
APPROACH = (0.32, 0.45)
"""Share of the walking speed kept from then on; rates."""
STAND, STAND_ASIDE = (0.8, 1.2), (0.0, 1.0)
"""Where they stop: distance from the robot, and by which angle towards its front from where they came."""
BRAKING = 1.6
"""They walk no faster than would cover the remaining way in this time."""
HESITATING, HESITATION, HESITATION_TIME = 0.08, (2.0, 7.0), (1.0, 3.0)
"""Share of them who stop on the way, at which distance from the robot, and how long."""

LATE = 0.185
"""Share of interested people who decide only when they are no longer watched; rates."""
ELSEWHERE = 0.235
"""Share of people not interested whose aim is beside the robot; rates."""
CURIOUS, CURIOSITY, CURIOUS_PACE, CURIOUS_VEER = 0.05, (3.0, 10.0), (0.55, 0.9), (0.2, 0.7)
"""Share of people not interested who are curious, at which distance, to which share of their speed they slow
down, and by which share of the distance of their line they come closer."""
LINGERING, LINGER, LINGER_PACE, LINGER_TIME = 0.05, (2.0, 12.0), (0.0, 0.4), (2.0, 6.0)
"""Share of people not interested who linger, at which distance, at which share of their speed, how long."""


class Walks(NamedTuple):
    """What n people did, STEP seconds apart.

    path: (steps, n, 2) positions; meaningless after all have arrived.
    attending: (steps, n) whether they attend to the robot, or to what is beside it.
    arrival: (n,) the step at which they came near.
    whole: (n,) whether they came near at all, and walked long enough before.
    """

    path: Array
    attending: Flags
    arrival: npt.NDArray[np.intp]
    whole: Flags


class _People(NamedTuple):
    """What n people are like.

    along, aside: (n, 2) unit vectors of a passer-by's line: its direction, and away from the robot.
    lane: (n,) the line's distance from the robot. bearing: (n,) whence they come. side: (n,) 1 or -1.
    """

    along: Array
    aside: Array
    lane: Array
    bearing: Array
    side: Array


_Aims = Callable[[Array, Array], tuple[Array, Array, Array, Flags]]


def walk(interested: Flags, until: Array, seconds: Array, rng: np.random.Generator) -> Walks:
    """One walk for each of n people, until all have come near the robot or never will.

    Args:
        interested: (n,) who is. until: (n,) the distance from the robot that counts as near.
        seconds: (n,) how long they have to walk before that.
    """
    n = len(interested)
    bearing = rng.uniform(*BEARING, size=n)
    side = np.where(bearing < np.pi / 2, 1.0, -1.0)
    along = -np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    aside = side[:, None] * np.stack([-np.sin(bearing), np.cos(bearing)], axis=1)
    people = _People(along, aside, rng.uniform(*LANE, size=n), bearing, side)
    speed = np.clip(rng.normal(SPEED, SPEED_DEVIATION, size=n), *SPEED_RANGE)
    aims = _aims(interested, people, rng)

    steps = int(LONGEST / STEP)
    wander = correlated(rng, (n, steps), STEERING, STEP / STEERING_TIME)
    pace = speed[:, None] * (1 + correlated(rng, (n, steps), PACE, STEP / PACE_TIME))
    start = until + 1.1 * speed * seconds + 1.0  # a little more than the way of a passer-by
    position = aside * people.lane[:, None] - along * start[:, None]
    velocity = along * speed[:, None]
    path = np.zeros((steps, n, 2))
    attending = np.zeros((steps, n), dtype=bool)
    arrival = np.full(n, steps)
    for step in range(steps):
        path[step] = position
        distance = np.hypot(position[:, 0], position[:, 1])
        arrival = np.where((distance <= until) & (arrival == steps), step, arrival)
        if step % 20 == 0 and np.all((arrival < steps) | (np.sum(position * along, axis=1) > until)):
            break
        direction, share, limit, attending[step] = aims(position, distance)
        wanted = np.minimum(pace[:, step] * share, limit)
        angle = np.arctan2(direction[:, 1], direction[:, 0]) + wander[:, step]
        aim = wanted[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        velocity = velocity + STEP * ((aim - velocity) / RELAXATION + _push(position, distance))
        position = position + STEP * velocity
    return Walks(path, attending, arrival, (arrival < steps) & (arrival * STEP >= seconds))


def _aims(interested: Flags, people: _People, rng: np.random.Generator) -> _Aims:
    """What everybody is after, as a function of position (n, 2) and distance (n,) from the robot.

    It gives the direction (n, 2) to walk in, the share (n,) of the own pace, a limit (n,) of the speed and
    who (n,) attends to the robot.
    """
    n = len(interested)
    kind = rng.uniform(size=n)
    bounds = np.cumsum([ELSEWHERE, CURIOUS, LINGERING])
    comes = np.where(interested, kind >= LATE, kind < bounds[0])
    curious = ~interested & (kind >= bounds[0]) & (kind < bounds[1])
    lingers = ~interested & (kind >= bounds[1]) & (kind < bounds[2])
    keen = rng.uniform(size=n) < KEEN
    notice = np.where(keen, np.inf, rng.uniform(*NOTICE, size=n))
    approach = rng.uniform(*APPROACH, size=n)
    angle = people.bearing + people.side * rng.uniform(*STAND_ASIDE, size=n)
    stand = rng.uniform(*STAND, size=n)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    hesitates = comes & (rng.uniform(size=n) < HESITATING)
    curiosity = rng.uniform(*CURIOSITY, size=n)
    curious_pace = rng.uniform(*CURIOUS_PACE, size=n)
    near_lane = people.lane * (1 - rng.uniform(*CURIOUS_VEER, size=n))
    pause_at = np.where(hesitates, rng.uniform(*HESITATION, size=n), rng.uniform(*LINGER, size=n))
    pause_time = np.where(hesitates, rng.uniform(*HESITATION_TIME, size=n), rng.uniform(*LINGER_TIME, size=n))
    pause_pace = np.where(hesitates, 0.0, rng.uniform(*LINGER_PACE, size=n))
    paused = np.zeros(n)
    decided = np.zeros(n, dtype=bool)
    drawn = np.zeros(n, dtype=bool)

    def aims(position: Array, distance: Array) -> tuple[Array, Array, Array, Flags]:
        decided[:] |= comes & (distance < notice)
        drawn[:] |= curious & (distance < curiosity)
        pausing = ((hesitates & decided) | lingers) & (distance < pause_at) & (paused < pause_time)
        paused[pausing] += STEP
        off = np.where(drawn, near_lane, people.lane) - np.sum(position * people.aside, axis=1)
        ahead = people.along * LOOK_AHEAD + people.aside * off[:, None]
        there = stand - position
        direction = np.where(decided[:, None], there, ahead)
        share = np.where(decided, approach, np.where(drawn, curious_pace, 1.0))
        share = np.where(pausing, pause_pace, share)
        limit = np.where(decided, np.hypot(there[:, 0], there[:, 1]) / BRAKING + 0.1, np.inf)
        return direction, share, limit, decided | drawn

    return aims


def _push(position: Array, distance: Array) -> Array:
    """(n, 2) acceleration away from the wall and the robot at positions (n, 2), distances (n,) from it."""
    away = np.exp((ROBOT_RADIUS - distance) / ROBOT_RANGE) * ROBOT_PUSH
    push = position / np.maximum(distance, 1e-6)[:, None] * np.minimum(away, ROBOT_PUSH)[:, None]
    push[:, 1] += WALL_PUSH * np.exp(np.minimum(WALL - position[:, 1], 0) / WALL_RANGE)
    return push


def correlated(rng: np.random.Generator, shape: tuple[int, ...], deviation: float, step: float) -> Array:
    """Stationary noise of `shape`, correlated along the last axis; `step` in units of correlation times."""
    noise = rng.standard_normal((shape[-1], *shape[:-1])) * deviation  # time first: that is quick to go along
    keep = np.exp(-step)
    noise[1:] *= np.sqrt(1 - keep**2)
    for i in range(1, len(noise)):
        noise[i] += keep * noise[i - 1]
    return np.moveaxis(noise, 0, -1)
