"""The section `[axes]` of a sweep: the values of each axis, checked in the domain."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from itertools import product
from math import isfinite
from pathlib import Path
from typing import Any

from lcorpp.assembly.robot_parts import hash_bytes
from lcorpp.domains import Domain
from lcorpp.domains.sections.names import check_defined
from lcorpp.domains.toml import TomlTable
from lcorpp.errors import DomainError, LcorppError, expected_one_of
from lcorpp.experiments.sweeps.axes import SECTIONS, Axis, Problem, Setting, Value, configure, list_axes
from lcorpp.experiments.sweeps.changes import normalise_atom
from lcorpp.files import read_bytes
from lcorpp.input_files import is_inside

RANGE = "{ from = 0.1, to = 0.4, count = 4 }"
"""An example of a range, for messages."""

RANGE_KEYS = ("from", "to", "count", "step")

MAX_VALUES = 100_000
"""Maximum number of values of a range."""

DIGITS = 12
"""Digits of the numbers of a range, which has no rounding errors then."""


def read_axes(
    table: TomlTable, problem: Problem, domain: Domain, folder: Path
) -> dict[Axis, tuple[Setting, ...]]:
    """Read the section.

    Each text, and the ends of the numbers of each axis, are tried alone in the domain.

    Args:
        folder: that of the sweep, for files beside it.

    Raises:
        DomainError: there is no axis, an axis is unknown or empty, or a value is impossible.
    """
    known, section = list_axes(domain), table.section("axes", required=True)
    axes: dict[Axis, tuple[Setting, ...]] = {}
    for path, values in _flatten(section):
        location = table.location("axes", *path)
        axis = _find_known(location, path, known)
        _check_others(location, axis, axes)
        numbers = known.get(axis)
        read = _read_values(location, values)
        if axis == ("knowledge",) and not all(isinstance(value, str) for value in read):
            raise DomainError(f"{location}: expected names of P-log programs, not {values!r}")
        if numbers is not None:
            for value in read:
                if isinstance(value, str) or not numbers[0] <= value <= numbers[1]:
                    raise DomainError(f"{location}: expected numbers {_describe(numbers)}, not {value!r}")
        axes[axis] = tuple([_make_setting(location, axis, value, domain, folder) for value in read])
        texts = [setting for setting in axes[axis] if isinstance(setting.value, str)]
        ends = sorted(axes[axis], key=lambda s: s.value)[:: max(len(read) - 1, 1)] if not texts else []
        for setting in (*texts, *ends):
            with locate_failures(f"{location} = {setting.value}"):
                _check(problem, domain, setting)
    if not axes:
        raise DomainError(f"{table.location('axes')}: expected at least one axis, e.g. noise = {RANGE}")
    return axes


def find_axis(location: str, name: str, axes: Collection[Axis]) -> Axis:
    """Return the axis of a sweep with a dotted name.

    Raises:
        DomainError: there is none.
    """
    names = {".".join(axis): axis for axis in axes}
    if name not in names:
        raise DomainError(f"{location}: {name!r} is not an axis of this sweep; {expected_one_of(names)}")
    return names[name]


@contextmanager
def locate_failures(location: str) -> Iterator[None]:
    """Put a place in the sweep before the message of an error."""
    try:
        yield
    except LcorppError as error:
        raise DomainError(f"{location}: {error}") from error


def _flatten(table: TomlTable, path: Axis = ()) -> Iterator[tuple[Axis, Any]]:
    """Yield the axes of nested tables and their values: lists or ranges."""
    for key in table:
        value = table.value(key)
        if isinstance(value, dict) and value and not _is_range(value):
            yield from _flatten(table.section(key), (*path, key))
        else:
            yield (*path, key), value


def _is_range(table: Mapping[str, Any]) -> bool:
    """Whether a table is a range, perhaps an incomplete one, and not a part of the name of axes."""
    return any(not isinstance(table.get(key, []), list | dict) for key in RANGE_KEYS)


def _find_known(location: str, path: Axis, known: Mapping[Axis, object]) -> Axis:
    """Return an axis of the domain, or a key of its domain.toml."""
    *before, last = path
    if before[-1:] == ["pr"]:
        path = (*before, normalise_atom(last))
    names = {".".join(axis): axis for axis in (*known, ("knowledge",))}
    name = ".".join(path)  # a name in quotes is the same axis
    if name in names or (path[0] in SECTIONS and len(path) > 1):
        return names.get(name, path)
    close = get_close_matches(name, names, 1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    related = [other for other in names if other.startswith(f"{path[0]}.")]
    expected = related or [*dict.fromkeys(axis[0] for axis in names.values()), *SECTIONS]
    raise DomainError(f"{location}: unknown axis; {hint}{expected_one_of(expected, 20)}")


def _read_values(location: str, values: Any) -> list[Value]:
    """Return the values of a list or a range."""
    if isinstance(values, dict):
        return list(_read_range(location, values))
    if not isinstance(values, list):
        raise DomainError(f"{location}: expected a list such as [0.1, 0.2], or a range {RANGE}")
    if not values:
        raise DomainError(f"{location}: the axis is empty; expected at least one value")
    kinds = {str if isinstance(value, str) else float for value in values}
    for value in values:
        number = isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
        if len(kinds) > 1 or not (number or (isinstance(value, str) and value.strip())):
            raise DomainError(f"{location}: expected finite numbers, or texts, not {value!r} in {values!r}")
    for value in values:
        if values.count(value) > 1:
            raise DomainError(f"{location}: {value!r} appears twice")
    return values


def _read_range(location: str, table: Mapping[str, Any]) -> Sequence[float]:
    """Return the numbers of a range with a count, or a step."""
    for key, value in table.items():
        if key not in RANGE_KEYS:
            raise DomainError(f"{location}: unknown key {key!r} of a range; expected {RANGE}")
        if not isinstance(value, int | float) or isinstance(value, bool) or not isfinite(value):
            raise DomainError(f"{location}: {key} = {value!r}; expected a number")
    if not {"from", "to"} <= table.keys() or ("count" in table) == ("step" in table):
        raise DomainError(f"{location}: expected a range with from, to, and count or step, e.g. {RANGE}")
    low, high = table["from"], table["to"]
    if low >= high:
        raise DomainError(f"{location}: from = {low} is not below to = {high}")
    if "step" in table:
        steps = (high - low) / table["step"] if table["step"] > 0 else 0
        if not 1 <= steps <= MAX_VALUES or abs(steps - round(steps)) > 1e-6:
            raise DomainError(f"{location}: step = {table['step']} does not lead from {low} to {high}")
        count = round(steps) + 1
    else:
        count = table["count"]
        if type(count) is not int or not 2 <= count <= MAX_VALUES:
            raise DomainError(
                f"{location}: count = {count!r}; expected a whole number from 2 to {MAX_VALUES}"
            )
    numbers = [low + (high - low) * k / (count - 1) for k in range(count)]
    return [float(f"{number:.{DIGITS}g}") for number in numbers]


def _make_setting(location: str, axis: Axis, value: Value, domain: Domain, folder: Path) -> Setting:
    """Return a setting; a text may name a file beside the sweep or in the domain's folder."""
    if not isinstance(value, str):
        return Setting(axis, value)
    for place in (folder, domain.folder) if axis == ("knowledge",) else (domain.folder,):
        if (file := place / value).is_file() and is_inside(file, place):
            return Setting(axis, value, str(file.resolve()), hash_bytes(read_bytes(file)))
    if axis == ("knowledge",):
        raise DomainError(f"{location}: no file {folder / value} or {domain.folder / value}")
    return Setting(axis, value)


