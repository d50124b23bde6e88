"""Detect wrong units of length: millimetres for metres, or the reverse, give impossible speeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lcorpp.learning.data.repairs import RowSource
from lcorpp.learning.data.tracks import Track
from lcorpp.values import Array

MAX_SPEED = 12.0
"""Maximum median speed of a track in m/s; the fastest sprint ever reached 12.4 at its peak."""

MIN_SPEED = 0.005
"""Minimum median speed of all tracks of a file in m/s; even a tracker's noise is faster."""

FACTOR = 1000.0
LENGTHS = ("x", "y", "z")


def convert_to_metres(tracks: Sequence[Track], first_lines: Sequence[int], source: RowSource) -> list[Track]:
    """Convert the tracks of one file, which begin in `first_lines`, to metres and metres per second.

    If at least half of the tracks are too fast, all are converted, including those of people who stand;
    otherwise only the tracks that are too fast. A speed that no factor of 1000 explains is an error.
    """
    if not tracks:
        return []
    speed = np.array([np.median(track.speeds) for track in tracks])
    written = np.array([np.median(t.columns["velocity"]) if "velocity" in t.columns else 0.0 for t in tracks])
    slow = 0 < np.median(speed) < MIN_SPEED and speed.max() < 10 * MIN_SPEED
    length_factors = np.where(_too_fast(speed), 1 / FACTOR, FACTOR if slow else 1.0).tolist()
    speed_factors = np.where(_too_fast(written), 1 / FACTOR, 1.0).tolist()
    scaled = []
    for row, (track, length_factor, speed_factor) in enumerate(
        zip(tracks, length_factors, speed_factors, strict=True)
    ):
        if length_factor == speed_factor == 1.0:
            scaled.append(track)
            continue
        what, value, field, factor = ("speed", speed[row], "x", length_factor)
        if length_factor == 1:
            what, value, field, factor = ("velocity", written[row], "velocity", speed_factor)
        fault, line = f"the median {what} is {value:.3g} m/s, which no human has", first_lines[row]
        if speed[row] * length_factor > MAX_SPEED or written[row] * speed_factor > MAX_SPEED:
            message = f"track {track.id!r}: {fault}; no unit of length explains it"
            raise source.error_at(line, "x", message)
        unit = "metres taken for millimetres" if length_factor > 1 else "millimetres taken for metres"
        message, done = f"{fault}; it looks like {unit}", f"times {factor:g}"
        source.repair_or_raise("units", line, message, done, field=field, track=track.id, rows=len(track))
        factors = dict.fromkeys(LENGTHS, length_factor) | {"velocity": speed_factor}
        columns = {name: values * factors.get(name, 1.0) for name, values in track.columns.items()}
        scaled.append(replace(track, columns=columns))
    return scaled


def _too_fast(speed: Array) -> npt.NDArray[np.bool_]:
    """(tracks,) whether each track needs another unit."""
    fast = speed > MAX_SPEED
    return np.full(len(speed), True) if np.mean(fast) >= 0.5 else fast
