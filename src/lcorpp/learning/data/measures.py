"""Units of length and time of a recording, given by the caller or fixed by a format."""

from __future__ import annotations

from dataclasses import dataclass

from lcorpp.errors import DataError

LENGTHS = {
    "m": 1.0,
    "dm": 0.1,
    "cm": 0.01,
    "mm": 0.001,
    "km": 1000.0,
    "ft": 0.3048,
    "feet": 0.3048,
    "in": 0.0254,
    "yd": 0.9144,
}
"""Units of length -> metres."""

TIMES = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
"""Units of time -> their number in a second."""

PIXELS = ("px", "pixel", "pixels")

SCALE_HINT = "metres per pixel, e.g. --unit 0.04"


@dataclass(frozen=True)
class Measures:
    """What the caller knows about the numbers of a file; None is unknown.

    length: metres per unit of length. per_second: units of time, or frames, per second.
    """

    length: float | None = None
    per_second: float | None = None

    def __bool__(self) -> bool:
        return self.length is not None or self.per_second is not None


UNKNOWN = Measures()


def parse_measures(
    unit: str | float | None = None, time_unit: str | float | None = None, fps: float | None = None
) -> Measures:
    """Return the measures that the options of a reader give.

    Args:
        unit: a name from `LENGTHS`, or metres per unit. time_unit: a name from `TIMES`, or seconds per unit.
        fps: frames per second, if times are frame numbers.

    Raises:
        DataError: an unknown unit, a number that is not finite and above 0, or `fps` with `time_unit`.
    """
    if fps is not None and time_unit is not None:
        raise DataError(
            f"the unit of time is {time_unit}, and there are {fps:g} frames per second; expected one of them"
        )
    per_second = None if fps is None else _check_size(fps, f"the frame rate is {fps}")
    if isinstance(time_unit, str) and time_unit in TIMES:
        per_second = TIMES[time_unit]
    elif time_unit is not None:
        expected = f"expected one of {', '.join(TIMES)}, or seconds per unit"
        per_second = 1 / _parse_size(time_unit, f"the unit of time is {time_unit!r}; {expected}")
    length = None
    if isinstance(unit, str) and unit in LENGTHS:
        length = LENGTHS[unit]
    elif isinstance(unit, str) and unit in PIXELS:
        raise DataError(f"the unit is {unit!r}, which has no length; expected {SCALE_HINT}")
    elif unit is not None:
        expected = f"expected one of {', '.join(LENGTHS)}, or metres per unit"
        length = _parse_size(unit, f"the unit of length is {unit!r}; {expected}")
    return Measures(length, per_second)


def _parse_size(text: str | float, message: str) -> float:
    try:
        return _check_size(float(text), message)
    except ValueError:
        raise DataError(message) from None


def _check_size(size: float, message: str) -> float:
    if not 1e-12 < size < 1e12:
        raise DataError(f"{message}; expected a finite number above 0")
    return float(size)
