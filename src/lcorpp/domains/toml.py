"""Typed reading of `domain.toml`: every complaint names the file, the line and the key."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from lcorpp.errors import DomainError, ParseError, expected_one_of
from lcorpp.files import read_text

Keys = tuple[str, ...]


class Settings:
    """A table of `domain.toml` whose values are taken one by one, each checked as it is taken.

    A key that nobody took is unknown: `close` says so, with the known ones.
    """

    def __init__(self, table: Mapping[str, Any], places: _Places, path: Keys = ()) -> None:
        self._table, self._places, self._path = table, places, path
        self._taken: dict[str, None] = {}

    def place(self, *keys: str) -> str:
        """``domain.toml:12: [planning] model``, for the head of a message."""
        path = self._path + keys
        where = f"[{'.'.join(path[:-1])}] {path[-1]}" if len(path) > 1 else ".".join(path)
        return f"{self._places.file}:{self._places.line(path)}: {where}"

    def __contains__(self, key: str) -> bool:
        return key in self._table

    def text(self, key: str, default: str | None = None) -> str:
        """A string that is not empty."""
        value = self._take(key, default)
        if not isinstance(value, str) or not value.strip():
            raise DomainError(f"{self.place(key)}: expected a text, not {value!r}")
        return value

    def number(self, key: str, low: float, high: float, default: float | None = None) -> float:
        """A number from `low` to `high`."""
        value = self._take(key, default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise DomainError(f"{self.place(key)}: expected a number from {low} to {high}, not {value!r}")
        return float(value)

    def count(self, key: str, low: int, default: int | None = None) -> int:
        """A whole number of at least `low`."""
        value = self._take(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < low:
            raise DomainError(f"{self.place(key)}: expected a whole number of at least {low}, not {value!r}")
        return value

    def names(self, key: str, *, empty: bool = False) -> tuple[str, ...]:
        """A list of names, no two alike; empty only where allowed."""
        value = self._take(key, [] if empty else None)
        if not isinstance(value, list) or not all(isinstance(name, str) and name for name in value):
            raise DomainError(f"{self.place(key)}: expected a list of names, not {value!r}")
        if len(set(value)) < len(value):
            raise DomainError(f"{self.place(key)}: a name stands twice in {value!r}")
        if not value and not empty:
            raise DomainError(f"{self.place(key)}: expected at least one name")
        return tuple(value)

    def mapping(self, key: str) -> dict[str, str]:
        """A table from names to names."""
        value = self._take(key, None)
        if not isinstance(value, dict) or not value or not all(isinstance(v, str) for v in value.values()):
            raise DomainError(f'{self.place(key)}: expected a table of names such as {{ a = "b" }}')
        return dict(value)

    def section(self, key: str, *, required: bool = False) -> Settings:
        """A table inside this one; an empty one where it is missing."""
        value = self._take(key, None if required else {})
        if not isinstance(value, dict):
            raise DomainError(f"{self.place(key)}: expected a table, not {value!r}")
        return Settings(value, self._places, (*self._path, key))

    def __iter__(self) -> Iterator[str]:
        """The keys of this table, in the order of the file."""
        return iter(self._table)

    def close(self) -> None:
        """Complain about keys that nobody asked for."""
        for key in self._table:
            if key not in self._taken:
                raise DomainError(f"{self.place(key)}: unknown key; {expected_one_of(list(self._taken))}")

    def _take(self, key: str, default: Any) -> Any:
        self._taken[key] = None
        if key in self._table:
            return self._table[key]
        if default is None:
            raise DomainError(f"{self.place(key)} is missing")
        return default


def read_settings(path: Path, preset: str | None) -> tuple[Settings, str | None]:
    """The settings of a domain with a preset laid over them.

    Args:
        path: the `domain.toml`.
        preset: a name under `[presets]`; None takes the first one, where there is any.

    Returns:
        The settings and the name of the preset, None where the domain has none.

    Raises:
        FileError, ParseError: the file cannot be read or is not TOML.
        DomainError: the preset is not known.
    """
    text = read_text(path)
    table = _toml(path, text)
    presets = table.pop("presets", {})
    if preset is None:
        preset = next(iter(presets), None)
    elif preset not in presets:
        raise DomainError(f"{path}: unknown preset {preset!r}; {expected_one_of(list(presets))}")
    over = dict(presets.get(preset, {})) if preset else {}
    over.pop("description", None)
    return Settings(_merged(table, over), _Places(str(path), text, preset)), preset


def preset_names(folder: Path) -> tuple[str, ...]:
    """The presets of a domain folder, in the order of its file."""
    path = folder / "domain.toml"
    return tuple(_toml(path, read_text(path)).get("presets", {}))


def _toml(path: Path, text: str) -> dict[str, Any]:
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _located(error, path, text) from None
    except (RecursionError, ValueError) as error:  # nested too deeply; a number of thousands of digits
        raise DomainError(f"{path}: cannot be read: {error}") from None
    presets = table.get("presets", {})
    if not isinstance(presets, dict) or not all(isinstance(value, dict) for value in presets.values()):
        raise DomainError(f"{path}: [presets]: expected a table of tables")
    return table


def _merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    result = dict(base)
    for key, value in over.items():
        both = isinstance(value, dict) and isinstance(result.get(key), dict)
        result[key] = _merged(result[key], value) if both else value
    return result


def _located(error: tomllib.TOMLDecodeError, path: Path, text: str) -> ParseError:
    lines = text.splitlines()
    found = re.search(r"\s*\(at line (\d+), column (\d+)\)", str(error))
    # "(at end of document)" is the other form: the place is after the last character
    line = int(found[1]) if found else max(len(lines), 1)
    column = int(found[2]) if found else (len(lines[-1]) + 1 if lines else 1)
    message = re.sub(r"\s*\(at [^)]*\)", "", str(error))
    return ParseError(str(path), line, column, message, lines[line - 1] if line <= len(lines) else "")


class _Places:
    """Where each key of a TOML text stands; tomllib does not say."""

    def __init__(self, file: str, text: str, preset: str | None) -> None:
        self.file = file
        self._preset: Keys = ("presets", preset) if preset else ()
        self._lines: dict[Keys, int] = {}
        header: Keys = ()
        for number, line in enumerate(text.splitlines(), 1):
            if found := re.match(r"\s*\[\s*([^\[\]]+?)\s*\]", line):
                header = _keys(found[1])
                self._lines.setdefault(header, number)
            elif found := re.match(r"""\s*([\w"'][\w\s."'-]*?)\s*=""", line):
                self._lines.setdefault(header + _keys(found[1]), number)

    def line(self, path: Keys) -> int:
        """The line of a key, of the preset's version first; of what holds it when it is missing."""
        for length in range(len(path), 0, -1):
            for prefix in (self._preset, ()):
                if (line := self._lines.get(prefix + path[:length])) is not None:
                    return line
        return 1


def _keys(dotted: str) -> Keys:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))
