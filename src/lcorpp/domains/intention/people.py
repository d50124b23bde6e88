"""People in a shopping mall as a tracker sees them; `walking.py` says how they walk.

What is seen of a person is the last seconds before he or she comes within a distance of the robot that is
drawn alike for everybody, and so are the seconds, the tracker's rate and all of its errors: only motion tells
who is interested. Two functions give the same people: `trajectories`, x and y at a fixed rate over ten
seconds, and `recordings`, of different duration, with the other channels that a mall's tracker has.

Units are metres, seconds and radians; the robot stands at the origin. Both files are loaded by their path as
part of a domain folder; they need nothing but numpy.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


def _beside(name: str) -> ModuleType:
    """Another file of this folder, loaded as this one is: by its path."""
    spec = importlib.util.spec_from_file_location(
        f"{__name__}_{name}", Path(__file__).with_name(f"{name}.py")
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


walking = _beside("walking")

POINTS = 304
"""Time points of a trajectory."""
INTERVAL = 0.033
"""Seconds between two of them, as the mall's tracker had."""
SECONDS = (10.0, 14.0)
"""How long people are recorded, uniform."""
LONGEST = 30.0
"""The longest recording that can be asked for."""
COLUMNS = ("time", "x", "y", "z", "velocity", "heading", "facing")
"""What is recorded: z is the height of the head, heading the direction of motion, facing that of the body."""

SEEN_UNTIL = (1.2, 3.0)
"""Distance from the robot at which a track ends, uniform and alike for everybody."""
JITTER = 0.004
"""Largest error in the moment of a sample of a recording; its stamp tells the true moment."""
ERROR, ERROR_TIME = 0.02, 1.0
"""Deviation of the tracker (each coordinate) and its correlation time: slow, since trackers filter."""
SWAY, SWAY_SPREAD, SWAY_LARGEST, SWAY_RATE = 0.015, 1.2, 0.05, (0.75, 1.0)
"""How far the body sways in walking, to the side and along (median), how people differ in it (deviation of
the logarithm), at most, and strides in a second. To the side .019 to .035 metres (Orendurff et al., The
effect of walking speed on center of mass displacement, JRRD 41, 2004), less where a tracker filters; fitted
to acceleration and turning of the walkers named in walking.py."""
SWAY_SPEED = 0.5
"""Below this speed people sway less."""
HIDDEN, HIDDEN_TIME = 0.6, (1.0, 4.0)
"""Share of people who are hidden once, and for how long: the tracker joins the ends by a straight line.
Fitted to the share of straight pieces in the walkers' tracks."""
HEIGHT, HEIGHT_DEVIATION = 1.65, 0.09
"""Height of the head, normal."""
ESTIMATED_OVER = 0.5
"""Velocity and heading are estimated from the way of the last half second."""
TURNED, TURN_ERROR, TURN_TIME = (0.3, 0.9), 0.3, 1.0
"""By which share of the angle people turn to what they attend to; deviation and correlation time of that."""

BLOCK = 2000
"""People simulated at once, which bounds the memory."""
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
    interested = _interested(people)
    tracks = np.empty((len(people), 2, POINTS))
    for start in range(0, len(people), BLOCK):
        rows = slice(start, start + BLOCK)
        back = np.arange(POINTS - 1, -1, -1) * INTERVAL
        seen = _seen(interested[rows], np.broadcast_to(back, (len(interested[rows]), POINTS)), rng)
        tracks[rows] = _tracked(seen.path, back[0] - back, rng)
    return tracks


def recordings(
    people: Sequence[Mapping[str, str]],
    rng: np.random.Generator,
    *,
    seconds: tuple[float, float] = SECONDS,
) -> list[Array]:
    """What a mall's tracker writes about people: for each an array (samples, 7), columns as COLUMNS.

    Args:
        people: n persons; of each only "intention" matters, "interested" or "not_interested".
        rng: source of all randomness.
        seconds: the shortest and the longest duration, drawn uniformly and alike for everybody; a duration
            is never shorter than drawn, and longer by less than INTERVAL.

    Returns:
        n arrays; time starts at 0 and rises by about INTERVAL.

    Raises:
        ValueError: a person without an intention, or with an unknown one; durations that are not
            INTERVAL <= shortest <= longest <= LONGEST.
    """
    interested = _interested(people)
    shortest, longest = seconds
    if not INTERVAL <= shortest <= longest <= LONGEST:
        raise ValueError(f"seconds is {seconds}; expected {INTERVAL} <= shortest <= longest <= {LONGEST:g}")
    found: list[Array] = []
    for start in range(0, len(people), BLOCK):
        rows = interested[start : start + BLOCK]
        drawn = rng.uniform(shortest, longest, size=len(rows))
        points = np.ceil(drawn / INTERVAL - 1e-9).astype(np.intp) + 1
        found += _recorded(rows, points, rng)
    return found


