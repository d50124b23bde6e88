"""Millimetres taken for metres, or metres for millimetres: told by speeds that no human has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from lcorpp.learning.data.repairs import RepairLog, RowSource
from lcorpp.learning.data.tracks import Track
from lcorpp.values import Array

FASTEST = 12.0
"""Metres per second, the median of a track, that no human keeps up; the fastest sprint ever reached 12.4."""

SLOWEST = 0.005
"""Metres per second below which the median of all tracks of a file is no walk, nor a tracker's noise."""

FACTOR = 1000.0
LENGTHS = ("x", "y", "z")


def convert_to_metres(
    tracks: Sequence[Track], first_lines: Sequence[int], source: RowSource, repair_log: RepairLog
) -> list[Track]:
    """The tracks of one file with positions in metres and speeds in metres per second.

    Where at least half the tracks are too fast, all are taken to be in millimetres, also those of people
    who stand; otherwise those that are too fast.

    Args:
        first_lines: where each track begins in the file.

    Raises:
        ParseError, DataError: there are such tracks and repair `units` was not requested, or no
            factor of 1000 explains them.
    """
    if not tracks:
        return []
    pace = np.array([np.median(track.speeds) for track in tracks])
    told = np.array([np.median(t.columns["velocity"]) if "velocity" in t.columns else 0.0 for t in tracks])
    slow = 0 < np.median(pace) < SLOWEST and pace.max() < 10 * SLOWEST
    places = np.where(_too_fast(pace), 1 / FACTOR, FACTOR if slow else 1.0).tolist()
    speeds = np.where(_too_fast(told), 1 / FACTOR, 1.0).tolist()
    scaled = []
    for row, (track, place, speed) in enumerate(zip(tracks, places, speeds, strict=True)):
        if place == speed == 1.0:
            scaled.append(track)
            continue
        what = (
            f"the median speed is {pace[row]:.3g} m/s"
            if place != 1
            else f"the median velocity is {told[row]:.3g} m/s"
        )
        unit = "metres taken for millimetres" if place > 1 else "millimetres taken for metres"
        human = pace[row] * place <= FASTEST and told[row] * speed <= FASTEST
        message = f"{what}, which no human has; " + (
            f"it looks like {unit}" if human else "no unit of length explains it"
        )
        if not human:
            raise source.error_at(first_lines[row], "x", f"track {track.id!r}: {message}")
        repair_log.repair_or_raise(
            "units",
            source,
            first_lines[row],
            message,
            f"times {place if place != 1 else speed:g}",
            field="x" if place != 1 else "velocity",
            track=track.id,
            rows=len(track),
        )
        factors = dict.fromkeys(LENGTHS, place) | {"velocity": speed}
        columns = {name: values * factors.get(name, 1.0) for name, values in track.columns.items()}
        scaled.append(replace(track, columns=columns))
    return scaled


def _too_fast(pace: Array) -> npt.NDArray[np.bool_]:
    """(tracks,) which of them need another unit."""
    fast = pace > FASTEST
    return np.full(len(pace), True) if np.mean(fast) >= 0.5 else fast
