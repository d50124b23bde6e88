"""Simulated visitors of a museum: how they walk near the guide robot, and where they look.

The wish determines the motion, the attention determines the gaze; some people move or look like others, so
that classifiers make errors. The numbers are assumptions. Units are metres and seconds; the robot is at
(0, 0). The file is loaded by path as part of a domain folder and needs only numpy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Person = Mapping[str, str]

POINTS, INTERVAL = 100, 0.1
"""Time points of a track, and seconds between two."""
START_DISTANCE = (5.0, 8.0)
"""Distance from the robot at which a track starts; uniform, as all ranges here."""
SPEED = {"tour": (0.5, 1.0), "directions": (0.9, 1.5), "nothing": (0.6, 1.4)}
"""Walking speed by wish."""
STOP_DISTANCE = {"tour": (1.5, 3.5), "directions": (0.7, 1.3)}
"""Distance at which visitors with a wish stop: those who want a tour wait and watch the robot from afar."""
PASSING_DISTANCE = (1.0, 4.0)
"""Distance from the robot at which the others pass."""
SWAY, SWAY_TIME = 0.05, 0.8
"""Standard deviation of the distance from the path (errors of a tracker included), its correlation time."""
P_UNTYPICAL_MOTION, P_UNTYPICAL_GAZE = 0.3, 0.15
"""Probabilities that a person moves or looks like a person of any class."""

WISHES = ("tour", "directions", "nothing")
ATTENTIONS = ("robot", "exhibits", "surroundings")
LOOKS = {"robot": (6.0, 2.0, 2.0), "exhibits": (1.5, 7.0, 2.0), "surroundings": (2.0, 2.5, 6.0)}
"""Concentration of the Dirichlet distribution of the time spent looking at robot, exhibits and elsewhere."""
FIXATION = {"robot": 1.2, "exhibits": 2.0, "surroundings": 0.6}
"""Median duration of a look in seconds; its logarithm has standard deviation FIXATION_SPREAD."""
FIXATION_SPREAD = 0.4


def motion(people: Sequence[Person], rng: np.random.Generator) -> Array:
    """(n, 2, POINTS) x and y, INTERVAL seconds apart, by each person's "wish"."""
    styles = _draw_styles([person["wish"] for person in people], WISHES, P_UNTYPICAL_MOTION, rng)
    return np.array([_walk(style, rng) for style in styles]).reshape(-1, 2, POINTS)


def gaze(people: Sequence[Person], rng: np.random.Generator) -> Array:
    """(n, 4) features by each person's "attention".

    They are the shares of time in which the person looks at the robot and at exhibits, the median duration of
    a look in seconds, and the number of head turns per second.
    """
    styles = _draw_styles([person["attention"] for person in people], ATTENTIONS, P_UNTYPICAL_GAZE, rng)
    rows = []
    for style in styles:
        robot, exhibits, _ = rng.dirichlet(LOOKS[style])
        fixation = FIXATION[style] * np.exp(FIXATION_SPREAD * rng.standard_normal())
        rows.append((robot, exhibits, fixation, rng.poisson(10 / fixation) / 10))
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


def _draw_styles(
    classes: Sequence[str], known: Sequence[str], untypical: float, rng: np.random.Generator
) -> list[str]:
    """Return the class that each person behaves like: its own, or with a probability any of `known`."""
    drawn = rng.integers(len(known), size=len(classes))
    own = rng.random(len(classes)) >= untypical
    return [name if keeps else known[k] for name, keeps, k in zip(classes, own, drawn, strict=True)]


def _walk(style: str, rng: np.random.Generator) -> Array:
    """(2, POINTS) the track of one person: straight to the goal, where visitors with a wish stop."""
    bearing = rng.uniform(0, 2 * np.pi)
    toward = -np.array([np.cos(bearing), np.sin(bearing)])
    aside = np.array([-toward[1], toward[0]])
    distance = rng.uniform(*START_DISTANCE)
    walked = rng.uniform(*SPEED[style]) * INTERVAL * np.arange(POINTS)
    if style in STOP_DISTANCE:
        walked = np.minimum(walked, distance - rng.uniform(*STOP_DISTANCE[style]))
        offset = 0.0
    else:
        offset = rng.uniform(*PASSING_DISTANCE) * rng.choice([-1.0, 1.0])
    path: Array = np.outer(toward, walked - distance) + offset * aside[:, None]
    return path + _draw_sway(rng)


def _draw_sway(rng: np.random.Generator) -> Array:
    """(2, POINTS) correlated noise with standard deviation SWAY."""
    kept = np.exp(-INTERVAL / SWAY_TIME)
    noise = SWAY * rng.standard_normal((2, POINTS))
    for k in range(1, POINTS):
        noise[:, k] = kept * noise[:, k - 1] + np.sqrt(1 - kept**2) * noise[:, k]
    return noise
