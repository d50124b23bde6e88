"""Simulate people who walk past a robot in a shopping mall, and those who walk up to it.

The robot is at (0, 0) with its back to a wall, between doors and shops; people cross the hall in front of
it. The intention changes only where people want to go and how fast:

- Interested people walk up to the robot, slowly. Some decide before they come into view, some on the way,
  some hesitate, and some decide too late to show it: their track is that of a passer-by.
- Most of the others pass by in a straight line. Some have another goal beside the robot (a shop window, a
  friend) and walk exactly like interested people; some are curious, slow down and veer; some linger.

So the classes overlap because some people behave like the other class, not because of noise: long training
finds little to overfit. The model is a social force: acceleration towards the desired velocity, and
repulsion by wall and robot (Helbing and Molnar, Social force model for pedestrian dynamics, Physical Review E
51, 1995).
Units are metres, seconds and radians.

Sources of numbers. "Walkers": pedestrians at 2.5 Hz of ETH (Pellegrini et al., You'll never walk alone, ICCV
2009) and UCY (Lerner et al., Crowds by example, 2007), to which the numbers were fitted by hand, see
benchmarks/generator.py. "Error rates": chosen so that the LSTM's error rates
are those of the paper. All others are assumptions.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

TIME_STEP = 0.1
"""Seconds between two steps of the simulation."""
MAX_WALK_DURATION = 90.0
"""Seconds after which a walk that has not come near the robot is rejected."""

WALL_Y = -1.0
"""y of the wall behind the robot; all people are above it."""
BEARING = (np.pi / 4, 3 * np.pi / 4)
"""Bearing, from the robot, of the side from which a person comes. The robot faces pi/2; 0 and pi are along
the wall."""
LANE_DISTANCE = (0.4, 1.9)
"""Distance of a passer-by's line from the robot, on the side away from the wall; uniform."""
SPEED, SPEED_DEVIATION, SPEED_RANGE = 1.3, 0.24, (0.5, 2.2)
"""Walking speed, normal and truncated; near 1.34 and .26 of Weidmann, Transporttechnik der Fussgaenger, 1993.
Walkers have medians of .77 to 1.50, depending on the scene."""
RELAXATION_TIME = 0.6
"""Time constant of the adaptation to the desired velocity; .5 in Helbing and Molnar."""
HEADING_NOISE, HEADING_TIME = 0.03, 3.0
"""Standard deviation and correlation time of the desired heading. Source: walkers, who go straight."""
SPEED_NOISE, SPEED_TIME = 0.05, 3.0
"""Relative standard deviation and correlation time of the desired speed. Source: walkers."""
LOOK_AHEAD = 5.0
"""Distance to the point on their own line at which passers-by aim."""
WALL_FORCE, WALL_RANGE = 1.0, 0.3
"""Acceleration at the wall, and the distance over which it decays."""
ROBOT_FORCE, ROBOT_RADIUS, ROBOT_RANGE = 1.0, 0.6, 0.25
"""Acceleration at the robot's radius, and the distance over which it decays."""

P_EARLY, DECISION_DISTANCE = 0.66, (4.6, 7.0)
"""Probability that a person who comes to the robot has decided from the start; distance from the robot at
which the others decide. Source: error rates, on how much the first quarter of a track reveals."""
APPROACH_SPEED = (0.32, 0.45)
"""Fraction of the walking speed kept after the decision. Source: error rates."""
STOP_DISTANCE, STOP_ANGLE = (0.8, 1.2), (0.0, 1.0)
"""Distance from the robot at which people stop, and angle from their bearing towards the robot's front."""
BRAKING_TIME = 1.6
"""Maximum speed: the remaining distance over this time, plus MIN_BRAKING_SPEED."""
MIN_BRAKING_SPEED = 0.1
"""Maximum speed at the stopping point; above zero, so that people reach it."""
P_HESITATES, HESITATION_DISTANCE, HESITATION_TIME = 0.08, (2.0, 7.0), (1.0, 3.0)
"""Probability that a person who comes to the robot stops on the way, the distance from the robot, and the
duration."""

