"""Simulated faces of people before a robot: two seconds of position and gaze, thirty samples a second.

The numbers are fitted to ten tracks of three people in eight recordings of ROS4HRI's hri_engagement, five of
people who are engaged with the robot and five of others. Of each track they are the mean direction of the
face relative to the direction to the camera, the standard deviations of its yaw and pitch, the distance, and
the sway in two seconds. The distributions below have the mean and the standard deviation, or for sizes the
median and the spread of the logarithm, of each class. They are independent, and angles keep their value as
long as in the recordings. All people stand before the robot.

Units are metres, radians and seconds. The file is loaded by path as part of a domain folder and needs only
numpy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Person = Mapping[str, str]

POINTS, INTERVAL = 61, 1 / 30
"""Time points of a signal, and seconds between two."""
DISTANCE = {"engaged": (1.11, 0.24), "not_engaged": (1.22, 0.25)}
MIN_DISTANCE = 0.4
"""Mean and standard deviation of the distance of the face from the camera, and the minimum."""
OFFSET = (np.radians(10.0), np.radians(5.0))
"""Of the angle between the camera's axis and the direction to the face; either side."""
ANGLE = {
    "engaged": (np.radians(23.0), np.radians(4.6)),
    "not_engaged": (np.radians(28.9), np.radians(5.0)),
}
AZIMUTH = {
    "engaged": (np.radians(36.0), np.radians(38.0)),
    "not_engaged": (np.radians(53.0), np.radians(20.0)),
}
"""Of the mean direction of the face, in polar coordinates around the direction to the camera: the camera is
beside the robot's face, so nobody looks straight at it."""
YAW_SPREAD = {"engaged": (np.radians(2.9), 1.1), "not_engaged": (np.radians(14.7), 0.4)}
PITCH_SPREAD = {"engaged": (np.radians(2.5), 1.0), "not_engaged": (np.radians(5.1), 0.4)}
"""Median, and standard deviation of the logarithm, of a person's standard deviation of yaw and pitch."""
SWAY_AHEAD = {"engaged": (0.028, 0.8), "not_engaged": (0.042, 0.25)}
SWAY_ASIDE = {"engaged": (0.006, 1.1), "not_engaged": (0.019, 0.35)}
"""The same of the position of the head."""
GAZE_TIME, SWAY_TIME = 0.55, 0.8
"""Correlation times."""


def motion(people: Sequence[Person], rng: np.random.Generator) -> Array:
    """(n, 2, POINTS) x ahead of the robot and y to its left, by each person's "engagement"."""
    return np.array([_stand(person["engagement"], rng) for person in people]).reshape(-1, 2, POINTS)


def gaze(people: Sequence[Person], rng: np.random.Generator) -> Array:
    """(n, 5, POINTS) x, y, gaze_angle, robot_angle and face_distance, by each person's "engagement"."""
    rows = []
    for person in people:
        style = person["engagement"]
        x, y = _stand(style, rng)
        mean, azimuth = rng.normal(*ANGLE[style]), rng.normal(*AZIMUTH[style])
        yaw = mean * np.cos(azimuth) + _vary(YAW_SPREAD[style], GAZE_TIME, rng)
        pitch = mean * np.sin(azimuth) + _vary(PITCH_SPREAD[style], GAZE_TIME, rng)
        angle = np.arccos(np.clip(np.cos(yaw) * np.cos(pitch), -1.0, 1.0))
        rows.append([x, y, angle, np.abs(np.arctan2(y, x)), np.hypot(x, y)])
    return np.array(rows, dtype=np.float64).reshape(-1, 5, POINTS)


def gaze_rule(people: Sequence[Person], rng: np.random.Generator) -> Array:
    """As `gaze`, of other seconds of the person."""
    return gaze(people, rng)


def _stand(style: str, rng: np.random.Generator) -> Array:
    """(2, POINTS) the position of a person who stands and sways."""
    distance = max(rng.normal(*DISTANCE[style]), MIN_DISTANCE)
    bearing = rng.normal(*OFFSET) * rng.choice([-1.0, 1.0])
    place = distance * np.array([np.cos(bearing), np.sin(bearing)])
    sway = [_vary(size[style], SWAY_TIME, rng) for size in (SWAY_AHEAD, SWAY_ASIDE)]
    track: Array = place[:, None] + np.array(sway)
    return track


def _vary(spread: tuple[float, float], seconds: float, rng: np.random.Generator) -> Array:
    """(POINTS,) a stationary process of mean 0, whose standard deviation is drawn.

    Args:
        spread: median, and standard deviation of the logarithm, of the standard deviation.
        seconds: correlation time.
    """
    kept = np.exp(-INTERVAL / seconds)
    noise = rng.standard_normal(POINTS)
    for k in range(1, POINTS):
        noise[k] = kept * noise[k - 1] + np.sqrt(1 - kept**2) * noise[k]
    size: float = spread[0] * np.exp(spread[1] * rng.standard_normal())
    return size * noise
