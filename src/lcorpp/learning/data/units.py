"""Detect units other than metres, seconds and radians by values that no human has, and convert on request."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lcorpp.learning.data.repairs import RowSource
from lcorpp.learning.data.tracks import ANGLES, JUMP_TOLERANCE, OTHER_ANGLES, Track
from lcorpp.values import Array, Flags

MAX_SPEED = 12.0
"""Maximum median speed of a track in m/s; the fastest sprint ever reached 12.4 at its peak."""

MIN_SPEED = 0.005
"""Minimum median speed of all tracks of a file in m/s; even a tracker's noise is faster."""

MIN_WALK, MAX_WALK = 0.25, 2.5
"""Speeds in m/s between which the faster people of a file are expected: factors of ten cannot be confused."""

WALKING_QUANTILE = 0.9
"""Quantile of the tracks' median speeds: even where most people stand, a tenth of them walks."""

MIN_USUAL_WALK, MAX_USUAL_WALK = 0.5, 2.0
"""Speeds in m/s between which the median of walking people lies; the mean of pedestrians is about 1.3."""

FOOT = 0.3048

MAX_DISAGREEMENT = 3.0
"""Maximum factor between the velocities of a file and the speeds of positions; smoothing explains less."""

LENGTHS = ("x", "y", "z", "face_distance")


def convert_units(
    tracks: Sequence[Track],
    first_lines: Sequence[int],
    source: RowSource,
    *,
    length: float = 1.0,
    is_given: bool = False,
) -> list[Track]:
    """Convert the tracks of one file, which begin in `first_lines`, to metres, metres per second and radians.

    If at least half of the tracks are too fast, all are converted, including those of people who stand;
    otherwise only the tracks that are too fast. Angles are degrees if half of the tracks have some above
    2 pi. Each conversion needs the repair `units`; a speed that no unit explains is an error.

    Args:
        length: metres per unit of length, as which the file was read. is_given: whether the caller gave it,
            so that no other unit is guessed.
    """
    if not tracks:
        return []
    for track, line in zip(tracks, first_lines, strict=True):
        least = track.columns["velocity"].min() if "velocity" in track.columns else 0.0
        if least < 0:
            message = f"track {track.id!r}: the velocity is {least:g}; expected a speed, 0 or more"
            raise source.error_at(line, "velocity", message)
    speed = np.array([np.median(track.speeds) for track in tracks])
    written = np.array([np.median(t.columns["velocity"]) if "velocity" in t.columns else 0.0 for t in tracks])
    slow = 0 < np.median(speed) < MIN_SPEED and speed.max() < 10 * MIN_SPEED
    length_factors = _factors_of_slow(speed, length) if slow else _factors(speed)
    slow_too = slow and 0 < np.median(written) < MIN_SPEED
    speed_factors = length_factors if slow_too else _factors(written)
    degrees = _find_degrees(tracks)
    converted = []
    for row, (track, length_factor, speed_factor) in enumerate(
        zip(tracks, length_factors.tolist(), speed_factors.tolist(), strict=True)
    ):
        factors = dict.fromkeys(LENGTHS, length_factor) | {"velocity": speed_factor}
        factors |= dict.fromkeys(degrees, np.pi / 180)
        for what, value, name in (("speed", speed[row], "x"), ("velocity", written[row], "velocity")):
            fault = f"the median {what} is {value:.3g} m/s, which no human has"
            if np.isnan(factors[name]) or (is_given and factors[name] != 1):
                other = f"no unit of length explains it; expected {OTHER_UNIT}"
                other += "; degrees of longitude and latitude have to be projected" if slow else ""
                if is_given:
                    other = f"expected another --unit than {length:g} m, or another --time-unit"
                raise source.error_at(first_lines[row], name, f"track {track.id!r}: {fault}; {other}")
            if factors[name] != 1:
                unit = _name_units(length * factors[name], length)
                message = (
                    f"{fault}; it looks like {unit} ({value * factors[name]:.3g} m/s); if it is another unit,"
                    f" expected {OTHER_UNIT}"
                )
                _record(source, track, first_lines[row], name, message, factors[name])
        for name in degrees:
            largest = np.abs(track.columns[name]).max()
            message = f"the {name} is up to {largest:.4g}; expected radians; it looks like degrees"
            _record(source, track, first_lines[row], name, message, factors[name])
        if any(factors[name] != 1 for name in track.columns if name in factors):
            columns = {name: values * factors.get(name, 1.0) for name, values in track.columns.items()}
            track = replace(track, columns=columns)
        converted.append(track)
    return converted


OTHER_UNIT = "--unit with a name or with metres per unit, e.g. of a pixel"

_UNIT_NAMES = {1e-3: "millimetres", 1e-2: "centimetres", 1.0: "metres", 1e3: "kilometres"}


def _name_units(unit: float, taken_for: float) -> str:
    """Return e.g. "millimetres taken for metres" of two sizes in metres."""
    names = [_UNIT_NAMES.get(float(f"{size:.6g}"), f"units of {size:.3g} m") for size in (unit, taken_for)]
    return " taken for ".join(names)


