"""People in a shopping mall, simulated: how they walk when they want the robot, and when they do not.

Intention drives motion only through where a person wants to go and how fast; the noise knows nothing of it.
All walk down a corridor past the robot, which stands at the origin near one wall and looks across. Who is
not interested passes by, is curious (slows down, veers towards the robot, walks on) or lingers (slows down
for something else). Who is interested decides at some distance, heads for a place in front of the robot,
takes off speed on the way, and sometimes hesitates. What is seen is the last ten seconds before the person
comes within a distance of the robot that is drawn alike for everybody, so that the end tells nothing.

The model is a social force: acceleration towards the wanted velocity, pushed away by walls and robot
(Helbing and Molnar 1995). Units are metres and seconds.

This file is loaded by its path as part of a domain folder; it needs nothing but numpy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Wants = Callable[[Array, Array], tuple[Array, Array, Array]]

POINTS = 304
"""Time points of a trajectory."""
INTERVAL = 0.033
"""Seconds between two of them, as the mall's tracker had."""
STEP = 3 * INTERVAL
"""Seconds between two steps of the simulation; the points between are interpolated."""
LONGEST = 60.0
"""Seconds after which a walk that did not come near the robot is given up."""

START = 24.0
"""Distance along the corridor from which people come: at top speed still ten seconds away."""
WALLS = (-1.0, 5.0)
"""The walls of the corridor, across it; the robot stands at 0."""
LANE = (0.5, 2.0)
"""Where across the corridor people walk, uniform."""
SPEED, SPEED_DEVIATION, SPEED_RANGE = 1.15, 0.22, (0.5, 1.9)
"""Walking speed, normal and truncated."""
RELAXATION = 0.6
"""Time in which velocity adapts to the wanted one."""
STEERING, STEERING_TIME = 0.2, 1.2
"""Deviation (radians) and correlation time of the wander around the wanted heading."""
PACE, PACE_TIME = 0.08, 2.0
"""Relative deviation and correlation time of the wanted speed."""
LOOK_AHEAD = 5.0
"""How far ahead a passer-by aims along the own lane."""
WALL_PUSH, WALL_RANGE = 1.0, 0.3
"""Acceleration at a wall and the distance over which it fades."""
ROBOT_PUSH, ROBOT_RADIUS, ROBOT_RANGE = 1.0, 0.6, 0.25
"""Acceleration at the robot's radius and the distance over which it fades."""

NOTICE = (8.0, 18.0)
"""Distance from the robot at which an interested person decides to go there."""
APPROACH = (0.6, 0.85)
"""Share of the walking speed kept from then on."""
STAND, STAND_ANGLE, STAND_SPREAD = (0.8, 1.8), 1.2, 0.8
"""Where an interested person stops: distance from the robot; angle from the corridor towards the robot's
front (radians, mean and deviation)."""
BRAKING = 2.0
"""An interested person walks no faster than would cover the remaining way in this time."""
HESITATING, HESITATION, HESITATION_TIME = 1 / 3, (2.0, 7.0), (1.0, 3.0)
"""Share of interested people who hesitate, at which distance from the robot, and how long."""

CURIOUS, LINGERING = 0.2, 0.15
"""Shares of people not interested who are curious about the robot, and who linger; the rest pass by."""
CURIOSITY, CURIOUS_PACE, CURIOUS_VEER = (3.0, 10.0), (0.55, 0.9), (0.2, 0.7)
"""At which distance the curious slow down, to which share of their speed, and by which share of the own
lane they come closer."""
LINGER, LINGER_PACE, LINGER_TIME = (2.0, 12.0), (0.2, 0.7), (2.0, 6.0)
"""At which distance others linger, at which share of their speed, and how long."""

SEEN_UNTIL = (1.2, 3.0)
"""Distance from the robot at which the trajectory ends, uniform and alike for everybody."""
NOISE, NOISE_TIME = 0.04, 0.2
"""Deviation of the tracker (metres, each coordinate) and its correlation time."""

