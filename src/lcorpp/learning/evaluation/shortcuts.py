"""What a track tells apart from motion: where it ends, how long it is, how it was sampled.

The traces of sampling are those that resampling leaves in exact numbers: points on a straight line
between two others, positions that repeat to the last digit, values on a grid. Rough and smooth motion look
alike here, so that a difference in how people move is not taken for one in how they were recorded.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from lcorpp.learning.data.tracks import Track
from lcorpp.values import Array

Flags = npt.NDArray[np.bool_]

EXACT = 1e-9
"""Relative to the largest position: what a sum of numbers with 15 digits leaves of zero."""

MILLIMETRE = 1e-3

TRACES: Mapping[str, tuple[str, ...]] = {
    "end position": ("x", "y"),
    "duration": ("duration", "samples"),
    "sampling": (
        "mean interval",
        "median interval",
        "deviation of the interval",
        "longest interval",
        "share on a straight line",
        "longest straight line",
        "share that repeat",
        "share in whole millimetres",
    ),
}
"""What is looked at, in which order."""


def traces_of(track: Track) -> dict[str, Array]:
    """For each name of `TRACES` the numbers of one track."""
    place, step = track.positions, np.diff(track.times)
    size = max(float(np.abs(place).max()), MILLIMETRE) * EXACT
    straight = _straight(track, size)
    still = np.all(np.abs(np.diff(place, axis=1)) <= size, axis=0)
    on_grid = np.all(np.abs(place / MILLIMETRE - np.round(place / MILLIMETRE)) <= size / MILLIMETRE, axis=0)
    sampling = (
        *(step.mean(), np.median(step), step.std(), step.max()),
        *(straight.mean() if len(straight) else 0.0, _longest_run(straight)),
        *(still.mean(), on_grid.mean()),
    )
    return {
        "end position": place[:, -1],
        "duration": np.array([track.duration, len(track)]),
        "sampling": np.round(sampling, 9),  # a clock's own rounding is no trace
    }


def _straight(track: Track, size: float) -> Flags:
    """(samples - 2,) whether a sample lies on the line between its neighbours, in place and time."""
    step = np.diff(track.times)
    speed = np.diff(track.positions, axis=1) / step
    off = np.abs(np.diff(speed, axis=1)) * np.minimum(step[1:], step[:-1])
    straight: Flags = np.all(off <= 4 * size, axis=0)
    return straight


def _longest_run(flags: Flags) -> float:
    """How many flags are up one after the other, at most."""
    ends = np.flatnonzero(~flags)
    return float(np.diff(np.concatenate([[-1], ends, [len(flags)]])).max() - 1)