P_LATE = 0.185
"""Probability that an interested person decides only after the end of the track. Source: error rates."""
P_OTHER_GOAL = 0.235
"""Probability that a person who is not interested has a goal beside the robot. Source: error rates."""
P_CURIOUS, CURIOUS_DISTANCE, CURIOUS_SPEED, CURIOUS_VEER = 0.05, (3.0, 10.0), (0.55, 0.9), (0.2, 0.7)
"""Probability that a person who is not interested is curious; the distance at which that begins, the fraction
of the speed kept, and the fraction of the lane's distance by which the person comes closer."""
P_LINGERS, LINGER_DISTANCE, LINGER_SPEED, LINGER_TIME = 0.05, (2.0, 12.0), (0.0, 0.4), (2.0, 6.0)
"""Probability that a person who is not interested lingers; distance, fraction of the speed kept, duration."""


class Walks(NamedTuple):
    """Walks of n people, TIME_STEP seconds between steps.

    path: (steps, n, 2) positions; zeros after the last simulated step.
    attending: (steps, n) whether each person attends to the robot, or to a goal beside it.
    arrival: (n,) the step at which each person came near the robot; the number of steps if never.
    accepted: (n,) whether the person came near the robot at all, and walked long enough before.
    """

    path: Array
    attending: Flags
    arrival: npt.NDArray[np.intp]
    accepted: Flags


class _Lanes(NamedTuple):
    """The straight lines of n passers-by.

    along, away: (n, 2) unit vectors: direction of the line, and away from the robot.
    distance: (n,) from the robot. bearing: (n,) as BEARING.
    side: (n,) 1 if the person comes from the robot's right (bearing below pi/2), -1 from its left.
    """

    along: Array
    away: Array
    distance: Array
    bearing: Array
    side: Array


_ChooseGoals = Callable[[Array, Array], tuple[Array, Array, Array, Flags]]