INTENTIONS = ("interested", "not_interested")


def trajectory(person: Mapping[str, str], rng: np.random.Generator) -> Array:
    """(2, POINTS) x and y in metres, INTERVAL seconds apart, of one person; see `trajectories`."""
    track: Array = trajectories([person], rng)[0]
    return track


def trajectories(people: Sequence[Mapping[str, str]], rng: np.random.Generator) -> Array:
    """(n, 2, POINTS) x and y in metres, INTERVAL seconds apart, as a tracker sees the people.

    Args:
        people: n persons; of each only "intention" matters, "interested" or "not_interested".
        rng: source of all randomness.

    Raises:
        ValueError: a person without an intention, or with an unknown one.
    """
    for person in people:
        if person.get("intention") not in INTENTIONS:
            raise ValueError(
                f"intention is {person.get('intention')!r}; expected one of {', '.join(INTENTIONS)}"
            )
    interested = np.array([person["intention"] == "interested" for person in people], dtype=bool)
    until = rng.uniform(*SEEN_UNTIL, size=len(people))
    paths = np.empty((len(people), 2, POINTS))
    missing = np.arange(len(people))
    while len(missing):  # who passes too far away is not the person the robot saw: another one walks
        found, seen = _walk(interested[missing], until[missing], rng)
        paths[missing[seen]] = found[seen]
        missing = missing[~seen]
    noisy: Array = paths + _correlated(rng, paths.shape, NOISE, INTERVAL / NOISE_TIME)
    return noisy


