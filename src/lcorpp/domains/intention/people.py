"""Simulated people in a shopping mall as a tracker records them; `walking.py` simulates how they walk.

A track ends when the person comes within a random distance of the robot. This distance, the duration, the
sampling rate and all tracker errors have the same distribution for both classes: only the motion depends on
the intention. Three functions simulate the same people: `trajectories`, x and y at a fixed rate over ten
seconds, `recordings`, with random durations and all channels of the mall's tracker, and `legs`, as a laser
scanner on the robot sees them.

Units are metres, seconds and radians; the robot is at (0, 0). Both files are loaded by path as part of a
domain folder and need no other library than numpy.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.values import wrap_angle

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


def _load_sibling(name: str) -> ModuleType:
    """Load another file of this folder by its path, as this file is loaded."""
    spec = importlib.util.spec_from_file_location(
        f"{__name__}_{name}", Path(__file__).with_name(f"{name}.py")
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


walking = _load_sibling("walking")

POINTS = 304
"""Time points of a trajectory."""
INTERVAL = 0.033
"""Seconds between two time points, as the mall's tracker had."""
DURATION = (10.0, 14.0)
"""Duration of a recording, uniform."""
MAX_DURATION = 60.0
"""Maximum duration of a recording."""
COLUMNS = ("time", "x", "y", "z", "velocity", "heading", "facing")
"""Columns of a recording. z: height of the head. heading: direction of motion. facing: that of the body."""

END_DISTANCE = (1.2, 3.0)
"""Distance from the robot at which a track ends, uniform and equal for both classes."""
TIME_JITTER = 0.004
"""Maximum deviation of a sample from the regular time; its time stamp is exact."""
TRACKER_ERROR, TRACKER_TIME = 0.02, 1.0
"""Standard deviation of the position error per coordinate, and its correlation time (trackers filter)."""
SWAY, SWAY_SPREAD, MAX_SWAY, STRIDE_RATE = 0.015, 1.2, 0.05, (0.75, 1.0)
"""Lateral sway of the body in walking: median amplitude, standard deviation of its logarithm, maximum, and
strides per second. Lateral sway is .019 to .035 metres (Orendurff et al., The effect of walking speed on
center of mass displacement, JRRD 41, 2004), less after a tracker's filter; fitted to acceleration and turning
of the walkers named in walking.py."""
SWAY_SPEED = 0.5
"""Below this speed people sway less."""
P_OCCLUDED, OCCLUSION_TIME = 0.6, (1.0, 4.0)
"""Probability that a person is occluded once, and for how long; the tracker interpolates linearly. Fitted to
the share of straight pieces in the walkers' tracks."""
HEIGHT, HEIGHT_DEVIATION = 1.65, 0.09
"""Height of the head, normal."""
VELOCITY_WINDOW = 0.5
"""Velocity and heading are estimated from the displacement in this time."""
TURN, TURN_ERROR, TURN_TIME = (0.3, 0.9), 0.3, 1.0
"""Fraction of the angle by which people turn towards what they attend to; standard deviation and correlation
time of its error."""

LEG_POINTS, LEG_INTERVAL = 41, 0.1
"""Time points of a track of legs, and seconds between two: a laser finds legs only nearby."""
LEG_ERROR = 0.06
"""Standard deviation per coordinate of the middle of two legs, in each scan: the feet swing."""

BLOCK_SIZE = 2000
"""People simulated at once, which bounds the memory."""
INTENTIONS = ("interested", "not_interested")


def trajectory(person: Mapping[str, str], rng: np.random.Generator) -> Array:
    """(2, POINTS) x and y in metres, INTERVAL seconds apart, of one person; see `trajectories`."""
    track: Array = trajectories([person], rng)[0]
    return track


def trajectories(people: Sequence[Mapping[str, str]], rng: np.random.Generator) -> Array:
    """(n, 2, POINTS) x and y in metres, INTERVAL seconds apart, with tracker errors.

    Args:
        people: n people; only "intention" is used, "interested" or "not_interested".
        rng: source of all randomness.

    Raises:
        ValueError: a person with a missing or unknown intention.
    """
    return _simulate_tracks(people, POINTS, INTERVAL, _add_tracker_errors, rng)


def legs(people: Sequence[Mapping[str, str]], rng: np.random.Generator) -> Array:
    """(n, 2, LEG_POINTS) x and y of the middle of the legs, LEG_INTERVAL seconds apart, by a laser scanner.

    The walks are others than those of `trajectories`, so that classifiers trained on both make independent
    errors. On a robot both senses see one walk: knowledge_around.plog has the rates of labels of one walk.

    Args:
        people: n people; only "intention" is used, "interested" or "not_interested".
        rng: source of all randomness.

    Raises:
        ValueError: a person with a missing or unknown intention.
    """
    return _simulate_tracks(people, LEG_POINTS, LEG_INTERVAL, _add_leg_errors, rng)


