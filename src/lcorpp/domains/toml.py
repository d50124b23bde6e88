"""Typed access to TOML files such as `domain.toml`: each error names the file, the line and the key."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from lcorpp.errors import DomainError, expected_one_of
from lcorpp.files import read_text
from lcorpp.input_files import is_inside
from lcorpp.toml_text import parse_toml

MAX_TOML_BYTES = 2**22
"""Maximum size of a file."""

Keys = tuple[str, ...]

SHIPPED_FOLDER = Path(__file__).parent
"""The domains that come with lcorpp; an installer may link their files."""

KEY = r"""(?:"[^"]*"|'[^']*'|[\w-]+)"""
"""Pattern of one part of a dotted key."""


class TomlTable:
    """A table of a TOML file; each access checks the type of a value.

    The accessed keys are the known ones: `reject_unknown_keys` reports all others.
    """

    def __init__(self, table: Mapping[str, Any], lines: _KeyLines, path: Keys = ()) -> None:
        self._table, self._lines, self._path = table, lines, path
        self._accessed: dict[str, None] = {}  # an ordered set

    def location(self, *keys: str) -> str:
        """``domain.toml:12: [planning] model``, the start of an error message."""
        path = self._path + keys
        key = f"[{'.'.join(path[:-1])}] {path[-1]}" if len(path) > 1 else ".".join(path)
        return f"{self._lines.file}:{self._lines.line(path)}: {key}"

    def __contains__(self, key: str) -> bool:
        self._accessed[key] = None
        return key in self._table

    def __iter__(self) -> Iterator[str]:
        """The keys of this table, in the order of the file."""
        return iter(self._table)

    def text(self, key: str, default: str | None = None) -> str:
        """A non-empty string."""
        return str(self._get(key, default, lambda v: isinstance(v, str) and v.strip(), "a text"))

    def number(self, key: str, min_value: float, max_value: float, default: float | None = None) -> float:
        """A number from `min_value` to `max_value`."""

        def is_valid(value: Any) -> bool:
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            return is_number and min_value <= value <= max_value

        return float(self._get(key, default, is_valid, f"a number from {min_value} to {max_value}"))

    def count(self, key: str, min_value: int, default: int | None = None) -> int:
        """A whole number of at least `min_value`."""
        expected = f"a whole number of at least {min_value}"
        return int(self._get(key, default, lambda v: type(v) is int and v >= min_value, expected))

    def flag(self, key: str, default: bool) -> bool:
        """A truth value."""
        return bool(self._get(key, default, lambda v: isinstance(v, bool), "true or false"))

    def value(self, key: str) -> Any:
        """A value of any type."""
        return self._get(key)

    def is_text(self, key: str) -> bool:
        """Whether a key has a string as its value."""
        self._accessed[key] = None
        return isinstance(self._table.get(key), str)

    def is_list(self, key: str) -> bool:
        """Whether a key has a list as its value."""
        self._accessed[key] = None
        return isinstance(self._table.get(key), list)

    def is_table(self, key: str) -> bool:
        """Whether a key has a table as its value."""
        self._accessed[key] = None
        return isinstance(self._table.get(key), Mapping)

    def names(self, key: str, *, required: bool = True, distinct: bool = True) -> tuple[str, ...]:
        """A list of names, `distinct` or not; if it is not `required`, it may be empty or missing."""

        def is_valid(value: Any) -> bool:
            return isinstance(value, list) and all(isinstance(name, str) and name for name in value)

        value = self._get(key, None if required else [], is_valid, "a list of names")
        if distinct and len(set(value)) < len(value):
            raise DomainError(f"{self.location(key)}: a name is repeated in {_shorten(value)}")
        if not value and required:
            raise DomainError(f"{self.location(key)}: expected at least one name")
        return tuple(value)

    def mapping(self, key: str) -> dict[str, str]:
        """A table from names to names."""
        value = self._get(key)
        if not isinstance(value, dict) or not value or not all(isinstance(v, str) for v in value.values()):
            raise DomainError(f'{self.location(key)}: expected a table of names such as {{ a = "b" }}')
        return dict(value)

    def section(self, key: str, *, required: bool = False) -> TomlTable:
        """A subtable; an empty one if it is missing and not required."""
        value = self._get(key, None if required else {}, lambda v: isinstance(v, dict), "a table")
        return TomlTable(value, self._lines, (*self._path, key))

    def sections(self, key: str) -> tuple[TomlTable, ...]:
        """Subtables ``[[key]]``, or the only one ``[key]``; none if the key is missing."""
        value = self._get(
            key,
            [],
            lambda v: isinstance(v, dict) or (isinstance(v, list) and all(isinstance(t, dict) for t in v)),
            f"a table [{key}] or tables [[{key}]]",
        )
        if isinstance(value, dict):
            return (TomlTable(value, self._lines, (*self._path, key)),)
        paths = [(*self._path, f"{key}[{number}]") for number in range(1, len(value) + 1)]
        return tuple(TomlTable(part, self._lines, path) for part, path in zip(value, paths, strict=True))

    def reject_keys(self, keys: Iterable[str], reason: str) -> None:
        """Raise an error with a reason if one of some keys is in the table."""
        for key in keys:
            if key in self:
                raise DomainError(f"{self.location(key)}: {reason}; expected no {key!r}")

    def reject_unknown_keys(self) -> None:
        """Raise `DomainError` if the table has a key that was never accessed."""
        for key in self._table:
            if key not in self._accessed:
                raise DomainError(f"{self.location(key)}: unknown key; {expected_one_of(self._accessed)}")

    def _get(
        self,
        key: str,
        default: Any = None,
        is_valid: Callable[[Any], object] = lambda _: True,
        expected: str = "",
    ) -> Any:
        """Return a value, or the default if it is missing; a default of None means that it is required."""
        self._accessed[key] = None
        value = self._table.get(key, default)
        if value is None:  # TOML has no null
            raise DomainError(f"{self.location(key)} is missing")
        if not is_valid(value):
            raise DomainError(f"{self.location(key)}: expected {expected}, not {_shorten(value)}")
        return value