def _recorded(interested: Flags, points: npt.NDArray[np.intp], rng: np.random.Generator) -> list[Array]:
    """Recordings of so many samples (n,); the shorter ones are cut from the end of the longest."""
    n, most = len(points), int(points.max())
    moments = np.arange(most) * INTERVAL + rng.uniform(-JITTER, JITTER, size=(n, most))
    ends = np.arange(most) == most - points[:, None]  # exact at both ends, so that a duration is
    ends[:, -1] = True
    moments = np.where(ends, np.arange(most) * INTERVAL, moments)
    seen = _seen(interested, (most - 1) * INTERVAL - moments, rng)
    place = _tracked(seen.path, moments, rng)

    lag = max(1, round(ESTIMATED_OVER / INTERVAL))
    now = np.arange(most)
    first = (most - points)[:, None]
    before = np.maximum(now - lag, first)
    now = np.maximum(now, before + 1).clip(max=most - 1)  # the first sample has the second one's estimate
    row = np.arange(n)[:, None]
    before = np.minimum(before, now - 1)
    way = place.transpose(0, 2, 1)[row, now] - place.transpose(0, 2, 1)[row, before]
    velocity = np.hypot(way[..., 0], way[..., 1]) / (moments[row, now] - moments[row, before])
    heading = np.arctan2(way[..., 1], way[..., 0])

    to_robot = _wrapped(np.arctan2(-place[:, 1], -place[:, 0]) - heading)
    turned = seen.attending * rng.uniform(*TURNED, size=(n, 1))
    noise = walking.correlated(rng, (n, most), TURN_ERROR, INTERVAL / TURN_TIME)
    facing = _wrapped(heading + turned * to_robot + noise)
    height = rng.normal(HEIGHT, HEIGHT_DEVIATION, size=(n, 1))
    z = height + walking.correlated(rng, (n, most), ERROR, INTERVAL / ERROR_TIME)

    columns = np.stack([moments, place[:, 0], place[:, 1], z, velocity, heading, facing], axis=2)
    columns[..., 0] -= columns[row, first, 0]
    return [table[most - count :].copy() for table, count in zip(columns, points, strict=True)]


class _Seen(NamedTuple):
    """path: (n, 2, points) true positions. attending: (n, points) whether they attend to the robot."""

    path: Array
    attending: Flags


def _interested(people: Sequence[Mapping[str, str]]) -> Flags:
    """(n,) who is interested."""
    for person in people:
        if person.get("intention") not in INTENTIONS:
            raise ValueError(
                f"intention is {person.get('intention')!r}; expected one of {', '.join(INTENTIONS)}"
            )
    return np.array([person["intention"] == "interested" for person in people], dtype=bool)


def _seen(interested: Flags, back: Array, rng: np.random.Generator) -> _Seen:
    """Where n people truly are at moments `back` (n, points), in seconds before they come near the robot."""
    n, points = back.shape
    until = rng.uniform(*SEEN_UNTIL, size=len(back))
    where, attending = np.empty((n, 2, points)), np.empty((n, points), dtype=bool)
    missing = np.arange(n)
    while len(missing):  # who passes too far away is not the person the robot saw: another one walks
        walks = walking.walk(interested[missing], until[missing], back[missing].max(axis=1), rng)
        whole = np.flatnonzero(walks.whole)
        rows, column = missing[whole], whole[:, None]
        at = np.clip(walks.arrival[whole, None] - back[rows] / walking.STEP, 0, None)
        step = at.astype(np.intp)
        share = np.expand_dims(at - step, -1)
        after = np.minimum(step + 1, len(walks.path) - 1)
        path = walks.path[step, column] * (1 - share) + walks.path[after, column] * share
        where[rows] = path.transpose(0, 2, 1)
        attending[rows] = walks.attending[step, column]
        missing = missing[~walks.whole]
    return _Seen(where, attending)


def _tracked(path: Array, moments: Array, rng: np.random.Generator) -> Array:
    """True positions (n, 2, points) at `moments` (n or 1, points) as the tracker has them."""
    n, _, points = path.shape
    velocity = np.gradient(path, INTERVAL, axis=2)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    ahead = velocity / np.maximum(speed, 1e-6)[:, None]
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    size = np.minimum(SWAY * np.exp(SWAY_SPREAD * rng.standard_normal((n, 1))), SWAY_LARGEST)
    size = size * np.minimum(speed / SWAY_SPEED, 1)
    phase = 2 * np.pi * (rng.uniform(*SWAY_RATE, size=(n, 1)) * moments + rng.uniform(size=(2, n, 1)))
    swaying = ahead * (size * np.sin(phase[0]))[:, None] + left * (size * np.sin(phase[1]))[:, None]

    error = walking.correlated(rng, path.shape, ERROR * np.sqrt(2), INTERVAL / ERROR_TIME)
    keep = np.exp(-INTERVAL / ERROR_TIME)
    for i in range(1, points):  # filtered once more: what a tracker says does not jump
        error[..., i] = keep * error[..., i - 1] + (1 - keep) * error[..., i]
    return _joined(path + swaying + error, rng)


def _joined(place: Array, rng: np.random.Generator) -> Array:
    """Tracks (n, 2, points) in which some people were hidden once and are joined by a straight line."""
    n, _, points = place.shape
    hidden = rng.uniform(size=n) < HIDDEN
    length = np.minimum(rng.uniform(*HIDDEN_TIME, size=n) / INTERVAL, points - 1).astype(np.intp)
    first = (rng.uniform(size=n) * (points - length)).astype(np.intp)
    last = np.minimum(first + np.where(hidden, np.maximum(length, 1), 1), points - 1)
    first = np.minimum(first, last - 1)
    row = np.arange(n)
    one, other = place[row, :, first][:, :, None], place[row, :, last][:, :, None]
    share = ((np.arange(points) - first[:, None]) / (last - first)[:, None])[:, None]
    return np.where((share > 0) & (share < 1), one + (other - one) * share, place)


def _wrapped(angle: Array) -> Array:
    """Angles in (-pi, pi]."""
    return np.pi - (np.pi - angle) % (2 * np.pi)