def _record(source: RowSource, track: Track, line: int, name: str, message: str, factor: float) -> None:
    """Record the conversion of a track, or raise the error."""
    done = f"times {factor:.4g}"
    source.repair_or_raise("units", line, message, done, field=name, track=track.id, rows=len(track))


def _factors(speed: Array) -> Array:
    """(tracks,) what converts speeds to those of humans: 1, .01, .001, or NaN if none does."""
    fast = speed > MAX_SPEED
    if np.mean(fast) < 0.5:  # single tracks in another unit
        return np.where(fast, [_factor(value) for value in speed], 1.0)
    factor = _factor(float(np.quantile(speed, WALKING_QUANTILE)))
    return np.where(speed * factor > MAX_SPEED, np.nan, factor)


def _factors_of_slow(speed: Array, length: float) -> Array:
    """(tracks,) what converts speeds that are too slow in units of `length` metres; NaN if nothing does."""
    factor = 1 / length if length < 1 else 1000.0
    fits = MIN_WALK <= factor * np.quantile(speed, WALKING_QUANTILE) <= MAX_SPEED
    return np.full(len(speed), factor if fits else np.nan)


def _factor(speed: float) -> float:
    """Return the factor that makes a speed plausible; NaN if none does."""
    if MIN_WALK <= speed / 100 < MAX_WALK:
        return 1e-2
    return 1e-3 if MIN_WALK <= speed / 1000 <= MAX_SPEED else np.nan


def _find_degrees(tracks: Sequence[Track]) -> list[str]:
    """Return the angles that are in degrees in every track that has them."""
    names = (*ANGLES, *OTHER_ANGLES)
    largest = {name: [np.abs(t.columns[name]).max() for t in tracks if name in t.columns] for name in names}
    return [name for name, sizes in largest.items() if sizes and np.mean(np.array(sizes) > 2 * np.pi) >= 0.5]


def find_jumps(times: Array, x: Array, y: Array) -> Flags:
    """(samples - 1,) whether no human moves that far from each sample to the next.

    A track whose median speed needs another unit is judged by the smallest one, millimetres; where no unit
    explains the speed, only what is much faster is a jump.
    """
    step, distance = np.diff(times), np.hypot(np.diff(x), np.diff(y))
    usual = float(np.median(distance / step)) if len(step) else 0.0
    limit = MAX_SPEED if usual <= MAX_SPEED else max(1000 * MAX_SPEED, 10 * usual)
    return np.asarray(distance > limit * (step + JUMP_TOLERANCE))


def note_implausible(tracks: Sequence[Track]) -> tuple[str, ...]:
    """Return notes about tracks that are possible, but look like another unit of time or length, or jump."""
    if not tracks:
        return ()
    notes = []
    medians = np.array([np.median(track.speeds) for track in tracks])
    speed = float(np.quantile(medians, WALKING_QUANTILE))
    if 0 < speed < MIN_WALK:
        slow = f"nine of ten tracks have a median speed below {speed:.2g} m/s"
        if all((track.times == np.round(track.times)).all() for track in tracks):
            notes.append(f"{slow}, and all times are whole: are they frame numbers (--fps), not seconds?")
        else:
            notes.append(
                f"{slow}: do all people stand, or are positions not in metres (--unit) or times not in"
                " seconds (--time-unit)?"
            )
    moving = medians[medians >= MIN_WALK]
    usual = float(np.median(moving)) if len(moving) else 0.0
    if usual > MAX_USUAL_WALK:
        feet = f"feet (--unit ft gives {usual * FOOT:.2g} m/s)" if usual * FOOT >= MIN_USUAL_WALK else "feet"
        notes.append(
            f"the median speed of all who move is {usual:.2g} m/s, faster than people walk: do these people"
            f" run or cycle, or are positions not in metres, e.g. in {feet}, or times not in seconds?"
        )
    notes += _note_velocities(tracks)
    jumping = [t.id for t in tracks if find_jumps(t.times, t.columns["x"], t.columns["y"]).any()]
    if jumping:
        notes.append(f"{len(jumping)} tracks jump faster than {MAX_SPEED:g} m/s, the first is {jumping[0]}")
    return tuple(notes)


def _note_velocities(tracks: Sequence[Track]) -> list[str]:
    """Return a note if the velocities of those who move are not those of their positions."""
    pairs = [
        (float(np.median(track.columns["velocity"])), float(np.median(track.speeds)))
        for track in tracks
        if "velocity" in track.columns
    ]
    ratios = [
        stated / derived for stated, derived in pairs if derived > 0 and max(stated, derived) >= MIN_WALK
    ]
    ratio = float(np.median(ratios)) if ratios else 1.0
    if 1 / MAX_DISAGREEMENT <= ratio <= MAX_DISAGREEMENT:
        return []
    return [
        f"the velocity column is {ratio:.3g} times the speed of the positions: is one of them in another unit"
        " (--unit), or are times frame numbers (--fps) or in another unit (--time-unit)?"
    ]
