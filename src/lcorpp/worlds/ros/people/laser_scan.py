"""People in laser scans: legs in each scan, paired and tracked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import hypot, inf, isfinite, isnan, pi

import numpy as np

from lcorpp.camera.tracker import Tracker, TrackerOptions
from lcorpp.errors import WorldError
from lcorpp.values import Array
from lcorpp.worlds.ros.connection import Message
from lcorpp.worlds.ros.fields import FaultLog, read_list, read_number, read_stamp
from lcorpp.worlds.ros.sensor_messages import Detection

LASER = "sensor_msgs/LaserScan"
"""The type of the messages of a laser scanner."""

MAX_LEG_RANGE = 8.0
"""Metres beyond which no leg is looked for: few rays hit one."""
MAX_GAP, GAP_STEPS = 0.1, 2.5
"""Maximum distance of neighbouring points of one leg: metres, or steps between rays if these are longer."""
MIN_POINTS, LEG_WIDTH = 3, (0.05, 0.3)
"""Minimum number of points of a leg; minimum and maximum of its width in metres, with trousers."""
MIN_STEP = 0.15
"""Metres by which what is beside a leg is farther away: a part of a wall is no leg."""
LEG_RADIUS = 0.05
"""Metres from the visible side of a leg to its middle."""
MAX_STRIDE = 0.75
"""Metres between the legs of one person."""
MIN_MOTION = 0.3
"""Metres that a track has to move before it is a person: legs of tables stay."""
MAX_WAITING = 600
"""Samples of a track that are kept until it has moved: the latest."""
MAX_BACK = 1.0
"""Seconds that a stamp may be before the last one; a scan further back starts the tracks anew."""

TRACKER = TrackerOptions(noise=0.12, min_hits=4, max_gap=1.0)
"""Of people by their legs, whose middle sways as they walk."""


def find_legs(ranges: Array, angles: Array) -> Array:
    """Return (n, 2) the middles of the legs in a scan, in metres, x ahead of the scanner and y to its left.

    A leg is a run of neighbouring points of the width of a leg, in front of what is on both sides of it.
    Points at the ends of a scan that is no full circle are not used.

    Args:
        ranges: (k,) metres; infinite or NaN where there is no echo. angles: (k,) radians, evenly spaced.

    Source: the geometric criteria of Bellotto and Hu, Multisensor-based human detection and tracking for
    mobile service robots, IEEE Transactions on Systems, Man and Cybernetics B 39, 2009, section III.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.worlds.ros.people.laser_scan import find_legs
        >>> angles = np.radians(np.arange(-90, 91, 0.5))
        >>> ranges = np.full(len(angles), 5.0)
        >>> ranges[178:183] = 2.0  # straight ahead, five rays wide
        >>> find_legs(ranges, angles).round(2).tolist()
        [[2.05, 0.0]]
    """
    if len(ranges) < MIN_POINTS + 2:
        return np.zeros((0, 2))
    step = abs(float(angles[1] - angles[0]))
    distance = np.where(np.isfinite(ranges), ranges, np.inf)
    if abs(len(ranges) * step - 2 * pi) < 1.5 * step:  # a full circle begins behind a gap
        start = int(np.argmax(np.abs(np.diff(np.minimum(distance, 1e6), append=min(distance[0], 1e6)))) + 1)
        distance, angles = np.roll(distance, -start), np.roll(angles, -start)
        around = np.r_[-1, 0 : len(angles), 0]  # with a neighbour at both ends
        distance, angles = distance[around], angles[around]
    near = np.where(distance <= MAX_LEG_RANGE, distance, 0.0)
    points = near[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    gaps = np.hypot(*np.diff(points, axis=0).T)
    limits = np.maximum(MAX_GAP, GAP_STEPS * step * np.minimum(near[1:], near[:-1]))
    is_hit = distance <= MAX_LEG_RANGE
    breaks = np.flatnonzero((gaps > limits) | ~is_hit[1:] | ~is_hit[:-1]) + 1
    legs = []
    for begin, end in zip(breaks[:-1].tolist(), breaks[1:].tolist(), strict=True):
        if end - begin < MIN_POINTS or not is_hit[begin]:
            continue
        width = hypot(*(points[end - 1] - points[begin]))
        behind = min(distance[begin - 1] - distance[begin], distance[end] - distance[end - 1])
        if LEG_WIDTH[0] <= width <= LEG_WIDTH[1] and behind >= MIN_STEP:
            middle = points[begin:end].mean(axis=0)
            legs.append(middle * (1 + LEG_RADIUS / hypot(*middle)))
    return np.array(legs).reshape(-1, 2)


def pair_legs(legs: Array) -> Array:
    """Return (n, 2) the middles of people: of the nearest pairs of legs, and legs that have no other.

    Args:
        legs: (m, 2) metres.
    """
    apart = np.hypot(*(legs[:, None] - legs).transpose(2, 0, 1))
    first, second = np.triu_indices(len(legs), 1)
    free, people = set(range(len(legs))), list[Array]()
    for k in np.argsort(apart[first, second], kind="stable"):
        i, j = int(first[k]), int(second[k])
        if apart[i, j] > MAX_STRIDE:
            break
        if {i, j} <= free:
            free -= {i, j}
            people.append((legs[i] + legs[j]) / 2)
    return np.array([*people, *(legs[i] for i in sorted(free))]).reshape(-1, 2)


@dataclass
class _Candidate:
    """A track that has not moved yet. first: where it began. samples: time, x and y."""

    first: tuple[float, float]
    samples: list[tuple[float, float, float]] = field(default_factory=list)


class LaserReader:
    """Read the scans of one scanner: people who have moved, with ids of its own tracker.

    Args:
        topic: that warnings name. frame: the fixed frame.
        place: returns a point of the scanner's frame, x ahead and y to the left, in the fixed frame.

    Examples:
        >>> from lcorpp.worlds.ros.people.laser_scan import LaserReader
        >>> reader = LaserReader("/scan", "map", lambda x, y: (x, y))
        >>> reader.read({"ranges": []})  # with a warning: it has no stamp
        []
    """

    def __init__(self, topic: str, frame: str, place: Callable[[float, float], tuple[float, float]]) -> None:
        self._faults, self._frame, self._place = FaultLog(topic), frame.lstrip("/"), place
        self._tracker, self._time, self._run = Tracker(TRACKER), float("-inf"), 1
        self._waiting, self._people = dict[int, _Candidate](), set[int]()

    def read(self, message: Message) -> list[Detection]:
        """Return the new samples of people; a scan that cannot be read is left out, with a warning."""
        try:
            time, ranges, angles = _read_scan(message)
        except WorldError as fault:
            self._faults.warn(f"a message that is not {LASER} is left out: {fault}")
            return []
        if time <= self._time:
            if self._time - time <= MAX_BACK:
                self._faults.warn("a scan whose stamp is not after the last one is left out", "order")
                return []
            self._tracker, self._run = Tracker(TRACKER), self._run + 1
            self._waiting, self._people = {}, set()
        self._time = time
        people = [self._place(x, y) for x, y in pair_legs(find_legs(ranges, angles)).tolist()]
        samples = [
            Detection(f"{self._run}-{id}", self._frame, at, x, y)
            for at, id, x, y in self._tracker.update(time, people)
            for at, x, y in self._take(id, at, x, y)
        ]
        present = self._tracker.people.keys()
        self._people &= present
        self._waiting = {id: own for id, own in self._waiting.items() if id in present}
        return samples

    def _take(self, id: int, time: float, x: float, y: float) -> list[tuple[float, float, float]]:
        """Return the samples of a track that are of a person now: none before it has moved, then all."""
        if id in self._people:
            return [(time, x, y)]
        candidate = self._waiting.setdefault(id, _Candidate((x, y)))
        candidate.samples.append((time, x, y))
        del candidate.samples[:-MAX_WAITING]
        if hypot(x - candidate.first[0], y - candidate.first[1]) < MIN_MOTION:
            return []
        self._people.add(id)
        return self._waiting.pop(id).samples


def _read_scan(message: Message) -> tuple[float, Array, Array]:
    """Return the stamp in seconds, and (k,) ranges and angles; a range without an echo is infinite.

    Raises:
        WorldError: a field is missing or has another type, or there is no stamp.
    """
    time = read_stamp(message, "header", "stamp")
    if time is None or not isfinite(time):
        raise WorldError("it has no stamp")
    first, step = (read_number(message, name) for name in ("angle_min", "angle_increment"))
    low, high = (read_number(message, name) for name in ("range_min", "range_max"))
    if not (isfinite(first) and 0 < abs(step) < pi):
        raise WorldError(f"angle_min is {first:g} and angle_increment {step:g}; expected radians")
    low, high = (0.0 if isnan(low) else low), (inf if isnan(high) else high)  # rosbridge writes null for inf
    if not low < high:
        raise WorldError(f"range_min is {low:g} and range_max {high:g}; expected the first to be less")
    listed = read_list(message, "ranges")
    try:
        ranges = np.array([np.inf if r is None else r for r in listed], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        ranges = np.zeros((0, 0))
    if ranges.ndim != 1:
        raise WorldError("'ranges' has something else than numbers")
    ranges = np.where((ranges >= low) & (ranges <= high), ranges, np.inf)
    angles: Array = first + step * np.arange(len(ranges), dtype=np.float64)
    return time, ranges, angles