def read_toml(path: Path) -> TomlTable:
    """Read a TOML file.

    Raises:
        FileError, ParseError: the file cannot be read or is not TOML.
    """
    text = read_text(path, MAX_TOML_BYTES)
    return TomlTable(_parse(path, text), _KeyLines(str(path), text, ()))


def read_domain_toml(
    path: Path, preset: str | None, changes: Mapping[str, Any]
) -> tuple[TomlTable, str | None]:
    """Read a `domain.toml` and merge presets into it.

    Args:
        preset: names under `[presets]`, with commas; later ones replace keys of earlier ones. None for the
            first preset, if any.
        changes: merged after the presets.

    Returns:
        The merged table and the names of the presets, with commas; None without one.

    Raises:
        FileError, ParseError: the file cannot be read or is not TOML.
        DomainError: a preset is unknown, or there twice.
    """
    text = _read_inside(path)
    table = _parse(path, text)
    presets = table.pop("presets", {})
    names = list(presets)[:1] if preset is None else [name.strip() for name in preset.split(",")]
    for name in names:
        if name not in presets:
            raise DomainError(f"{path}: unknown preset {name!r}; {expected_one_of(presets)}")
        if names.count(name) > 1:
            raise DomainError(f"{path}: preset {name!r} is there twice")
        table = _merge(table, {key: value for key, value in presets[name].items() if key != "description"})
    return TomlTable(_merge(table, changes), _KeyLines(str(path), text, names)), ",".join(names) or None


def read_preset_names(folder: Path) -> tuple[str, ...]:
    """Return the names of a domain's presets, in the order of its file."""
    path = folder / "domain.toml"
    return tuple(_parse(path, _read_inside(path)).get("presets", {}))


def _read_inside(path: Path) -> str:
    """Return the text of a file that is not a link out of its folder."""
    if path.parent.parent != SHIPPED_FOLDER and not is_inside(path, path.parent):
        raise DomainError(f"{path}: is a link out of its folder; expected a file in it")
    return read_text(path, MAX_TOML_BYTES)


def _shorten(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 300 else f"{text[:300]} ..."


def _parse(path: Path, text: str) -> dict[str, Any]:
    table = parse_toml(str(path), text, DomainError)
    presets = table.get("presets", {})
    if not isinstance(presets, dict) or not all(isinstance(value, dict) for value in presets.values()):
        raise DomainError(f"{path}: [presets]: expected a table of tables")
    return table


def _merge(base: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Return the table `base` with the values of `overrides`; subtables are merged key by key."""
    result = dict(base)
    for key, value in overrides.items():
        both = isinstance(value, dict) and isinstance(result.get(key), dict)
        result[key] = _merge(result[key], value) if both else value
    return result


class _KeyLines:
    """Line number of each key of a TOML text, which tomllib does not provide."""

    def __init__(self, file: str, text: str, presets: Sequence[str]) -> None:
        self.file = file
        self._prefixes: list[Keys] = [*[("presets", name) for name in reversed(presets)], ()]
        self._lines: dict[Keys, int] = {}
        header: Keys = ()
        counts: dict[Keys, int] = {}  # of the tables [[name]] so far

        def add_numbers(path: Keys) -> Keys:
            """Return a path with the number of the latest table after each name of [[tables]]."""
            parents = [path[: length + 1] for length in range(len(path))]
            return tuple(f"{p[-1]}[{counts[p]}]" if p in counts else p[-1] for p in parents)

        for number, line in enumerate(text.splitlines(), 1):
            if match := re.match(r"\s*\[\[([^\[\]]+)\]\]", line):
                path = _split_key(match[1])
                counts[path] = counts.get(path, 0) + 1
                header = add_numbers(path)
                self._lines.setdefault(header, number)
            elif match := re.match(r"\s*\[([^\[\]]+)\]", line):
                header = add_numbers(_split_key(match[1]))
                self._lines.setdefault(header, number)
            elif match := re.match(rf"\s*({KEY}(\s*\.\s*{KEY})*)\s*=", line):
                self._lines.setdefault(header + _split_key(match[1]), number)

    def line(self, path: Keys) -> int:
        """Return the line of a key, in the last preset that has it.

        If the key is missing, this is the line of its closest table.
        """
        for length in range(len(path), 0, -1):
            for prefix in self._prefixes:
                if (line := self._lines.get(prefix + path[:length])) is not None:
                    return line
        return 1


def _split_key(dotted: str) -> Keys:
    """Return the parts of a dotted key, without quotation marks."""
    return tuple(part.strip("\"'") for part in re.findall(KEY, dotted))
