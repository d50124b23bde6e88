"""Detect times that are not in seconds, e.g. milliseconds or frame numbers; ask for their unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.learning.data.cleaning import RawTrack
from lcorpp.learning.data.measures import TIMES
from lcorpp.learning.data.repairs import RowSource
from lcorpp.learning.data.units import MAX_WALK, MIN_SPEED, MIN_WALK, WALKING_QUANTILE
from lcorpp.values import Array

MIN_STEP, MAX_STEP = 0.004, 2.0
"""Seconds between two samples of a tracker: 250 Hz to a sample every two seconds."""

FRAME_RATES = (2.5, 5.0, 7.5, 10.0, 12.5, 15.0, 16.0, 20.0, 25.0, 30.0, 50.0, 60.0, 100.0, 120.0)
"""Usual frames per second of cameras and annotations."""

USUAL_WALK = 1.3
"""Usual speed of a pedestrian in m/s."""


@dataclass(frozen=True)
class Pace:
    """Usual sampling and motion of a file.

    step: units of time between two samples. speed: metres per unit of time, of the faster people; 0 if
    nothing moves. is_whole: whether all times are whole numbers.
    """

    step: float
    speed: float
    is_whole: bool


def measure_pace(tracks: Sequence[tuple[Array, Array, Array]]) -> Pace | None:
    """Measure tracks of (times, x, y) in the order of their times; None if no time follows another."""
    steps, speeds, is_whole = list[Array](), list[float](), True
    for times, x, y in tracks:
        step, distance = np.diff(times), np.hypot(np.diff(x), np.diff(y))
        later = (step > 0) & np.isfinite(step)
        moved = later & np.isfinite(distance)
        is_whole = is_whole and bool(np.all(times[np.isfinite(times)] % 1 == 0))
        if later.any():
            steps.append(step[later])
        if moved.any():
            speeds.append(float(np.median(distance[moved] / step[moved])))
    if not steps:
        return None
    speed = float(np.quantile(speeds, WALKING_QUANTILE)) if speeds else 0.0
    return Pace(float(np.median(np.concatenate(steps))), speed, is_whole)


def suggest_time_unit(pace: Pace) -> str:
    """Return the options of a plausible unit of time, with the sampling and speed that each gives."""
    units = {f"--time-unit {name}": size for name, size in TIMES.items() if size > 1}
    frames = {f"--fps {rate:g}": rate for rate in FRAME_RATES} if pace.is_whole else {}
    sampled = [
        (option, size)
        for option, size in (*units.items(), *frames.items())
        if MIN_STEP <= pace.step / size <= MAX_STEP
    ]
    walked = [(option, size) for option, size in sampled if MIN_WALK <= pace.speed * size <= MAX_WALK]
    fitting = walked or [pair for pair in sampled if pair[0] in units] or sampled
    chosen = [pair for pair in fitting if pair[0] in units][:1]
    rates = [pair for pair in fitting if pair[0] in frames]
    if rates and pace.speed:
        chosen.append(min(rates, key=lambda pair: abs(np.log(pair[1] * pace.speed / USUAL_WALK))))
    return ", or ".join(
        f"{option} gives a sample every {pace.step / size:.3g} s and {pace.speed * size:.3g} m/s"
        for option, size in chosen
    )


def check_times(tracks: Sequence[RawTrack], source: RowSource, gap: float) -> None:
    """Raise an error if the times of a file cannot be seconds.

    The usual time between two samples is longer than `gap`, or people creep although a second or more
    passes. No repair guesses the unit: milliseconds in metres and seconds in kilometres look alike.
    """
    pace = measure_pace([(track.times, track.columns["x"], track.columns["y"]) for track in tracks])
    if pace is None:
        return
    creeps = 0 < pace.speed < MIN_SPEED and pace.step >= 1 - 1e-9
    if pace.step <= gap and not creeps:
        return
    suggestion = suggest_time_unit(pace)
    usual = f"the usual time between two samples is {pace.step:.4g} s"
    walk = f", and the usual speed {pace.speed:.2g} m/s" if pace.speed else ""
    hint = f": {suggestion}" if suggestion else " by --time-unit, or --fps for frame numbers"
    gaps = f"; a longer --gap keeps seconds (it is {gap:g})" if pace.step > gap and not creeps else ""
    message = f"{usual}{walk}; expected seconds, or their unit{hint}{gaps}"
    raise source.error_at(int(tracks[0].lines[0]), "time", message)