def walk(interested: Flags, end_distance: Array, seconds: Array, rng: np.random.Generator) -> Walks:
    """Simulate n people until all have come near the robot or never will.

    Args:
        interested: (n,) whether each person is interested.
        end_distance: (n,) distance from the robot that counts as near.
        seconds: (n,) minimum duration of the walk before that.
    """
    n = len(interested)
    bearing = rng.uniform(*BEARING, size=n)
    side = np.where(bearing < np.pi / 2, 1.0, -1.0)
    along = -np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    away = side[:, None] * np.stack([-np.sin(bearing), np.cos(bearing)], axis=1)
    lanes = _Lanes(along, away, rng.uniform(*LANE_DISTANCE, size=n), bearing, side)
    speed = np.clip(rng.normal(SPEED, SPEED_DEVIATION, size=n), *SPEED_RANGE)
    choose_goals = _draw_goals(interested, lanes, rng)

    steps = int(MAX_WALK_DURATION / TIME_STEP)
    heading_noise = draw_correlated_noise(rng, (n, steps), HEADING_NOISE, TIME_STEP / HEADING_TIME)
    own_speed = speed[:, None] * (
        1 + draw_correlated_noise(rng, (n, steps), SPEED_NOISE, TIME_STEP / SPEED_TIME)
    )
    start = end_distance + 1.1 * speed * seconds + 1.0  # slightly farther than a passer-by walks
    position = away * lanes.distance[:, None] - along * start[:, None]
    velocity = along * speed[:, None]
    path = np.zeros((steps, n, 2))
    attending = np.zeros((steps, n), dtype=bool)
    arrival = np.full(n, steps)
    for step in range(steps):
        path[step] = position
        distance = np.hypot(position[:, 0], position[:, 1])
        arrival = np.where((distance <= end_distance) & (arrival == steps), step, arrival)
        passed = np.sum(position * along, axis=1) > end_distance
        if step % 20 == 0 and np.all((arrival < steps) | passed):
            break
        direction, fraction, max_speed, attending[step] = choose_goals(position, distance)
        desired_speed = np.minimum(own_speed[:, step] * fraction, max_speed)
        angle = np.arctan2(direction[:, 1], direction[:, 0]) + heading_noise[:, step]
        desired = desired_speed[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        force = (desired - velocity) / RELAXATION_TIME + _compute_repulsion(position, distance)
        velocity = velocity + TIME_STEP * force
        position = position + TIME_STEP * velocity
    return Walks(path, attending, arrival, (arrival < steps) & (arrival * TIME_STEP >= seconds))


def _draw_goals(interested: Flags, lanes: _Lanes, rng: np.random.Generator) -> _ChooseGoals:
    """Draw people's goals; return them as a function of position (n, 2) and distance (n,) from the robot.

    The function returns the direction (n, 2) to walk in, the fraction (n,) of the own speed, a maximum (n,)
    of the speed and whether each person (n,) attends to the robot. It keeps state: call it once per step.
    """
    n = len(interested)
    kind = rng.uniform(size=n)
    bounds = np.cumsum([P_OTHER_GOAL, P_CURIOUS, P_LINGERS])
    comes = np.where(interested, kind >= P_LATE, kind < bounds[0])
    curious = ~interested & (kind >= bounds[0]) & (kind < bounds[1])
    lingers = ~interested & (kind >= bounds[1]) & (kind < bounds[2])
    early = rng.uniform(size=n) < P_EARLY
    decision_distance = np.where(early, np.inf, rng.uniform(*DECISION_DISTANCE, size=n))
    approach_speed = rng.uniform(*APPROACH_SPEED, size=n)
    angle = lanes.bearing + lanes.side * rng.uniform(*STOP_ANGLE, size=n)
    stop_at = rng.uniform(*STOP_DISTANCE, size=n)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    hesitates = comes & (rng.uniform(size=n) < P_HESITATES)
    curious_distance = rng.uniform(*CURIOUS_DISTANCE, size=n)
    curious_speed = rng.uniform(*CURIOUS_SPEED, size=n)
    curious_lane = lanes.distance * (1 - rng.uniform(*CURIOUS_VEER, size=n))
    pause_distance = np.where(
        hesitates, rng.uniform(*HESITATION_DISTANCE, size=n), rng.uniform(*LINGER_DISTANCE, size=n)
    )
    pause_time = np.where(hesitates, rng.uniform(*HESITATION_TIME, size=n), rng.uniform(*LINGER_TIME, size=n))
    pause_speed = np.where(hesitates, 0.0, rng.uniform(*LINGER_SPEED, size=n))
    paused_for = np.zeros(n)
    decided = np.zeros(n, dtype=bool)
    attracted = np.zeros(n, dtype=bool)

    def choose_goals(position: Array, distance: Array) -> tuple[Array, Array, Array, Flags]:
        decided[:] |= comes & (distance < decision_distance)
        attracted[:] |= curious & (distance < curious_distance)
        pausing = ((hesitates & decided) | lingers) & (distance < pause_distance) & (paused_for < pause_time)
        paused_for[pausing] += TIME_STEP
        lane = np.where(attracted, curious_lane, lanes.distance)
        offset = lane - np.sum(position * lanes.away, axis=1)
        ahead = lanes.along * LOOK_AHEAD + lanes.away * offset[:, None]
        to_stop = stop_at - position
        direction = np.where(decided[:, None], to_stop, ahead)
        fraction = np.where(decided, approach_speed, np.where(attracted, curious_speed, 1.0))
        fraction = np.where(pausing, pause_speed, fraction)
        braking = np.hypot(to_stop[:, 0], to_stop[:, 1]) / BRAKING_TIME + MIN_BRAKING_SPEED
        return direction, fraction, np.where(decided, braking, np.inf), decided | attracted

    return choose_goals


def _compute_repulsion(position: Array, distance: Array) -> Array:
    """Return the acceleration (n, 2) away from wall and robot.

    Args:
        position: (n, 2). distance: (n,) from the robot.
    """
    strength = np.exp((ROBOT_RADIUS - distance) / ROBOT_RANGE) * ROBOT_FORCE
    force = position / np.maximum(distance, 1e-6)[:, None] * np.minimum(strength, ROBOT_FORCE)[:, None]
    force[:, 1] += WALL_FORCE * np.exp(np.minimum(WALL_Y - position[:, 1], 0) / WALL_RANGE)
    return force


def draw_correlated_noise(
    rng: np.random.Generator, shape: tuple[int, ...], deviation: float, step: float
) -> Array:
    """Draw stationary Gaussian noise (AR(1)) of `shape`, correlated along the last axis.

    Args:
        deviation: standard deviation.
        step: time step in units of the correlation time.
    """
    noise = rng.standard_normal((shape[-1], *shape[:-1])) * deviation  # time first: fast to iterate over
    correlation = np.exp(-step)
    noise[1:] *= np.sqrt(1 - correlation**2)
    for i in range(1, len(noise)):
        noise[i] += correlation * noise[i - 1]
    return np.moveaxis(noise, 0, -1)
