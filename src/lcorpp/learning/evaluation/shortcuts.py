"""Shortcut features of a track: what may predict its label without the motion.

The sampling features are the intervals between samples and the numerical traces of an earlier resampling:
collinear points, repeated positions, values on a grid. Smooth and rough motion do not differ in these traces,
so these features do not depend on the motion.
"""

from __future__ import annotations

import numpy as np

from lcorpp.learning.data.tracks import Track
from lcorpp.values import Array, Flags

RELATIVE_TOLERANCE = 1e-9
"""Tolerance relative to the largest position: rounding error of sums of numbers with 15 digits."""

COLLINEARITY_FACTOR = 4  # rounding errors in the deviation of a point from the line between its neighbours
CLOCK_DECIMALS = 9  # of a sampling feature: the rounding of a clock is not a trace
MILLIMETRE = 1e-3

SHORTCUTS = ("start position", "end position", "duration", "sampling")
"""The shortcuts by name; `compute_shortcut_features` describes their features."""


def compute_shortcut_features(track: Track) -> dict[str, Array]:
    """Shortcut -> (features,) of one track of at least two samples.

    Start and end position: x and y. Duration: seconds and number of samples. Sampling: mean, median, standard
    deviation and maximum of the interval; fraction and longest run of collinear points; fraction of repeated
    positions and of positions in whole millimetres.
    """
    positions, step = track.positions, np.diff(track.times)
    tolerance = max(float(np.abs(positions).max()), MILLIMETRE) * RELATIVE_TOLERANCE
    collinear = _find_collinear(track, tolerance)
    repeated = np.all(np.abs(np.diff(positions, axis=1)) <= tolerance, axis=0)
    grid = positions / MILLIMETRE
    on_grid = np.all(np.abs(grid - np.round(grid)) <= tolerance / MILLIMETRE, axis=0)
    intervals = [step.mean(), np.median(step), step.std(), step.max()]
    collinearity = [collinear.mean() if len(collinear) else 0.0, _measure_longest_run(collinear)]
    return {
        "start position": positions[:, 0],
        "end position": positions[:, -1],
        "duration": np.array([track.duration, len(track)]),
        "sampling": np.round([*intervals, *collinearity, repeated.mean(), on_grid.mean()], CLOCK_DECIMALS),
    }


def _find_collinear(track: Track, tolerance: float) -> Flags:
    """(samples - 2,) whether each inner sample is on the line between its neighbours; tolerance: metres."""
    step = np.diff(track.times)
    velocity = np.diff(track.positions, axis=1) / step
    deviation = np.abs(np.diff(velocity, axis=1)) * np.minimum(step[1:], step[:-1])  # metres
    return np.asarray(np.all(deviation <= COLLINEARITY_FACTOR * tolerance, axis=0))


def _measure_longest_run(flags: Flags) -> float:
    """Return the length of the longest run of true flags."""
    ends = np.flatnonzero(~flags)
    return float(np.diff(np.concatenate([[-1], ends, [len(flags)]])).max() - 1)