def _simulate_tracks(
    people: Sequence[Mapping[str, str]],
    points: int,
    interval: float,
    add_errors: Callable[[Array, Array, np.random.Generator], Array],
    rng: np.random.Generator,
) -> Array:
    """(n, 2, points) the ends of n walks; add_errors: of a sensor, to paths (n, 2, points) at times."""
    interested = _read_interested(people)
    tracks = np.empty((len(people), 2, points))
    for start in range(0, len(people), BLOCK_SIZE):
        rows = slice(start, start + BLOCK_SIZE)
        time_left = np.arange(points - 1, -1, -1) * interval
        walks = _walk(interested[rows], np.broadcast_to(time_left, (len(interested[rows]), points)), rng)
        tracks[rows] = add_errors(walks.path, time_left[0] - time_left, rng)
    return tracks


def _add_leg_errors(path: Array, _times: Array, rng: np.random.Generator) -> Array:
    """Positions (n, 2, points) with errors of a laser scanner and of the feet."""
    return path + LEG_ERROR * rng.standard_normal(path.shape)


def recordings(
    people: Sequence[Mapping[str, str]], rng: np.random.Generator, *, seconds: tuple[float, float] = DURATION
) -> list[Array]:
    """One array (samples, 7) for each person as the mall's tracker records it, columns as COLUMNS.

    Args:
        people: n people; only "intention" is used, "interested" or "not_interested".
        rng: source of all randomness.
        seconds: minimum and maximum duration, uniform and equal for both classes; durations are rounded up
            to multiples of INTERVAL.

    Returns:
        n arrays; time starts at 0 and increases by about INTERVAL.

    Raises:
        ValueError: a person with a missing or unknown intention, or durations that violate
            INTERVAL <= shortest <= longest <= MAX_DURATION.
    """
    interested = _read_interested(people)
    shortest, longest = seconds
    if not INTERVAL <= shortest <= longest <= MAX_DURATION:
        raise ValueError(
            f"seconds is {seconds}; expected {INTERVAL} <= shortest <= longest <= {MAX_DURATION:g}"
        )
    tables: list[Array] = []
    for start in range(0, len(people), BLOCK_SIZE):
        rows = interested[start : start + BLOCK_SIZE]
        durations = rng.uniform(shortest, longest, size=len(rows))
        samples = np.ceil(durations / INTERVAL - 1e-9).astype(np.intp) + 1
        tables += _simulate_recordings(rows, samples, rng)
    return tables


def _simulate_recordings(
    interested: Flags, samples: npt.NDArray[np.intp], rng: np.random.Generator
) -> list[Array]:
    """Return n recordings, of `samples` (n,) rows; each is the end of a walk of the maximum length."""
    n, max_samples = len(samples), int(samples.max())
    times = np.arange(max_samples) * INTERVAL + rng.uniform(-TIME_JITTER, TIME_JITTER, size=(n, max_samples))
    # no jitter at both ends: the duration is exact
    ends = np.arange(max_samples) == max_samples - samples[:, None]
    ends[:, -1] = True
    times = np.where(ends, np.arange(max_samples) * INTERVAL, times)
    walks = _walk(interested, (max_samples - 1) * INTERVAL - times, rng)
    position = _add_tracker_errors(walks.path, times, rng)
    velocity, heading = _estimate_velocity(position, times, samples)

    to_robot = wrap_angle(np.arctan2(-position[:, 1], -position[:, 0]) - heading)
    turn = walks.attending * rng.uniform(*TURN, size=(n, 1))
    noise = walking.draw_correlated_noise(rng, (n, max_samples), TURN_ERROR, INTERVAL / TURN_TIME)
    facing = wrap_angle(heading + turn * to_robot + noise)
    height = rng.normal(HEIGHT, HEIGHT_DEVIATION, size=(n, 1))
    z = height + walking.draw_correlated_noise(rng, (n, max_samples), TRACKER_ERROR, INTERVAL / TRACKER_TIME)

    columns = np.stack([times, position[:, 0], position[:, 1], z, velocity, heading, facing], axis=2)
    columns[..., 0] -= columns[np.arange(n)[:, None], (max_samples - samples)[:, None], 0]
    return [table[max_samples - count :].copy() for table, count in zip(columns, samples, strict=True)]


