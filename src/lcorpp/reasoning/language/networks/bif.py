"""Read Bayesian networks in the Interchange Format (BIF) into tables.

    network alarm { }
    variable HISTORY { type discrete [ 2 ] { TRUE, FALSE }; }
    probability ( HISTORY | LVFAILURE ) { (TRUE) 0.9, 0.1; (FALSE) 0.01, 0.99; }

Names may have any characters, also in double quotes. A conditional distribution has a row for each
combination of values, `default` for those without one, or `table`: its numbers with the values of the
variable itself changing slowest, and of the last condition fastest.

Source: the Interchange Format for Bayesian Networks 0.15 (Cozman, 1996).
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from math import prod
from pathlib import Path

import numpy as np

from lcorpp.errors import ParseError, ProgramError, expected_one_of
from lcorpp.files import read_text
from lcorpp.reasoning.language.arithmetic import MAX_ROUNDING
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.lexer import list_line_starts
from lcorpp.reasoning.language.networks.bayesian_network import (
    BayesianNetwork,
    ProbabilityTable,
    RoundedRow,
    check_acyclic,
    warn_of_rounding,
)
from lcorpp.reasoning.quoting import make_name_text, make_value_text
from lcorpp.values import Array

MAX_BYTES = 2**28
"""Maximum size of a file."""

MAX_ENTRIES = 2**26
"""Maximum number of numbers of a table."""

_COMMENT = re.compile(r'"(?:[^"\\\n]|\\[^\n])*"|//[^\n]*|/\*.*?\*/', re.DOTALL)

_QUOTED = re.compile(r'"(?:[^"\\\n]|\\[^\n])*"')

_MASK = {ord(sign): 0xE000 + ord(sign) for sign in '(){}[]|,;"/\\'}
"""Private characters for signs in quoted names, which are then none of the format."""

_UNMASK = {code: sign for sign, code in _MASK.items()}

_ESCAPE = re.compile(r"\\(.)")

_NAME = re.compile(r'"[^"]*"|[^\s,|(){}\[\];"]+')

_HEAD = re.compile(r"(network|variable|probability)\b|\S")

_TYPE = re.compile(r"type\s+discrete\s*\[\s*([0-9]+)\s*\]\s*(?:=\s*)?\{([^{}]*)\}\s*;?|property\b[^;{}]*;|\S")

_ROW = re.compile(r"\(([^()]*)\)([^;()]*);|(table|default)\b([^;()]*);|property\b[^;{}]*;|\S")


def read_bif(path: str | Path) -> BayesianNetwork:
    """Read a file, see `parse_bif`.

    Raises:
        FileError: the file cannot be read.
        ParseError, ProgramError: as `parse_bif`.
    """
    return parse_bif(read_text(path, MAX_BYTES), file=str(path))


def parse_bif(text: str, *, file: str = "<text>") -> BayesianNetwork:
    """Parse a Bayesian network given as text.

    Raises:
        ParseError: the text does not follow the format, names an unknown variable or value, or lacks a row.
        ProgramError: a variable has no table, or depends on itself.
    """
    reader = _Reader(text, file)
    try:
        return reader.read()
    except SourceIssue as issue:
        line = text.splitlines()[issue.at.line - 1] if text else ""
        raise ParseError(file, issue.at.line, issue.at.column, issue.message, line) from None


class _Reader:
    def __init__(self, text: str, file: str) -> None:
        if "//" in text or "/*" in text:
            text = _COMMENT.sub(_blank_comment, text)
        if '"' in text:
            text = _QUOTED.sub(lambda found: f'"{found[0][1:-1].translate(_MASK)}"', text)
        self._text, self._file = text, file
        self._lines = list_line_starts(text)
        self._values: dict[str, tuple[str, ...]] = {}
        self._codes: dict[str, dict[str, int]] = {}
        self._places: dict[str, Place] = {}
        self._tables: dict[str, ProbabilityTable] = {}
        self._rounded: list[RoundedRow] = []

    def read(self) -> BayesianNetwork:
        """Read all variables, then all tables."""
        distributions: list[tuple[int, str, int, str]] = []
        for start, kind, head, body_start, body in self._list_blocks():
            if kind == "variable":
                self._read_variable(start, head, body_start, body)
            elif kind == "probability":
                distributions.append((start, head, body_start, body))
        for distribution in distributions:
            self._read_distribution(*distribution)
        if not self._values:
            raise ProgramError(
                f"{self._file}: no variable; expected 'variable NAME {{ type discrete [ 2 ] {{ a, b }}; }}'"
            )
        for name, place in self._places.items():
            if name not in self._tables:
                raise ProgramError(
                    f"{place}: {name} has no table; expected 'probability ( {name} ) {{ ... }}'"
                )
        check_acyclic(self._tables)
        warn_of_rounding(self._rounded, stacklevel=6)
        return BayesianNetwork(self._file, self._values, self._tables, self._places)

    def _at(self, offset: int) -> Place:
        line = bisect_right(self._lines, offset)
        return Place(self._file, line, offset - self._lines[line - 1] + 1)

    def _fail(self, offset: int, message: str) -> SourceIssue:
        return SourceIssue(self._at(offset), message)

    def _list_blocks(self) -> Iterator[tuple[int, str, str, int, str]]:
        """Yield the offset, kind, head, and body of each block, with the offset of the body."""
        text, position = self._text, 0
        while match := _HEAD.search(text, position):
            start = match.start()
            if not match[1]:
                found = _NAME.match(text, start)
                word = found[0] if found else match[0]
                raise self._fail(
                    start, f"unexpected {word!r}; expected 'network', 'variable' or 'probability'"
                )
            opening = text.find("{", match.end())
            if opening < 0:
                raise self._fail(start, f"{match[1]} without a block; expected '{{'")
            depth, end = 1, opening + 1
            while depth:
                closing = text.find("}", end)
                if closing < 0:
                    raise self._fail(start, f"the block of this {match[1]} does not end; expected '}}'")
                depth += text.count("{", end, closing) - 1
                end = closing + 1
            yield start, match[1], text[match.end() : opening], opening + 1, text[opening + 1 : end - 1]
            position = end

    def _list_names(self, offset: int, text: str, separator: str, *, is_attribute: bool = False) -> list[str]:
        """List the names in a text, between commas or between spaces."""
        words = _NAME.findall(text)
        if '"' in _NAME.sub("", text):
            raise self._fail(offset, "a quote without its end")
        if "," in text and separator == "," and len(words) != text.count(",") + 1:
            raise self._fail(
                offset, f"{len(words)} names and {text.count(',')} commas; expected one between two names"
            )
        return [_read_name(word, is_attribute=is_attribute) for word in words]

    def _read_variable(self, start: int, head: str, body_start: int, body: str) -> None:
        names = self._list_names(start, head, " ", is_attribute=True)
        if len(names) != 1:
            raise self._fail(start, f"expected the name of one variable, not {head.strip()!r}")
        (name,) = names
        if name in self._values:
            raise self._fail(start, f"{name} is declared twice; first in line {self._places[name].line}")
        values: tuple[str, ...] = ()
        for match in _TYPE.finditer(body):
            offset = body_start + match.start()
            if match[2] is not None:
                if values:
                    raise self._fail(offset, f"a second type of {name}; expected one")
                values = tuple(self._list_names(offset, match[2], ","))
                if match[1].lstrip("0") != str(len(values)):
                    raise self._fail(offset, f"{name} has {len(values)} values; expected {match[1]}")
                if len(set(values)) < len(values):
                    twice = next(value for i, value in enumerate(values) if value in values[:i])
                    raise self._fail(offset, f"{name} has the value {twice} twice; expected different values")
            elif not match[0].startswith("property"):
                raise self._fail(
                    offset, f"unexpected text in {name}; expected 'type discrete [ 2 ] {{ a, b }};'"
                )
        if not values:
            raise self._fail(start, f"{name} has no values; expected 'type discrete [ 2 ] {{ a, b }};'")
        self._values[name], self._places[name] = values, self._at(start)
        self._codes[name] = {value: i for i, value in enumerate(values)}

    def _read_distribution(self, start: int, head: str, body_start: int, body: str) -> None:
        inside = head.strip()
        if not (inside.startswith("(") and inside.endswith(")")):
            raise self._fail(start, "expected 'probability ( NAME | NAME, ... )'")
        own, bar, given = inside[1:-1].partition("|")
        names = self._list_names(start, own, " ", is_attribute=True)
        parents = tuple(self._list_names(start, given, ",", is_attribute=True))
        if len(names) != 1 or (bar and not parents):
            raise self._fail(start, f"expected one variable before '|' and others after it, not {inside}")
        for name in (*names, *parents):
            if name not in self._values:
                raise self._fail(start, f"{name} is not declared; {expected_one_of(list(self._values))}")
        (name,) = names
        if name in parents or len(set(parents)) < len(parents):
            raise self._fail(start, f"{inside} names a variable twice; expected different variables")
        if name in self._tables:
            raise self._fail(
                start, f"{name} has two tables; the first is in line {self._tables[name].at.line}"
            )
        shape = tuple([len(self._values[parent]) for parent in (*parents, name)])
        if prod(shape) > MAX_ENTRIES:
            raise self._fail(
                start, f"the table of {name} has {prod(shape)} numbers; expected at most {MAX_ENTRIES}"
            )
        rows = self._read_rows(start, name, parents, shape, body_start, body)
        totals = rows.sum(axis=1)
        if ((rows < 0) | (rows > 1)).any() or not (abs(totals - 1) <= float(MAX_ROUNDING)).all():
            self._find_wrong_row(body_start, body, name, shape)
        off = np.flatnonzero(abs(totals - 1) > 1e-12)
        at = self._at(start)
        self._rounded += [(at, name, float(totals[i])) for i in off]
        self._tables[name] = ProbabilityTable(parents, np.ascontiguousarray(rows.reshape(shape)), at)

    def _read_rows(
        self,
        start: int,
        name: str,
        parents: Sequence[str],
        shape: tuple[int, ...],
        body_start: int,
        body: str,
    ) -> Array:
        """(combinations, values) Read the rows of a table."""
        size, codes = shape[-1], [self._codes[parent] for parent in parents]
        rows = np.full((prod(shape[:-1]), size), -1.0)
        default: list[float] | None = None
        for match in _ROW.finditer(body):
            offset = body_start + match.start()
            if match[1] is not None:
                words = _NAME.findall(match[1])
                index = 0
                if len(words) != len(parents):
                    raise self._fail(
                        offset,
                        f"a row with {len(words)} values; expected a value of {', '.join(parents) or 'none'}",
                    )
                for word, parent, code, n in zip(words, parents, codes, shape, strict=False):
                    own = code.get(word)
                    if own is None and (own := code.get(_read_name(word))) is None:
                        raise self._fail(
                            offset, f"{word} is not a value of {parent}; {expected_one_of(list(code))}"
                        )
                    index = index * n + own
                numbers = self._read_numbers(offset, name, match[2], size)
                if rows[index, 0] >= 0:
                    raise self._fail(offset, f"a second row for ({', '.join(words)}) of {name}; expected one")
                rows[index] = numbers
            elif default is not None or (rows[0, 0] >= 0 and match[3] == "table"):
                raise self._fail(
                    offset, f"numbers of {name} again; expected one table, or rows and one default"
                )
            elif match[3] == "default":
                default = self._read_numbers(offset, name, match[4], size)
            elif match[3] == "table":
                numbers = self._read_numbers(offset, name, match[4], rows.size)
                rows[:] = np.reshape(numbers, (size, -1)).T
            elif not match[0].startswith("property"):
                raise self._fail(
                    offset,
                    f"unexpected text in the table of {name}; expected '(VALUE, ...) NUMBER, ...;'",
                )
        missing = np.flatnonzero(rows[:, 0] < 0)
        if len(missing) and default is not None:
            rows[missing] = default
        elif len(missing):
            values = np.unravel_index(missing[0], shape[:-1]) if parents else ()
            key = ", ".join([self._values[parent][int(i)] for parent, i in zip(parents, values, strict=True)])
            where = f" for ({key})" if key else ""
            also = f", and {len(missing) - 1} others" if len(missing) > 1 else ""
            raise self._fail(
                start, f"the table of {name} has no row{where}{also}; expected one for each combination"
            )
        return rows

    def _read_numbers(self, offset: int, name: str, text: str, count: int) -> list[float]:
        words = text.split(",") if "," in text else text.split()
        try:
            if "_" in text or not text.isascii():
                raise ValueError
            numbers = list(map(float, words))
        except ValueError:
            wrong = next(word.strip() for word in words if not _is_number(word))
            raise self._fail(offset, f"{wrong!r} is not a number; expected probabilities of {name}") from None
        if len(numbers) != count:
            raise self._fail(offset, f"{len(numbers)} numbers for {name}; expected {count}")
        if not numbers[0] >= 0:
            raise self._fail(offset, f"the probability {words[0].strip()} of {name} is not between 0 and 1")
        return numbers

    def _find_wrong_row(self, body_start: int, body: str, name: str, shape: tuple[int, ...]) -> None:
        """Raise the error for the first row that is no distribution."""
        size = shape[-1]
        for match in _ROW.finditer(body):
            numbers = match[2] if match[1] is not None else match[4]
            if numbers is None:
                continue
            offset = body_start + match.start()
            read = self._read_numbers(offset, name, numbers, prod(shape) if match[3] == "table" else size)
            for row in np.reshape(read, (size, -1)).T.tolist():
                wrong = next((number for number in row if not 0 <= number <= 1), None)
                if wrong is not None:
                    raise self._fail(offset, f"the probability {wrong:g} of {name} is not between 0 and 1")
                if not abs(sum(row) - 1) <= MAX_ROUNDING:
                    raise self._fail(offset, f"the probabilities of {name} sum to {sum(row):.7g}; expected 1")


def _read_name(word: str, *, is_attribute: bool = False) -> str:
    """Return the text of a name as it stands in the file."""
    if word.startswith('"'):
        word = _ESCAPE.sub(r"\1", word[1:-1].translate(_UNMASK))
    return make_name_text(word) if is_attribute else make_value_text(word)


def _is_number(word: str) -> bool:
    if "_" in word or not word.isascii():
        return False
    try:
        float(word)
    except ValueError:
        return False
    return True


def _blank_comment(match: re.Match[str]) -> str:
    """Replace a comment by spaces, so that offsets stay; quoted names stay, too."""
    return match[0] if match[0].startswith('"') else re.sub(r"[^\n]", " ", match[0])