def _check(problem: Problem, domain: Domain, setting: Setting) -> None:
    """Check that a value is possible in the domain."""
    changed = configure(problem, (setting,))
    for before, after in (
        (domain.program, changed.program),
        (domain.simulation.true_program, changed.simulation.true_program),
    ):
        if before != after:
            check_defined(setting.name, changed.reasoning.shared, after)


def _check_others(location: str, axis: Axis, others: Collection[Axis]) -> None:
    """Reject an axis that changes what another one changes: one of the two would have no effect."""
    for other in others:
        pairs = product(_list_targets(axis), _list_targets(other))
        if any(a[: len(b)] == b or b[: len(a)] == a for a, b in pairs):
            name = ".".join(other)
            raise DomainError(f"{location}: {name} changes the same; expected one of the two")


def _list_targets(axis: Axis) -> list[Axis]:
    """Return what an axis changes: parts of the robot's knowledge, of the truth, or of both."""
    if axis == ("noise",):
        return [("simulation", "noise")]
    both = axis[0] in ("classifier", "prevalence", "pr")
    side, path = (axis[0], axis) if both else (axis[0], axis[1:])
    if path[:1] == ("prevalence",):
        path = path[:-1]  # the shares of all values sum to 1
    return [(side, *path) for side in (("known", "true") if both else (side,))]


def _describe(numbers: tuple[float, float]) -> str:
    low, high = numbers
    if isfinite(high):
        return f"from {low:g} to {high:g}"
    return f"of at least {low:g}" if isfinite(low) else "that are finite"