def _walk(interested: Flags, until: Array, rng: np.random.Generator) -> tuple[Array, Flags]:
    """One walk for each of n people.

    Args:
        interested: (n,) the intentions. until: (n,) the distances at which the trajectories end.

    Returns:
        (n, 2, POINTS) paths without noise, and (n,) whether they are whole: the others never came so near.
    """
    n = len(interested)
    side = rng.choice([-1.0, 1.0], size=n)
    lane = rng.uniform(*LANE, size=n)
    speed = np.clip(rng.normal(SPEED, SPEED_DEVIATION, size=n), *SPEED_RANGE)
    wants = _wants(interested, side, lane, rng)

    steps = int(LONGEST / STEP)
    wander = _correlated(rng, (n, steps), STEERING, STEP / STEERING_TIME)
    pace = speed[:, None] * (1 + _correlated(rng, (n, steps), PACE, STEP / PACE_TIME))
    position = np.stack([side * START, lane], axis=1)
    velocity = np.stack([-side * speed, np.zeros(n)], axis=1)
    path = np.empty((steps, n, 2))
    arrival = np.full(n, steps)
    for step in range(steps):
        path[step] = position
        distance = np.hypot(position[:, 0], position[:, 1])
        arrival = np.where((distance <= until) & (arrival == steps), step, arrival)
        if step % 20 == 0 and np.all((arrival < steps) | (position[:, 0] * side < -until)):
            break
        direction, share, limit = wants(position, distance)
        wanted = np.minimum(pace[:, step] * share, limit)
        angle = np.arctan2(direction[:, 1], direction[:, 0]) + wander[:, step]
        aim = wanted[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        velocity = velocity + STEP * ((aim - velocity) / RELAXATION + _push(position, distance))
        position = position + STEP * velocity

    needed = int(np.ceil(INTERVAL * (POINTS - 1) / STEP)) + 1
    whole = (arrival < steps) & (arrival >= needed)
    back = np.arange(POINTS - 1, -1, -1) * INTERVAL / STEP  # steps before the arrival
    at = np.maximum(np.where(whole, arrival, needed)[:, None] - back, 0.0)
    before = at.astype(np.intp)
    part = (at - before)[..., None]
    after = np.minimum(before + 1, steps - 1)
    row = np.arange(n)[:, None]
    points = path[before, row] * (1 - part) + path[after, row] * part
    return points.transpose(0, 2, 1), whole


def _wants(interested: Flags, side: Array, lane: Array, rng: np.random.Generator) -> Wants:
    """What everybody is after, as a function of position (n, 2) and distance (n,) from the robot.

    It gives the direction (n, 2) to walk in, the share (n,) of the own pace and a limit (n,) of the speed.
    """
    n = len(interested)
    kind = rng.uniform(size=n)
    notice = rng.uniform(*NOTICE, size=n)
    approach = rng.uniform(*APPROACH, size=n)
    angle = np.clip(rng.normal(STAND_ANGLE, STAND_SPREAD, size=n), 0.0, np.pi / 2)
    stand = rng.uniform(*STAND, size=n)[:, None] * np.stack([side * np.cos(angle), np.sin(angle)], axis=1)
    hesitates = interested & (kind < HESITATING)
    curious = ~interested & (kind < CURIOUS)
    lingers = ~interested & (kind >= CURIOUS) & (kind < CURIOUS + LINGERING)
    curiosity = rng.uniform(*CURIOSITY, size=n)
    curious_pace = rng.uniform(*CURIOUS_PACE, size=n)
    near_lane = lane * (1 - rng.uniform(*CURIOUS_VEER, size=n))
    pause_at = np.where(hesitates, rng.uniform(*HESITATION, size=n), rng.uniform(*LINGER, size=n))
    pause_time = np.where(hesitates, rng.uniform(*HESITATION_TIME, size=n), rng.uniform(*LINGER_TIME, size=n))
    pause_pace = np.where(hesitates, 0.25, rng.uniform(*LINGER_PACE, size=n))
    paused = np.zeros(n)
    decided = np.zeros(n, dtype=bool)
    drawn = np.zeros(n, dtype=bool)

    def wants(position: Array, distance: Array) -> tuple[Array, Array, Array]:
        decided[:] |= interested & (distance < notice)
        drawn[:] |= curious & (distance < curiosity)
        pausing = (hesitates | lingers) & (distance < pause_at) & (paused < pause_time)
        paused[pausing] += STEP
        ahead = np.stack([-side * LOOK_AHEAD, np.where(drawn, near_lane, lane) - position[:, 1]], axis=1)
        there = stand - position
        direction = np.where(decided[:, None], there, ahead)
        share = np.where(decided, approach, 1.0)
        share = np.where(drawn & (position[:, 0] * side > 0), curious_pace, share)
        share = np.where(pausing, pause_pace, share)
        limit = np.where(decided, np.hypot(there[:, 0], there[:, 1]) / BRAKING + 0.1, np.inf)
        return direction, share, limit

    return wants


def _push(position: Array, distance: Array) -> Array:
    """(n, 2) acceleration away from the walls and the robot at positions (n, 2), distances (n,) from it."""
    away = np.exp((ROBOT_RADIUS - distance) / ROBOT_RANGE) * ROBOT_PUSH
    push = position / np.maximum(distance, 1e-6)[:, None] * np.minimum(away, ROBOT_PUSH)[:, None]
    low, high = WALLS
    push[:, 1] += WALL_PUSH * np.exp(np.minimum(low - position[:, 1], 0) / WALL_RANGE)
    push[:, 1] -= WALL_PUSH * np.exp(np.minimum(position[:, 1] - high, 0) / WALL_RANGE)
    return push


def _correlated(rng: np.random.Generator, shape: tuple[int, ...], deviation: float, step: float) -> Array:
    """Stationary noise of `shape`, correlated along the last axis; `step` in units of correlation times."""
    noise = rng.standard_normal((shape[-1], *shape[:-1])) * deviation  # time first: that is quick to go along
    keep = np.exp(-step)
    noise[1:] *= np.sqrt(1 - keep**2)
    for i in range(1, len(noise)):
        noise[i] += keep * noise[i - 1]
    return np.moveaxis(noise, 0, -1)