def _estimate_velocity(position: Array, times: Array, samples: npt.NDArray[np.intp]) -> tuple[Array, Array]:
    """Speed and heading (n, points) from the displacement in VELOCITY_WINDOW before each sample."""
    n, max_samples = times.shape
    now = np.arange(max_samples)
    first = (max_samples - samples)[:, None]
    before = np.maximum(now - max(1, round(VELOCITY_WINDOW / INTERVAL)), first)
    # the first sample gets the second one's estimate
    now = np.maximum(now, before + 1).clip(max=max_samples - 1)
    row = np.arange(n)[:, None]
    before = np.minimum(before, now - 1)
    shift = position.transpose(0, 2, 1)[row, now] - position.transpose(0, 2, 1)[row, before]
    velocity = np.hypot(shift[..., 0], shift[..., 1]) / (times[row, now] - times[row, before])
    return velocity, np.arctan2(shift[..., 1], shift[..., 0])


class _TimedWalks(NamedTuple):
    """path: (n, 2, points) true positions. attending: (n, points) whether they attend to the robot."""

    path: Array
    attending: Flags


def _read_interested(people: Sequence[Mapping[str, str]]) -> Flags:
    """Return whether each person is interested, (n,)."""
    for person in people:
        if person.get("intention") not in INTENTIONS:
            raise ValueError(
                f"intention is {person.get('intention')!r}; expected one of {', '.join(INTENTIONS)}"
            )
    return np.array([person["intention"] == "interested" for person in people], dtype=bool)


def _walk(interested: Flags, time_left: Array, rng: np.random.Generator) -> _TimedWalks:
    """Simulate n people.

    Args:
        interested: (n,) whether each person is interested.
        time_left: (n, points) times at which to return the state, in seconds before the track's end.
    """
    n, points = time_left.shape
    end_distance = rng.uniform(*END_DISTANCE, size=len(time_left))
    position, attending = np.empty((n, 2, points)), np.empty((n, points), dtype=bool)
    missing = np.arange(n)
    while len(missing):  # rejection sampling: walks that never come near the robot are drawn again
        walks = walking.walk(interested[missing], end_distance[missing], time_left[missing].max(axis=1), rng)
        accepted = np.flatnonzero(walks.accepted)
        rows, column = missing[accepted], accepted[:, None]
        at = np.clip(walks.arrival[accepted, None] - time_left[rows] / walking.TIME_STEP, 0, None)
        step = at.astype(np.intp)
        weight = np.expand_dims(at - step, -1)
        after = np.minimum(step + 1, len(walks.path) - 1)
        path = walks.path[step, column] * (1 - weight) + walks.path[after, column] * weight
        position[rows] = path.transpose(0, 2, 1)
        attending[rows] = walks.attending[step, column]
        missing = missing[~walks.accepted]
    return _TimedWalks(position, attending)


def _add_tracker_errors(path: Array, times: Array, rng: np.random.Generator) -> Array:
    """Positions (n, 2, points) at `times` (n or 1, points) with sway, tracker errors and occlusions."""
    n, _, points = path.shape
    velocity = np.gradient(path, INTERVAL, axis=2)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    ahead = velocity / np.maximum(speed, 1e-6)[:, None]
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    amplitude = np.minimum(SWAY * np.exp(SWAY_SPREAD * rng.standard_normal((n, 1))), MAX_SWAY)
    amplitude = amplitude * np.minimum(speed / SWAY_SPEED, 1)
    phase = 2 * np.pi * (rng.uniform(*STRIDE_RATE, size=(n, 1)) * times + rng.uniform(size=(2, n, 1)))
    sway = ahead * (amplitude * np.sin(phase[0]))[:, None] + left * (amplitude * np.sin(phase[1]))[:, None]

    error = walking.draw_correlated_noise(
        rng, path.shape, TRACKER_ERROR * np.sqrt(2), INTERVAL / TRACKER_TIME
    )
    keep = np.exp(-INTERVAL / TRACKER_TIME)
    for i in range(1, points):  # second low-pass filter: a tracker's output does not jump
        error[..., i] = keep * error[..., i - 1] + (1 - keep) * error[..., i]
    return _interpolate_occlusions(path + sway + error, rng)


def _interpolate_occlusions(position: Array, rng: np.random.Generator) -> Array:
    """Tracks (n, 2, points) in which some people are occluded once and interpolated linearly."""
    n, _, points = position.shape
    occluded = rng.uniform(size=n) < P_OCCLUDED
    length = np.minimum(rng.uniform(*OCCLUSION_TIME, size=n) / INTERVAL, points - 1).astype(np.intp)
    first = (rng.uniform(size=n) * (points - length)).astype(np.intp)
    last = np.minimum(first + np.where(occluded, np.maximum(length, 1), 1), points - 1)
    first = np.minimum(first, last - 1)
    row = np.arange(n)
    start, end = position[row, :, first][:, :, None], position[row, :, last][:, :, None]
    weight = ((np.arange(points) - first[:, None]) / (last - first)[:, None])[:, None]
    return np.where((weight > 0) & (weight < 1), start + (end - start) * weight, position)
