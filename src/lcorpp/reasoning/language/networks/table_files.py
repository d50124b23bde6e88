"""Read knowledge written as tables, in CSV or TOML, into a Bayesian network.

    identity = student, identity = professor, identity = visitor
    30 %,               20 %,                 50 %

    identity,  time = morning, time = afternoon, time = evening
    student,   15,             15,               70
    professor, 80,             10,               rest
    ,          10,             70,               20

A table has a column for each parent and one for each value of its attribute; a row has the distribution given
values of the parents. A blank cell of a parent stands for the values that no more specific row names, `rest`
for the probability that is left of the row. Numbers are probabilities, fractions or percent. In CSV, a head
begins a table, and lines that begin with # are comments. In TOML the second table is

    [time]
    given = ["identity"]
    values = ["morning", "afternoon", "evening"]
    rows = [["student", 15, 15, 70], ["professor", 80, 10, "rest"], ["", 10, 70, 20]]
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lcorpp.errors import ProgramError, expected_one_of
from lcorpp.files import read_text
from lcorpp.reasoning.language.arithmetic import MAX_ROUNDING
from lcorpp.reasoning.language.networks.bayesian_network import (
    BayesianNetwork,
    ProbabilityTable,
    RoundedRow,
    check_acyclic,
    warn_of_rounding,
)
from lcorpp.reasoning.language.networks.written_tables import (
    MAX_BYTES,
    Cell,
    TableSource,
    WrittenTable,
    split_csv,
    split_toml,
)
from lcorpp.reasoning.quoting import make_name_text, make_value_text

MAX_COMBINATIONS = 2**20
"""Maximum number of combinations of values of the parents of an attribute."""

MAX_PARENTS = 60
"""Maximum number of parents of an attribute."""

REST = "rest"
"""The text of a cell with the probability that is left of a row."""

MAX_DIGITS = 300
"""Maximum number of characters of a number."""

MAX_SHOWN = 3
"""Maximum number of missing combinations that a message names."""

_NUMBER = re.compile(r"([0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE]([+-]?[0-9]{1,3}))?\s*(%?)")

_FRACTION = re.compile(r"([0-9]+)\s*/\s*([0-9]+)")


class _Number(NamedTuple):
    """A number as it is written; kind: plain, percent with its sign, or fraction."""

    number: Fraction
    kind: str


class _Row(NamedTuple):
    """A row that is read.

    given: for each parent the index of its value, or None for the others.
    """

    given: tuple[int | None, ...]
    numbers: list[Fraction]
    cells: Sequence[Cell]


def read_tables(path: str | Path) -> BayesianNetwork:
    """Read a file of tables; its suffix, ``.csv`` or ``.toml``, selects the format.

    Raises:
        FileError: the file cannot be read.
        ParseError, ProgramError: as `parse_tables`.
    """
    return parse_tables(read_text(path, MAX_BYTES), file=str(path))


def parse_tables(text: str, *, file: str = "<text>.csv") -> BayesianNetwork:
    """Parse tables given as text: TOML if the file's suffix is ``.toml``, otherwise CSV.

    Raises:
        ParseError: a cell is wrong, a row is missing or occurs twice, or its sum is not 1.
        ProgramError: there is no table, or an attribute depends on itself.
    """
    source = TableSource(file, text.removeprefix("\ufeff"))
    reader = _Reader(source)
    for table in split_toml(source) if file.lower().endswith(".toml") else split_csv(source):
        reader.add(table)
    return reader.make_network()


class _Reader:
    """Reads the cells of tables, of which the heads are known."""

    def __init__(self, source: TableSource) -> None:
        self._file, self._fail = source.file, source.fail
        self._written: dict[str, WrittenTable] = {}
        self._values: dict[str, tuple[str, ...]] = {}
        self._codes: dict[str, dict[str, int]] = {}
        self._rounded: list[RoundedRow] = []

    def add(self, table: WrittenTable) -> None:
        """Add a table, and check its values."""
        head = table.attribute
        name = make_name_text(head.text)
        if name in self._written:
            first = self._written[name].attribute
            raise self._fail(head, f"a second table of {head.text}; the first is in line {first.at.line}")
        values: dict[str, int] = {}
        for cell in table.values:
            value = make_value_text(cell.text)
            if value in values:
                raise self._fail(
                    cell, f"{head.text} has the value {cell.text} twice; expected different ones"
                )
            values[value] = len(values)
        self._written[name], self._values[name], self._codes[name] = table, tuple(values), values

    def make_network(self) -> BayesianNetwork:
        """Read the rows of all tables."""
        if not self._written:
            raise ProgramError(
                f"{self._file}: no table; expected one such as 'weather = dry, weather = wet' with a row of"
                " probabilities, or in TOML '[weather]' with values and rows"
            )
        tables = {name: self._read_table(name, table) for name, table in self._written.items()}
        check_acyclic(tables)
        warn_of_rounding(self._rounded, stacklevel=5)
        places = {name: table.attribute.at for name, table in self._written.items()}
        return BayesianNetwork(self._file, self._values, tables, places)

    def _read_table(self, name: str, table: WrittenTable) -> ProbabilityTable:
        head, parents = table.attribute, dict[str, Cell]()
        for cell in table.parents:
            parent = make_name_text(cell.text)
            if parent not in self._values:
                known = expected_one_of([written.attribute.text for written in self._written.values()])
                raise self._fail(cell, f"{cell.text} has no table, nor is it 'attribute = value'; {known}")
            if parent == name:
                raise self._fail(cell, f"{cell.text} depends on itself; expected other attributes")
            if parent in parents:
                raise self._fail(cell, f"{cell.text} occurs twice in the head; expected different attributes")
            parents[parent] = cell
        if len(parents) > MAX_PARENTS:
            raise self._fail(head, f"{head.text} has {len(parents)} parents; expected at most {MAX_PARENTS}")
        shape = tuple([len(self._values[parent]) for parent in parents])
        if prod(shape) > MAX_COMBINATIONS:
            raise self._fail(
                head,
                f"the parents of {head.text} have {prod(shape)} combinations of values; expected at most"
                f" {MAX_COMBINATIONS}",
            )
        rows = [_Row(self._read_given(parents, given), [], cells) for given, cells in table.rows]
        if not rows:
            raise self._fail(head, f"the table of {head.text} has no row; expected one")
        rows = self._read_numbers(head, rows)
        chosen = self._choose_rows(head, tuple(parents), shape, rows)
        numbers = np.array([[float(number) for number in row.numbers] for row in rows])[chosen]
        fractions = [rows[i].numbers for i in chosen.tolist()]
        numbers = np.ascontiguousarray(numbers.reshape(*shape, len(self._values[name])))
        return ProbabilityTable(tuple(parents), numbers, head.at, fractions)

    def _read_given(self, parents: Mapping[str, Cell], cells: Sequence[Cell]) -> tuple[int | None, ...]:
        given: list[int | None] = []
        for parent, cell in zip(parents, cells, strict=True):
            code = self._codes[parent].get(make_value_text(cell.text)) if cell.text else None
            if cell.text and code is None:
                known = expected_one_of([c.text for c in self._written[parent].values])
                hint = _describe_missing(cell) or "; a blank cell is for all others"
                raise self._fail(cell, f"{cell.text} is not a value of {parents[parent].text}; {known}{hint}")
            given.append(code)
        return tuple(given)

    def _read_numbers(self, head: Cell, rows: Sequence[_Row]) -> list[_Row]:
        """Read the numbers of all rows, which have one unit; fractions are never percent."""
        read = [[self._read_number(cell) for cell in row.cells] for row in rows]
        unit = self._find_unit(rows, read)
        result = []
        for row, own in zip(rows, read, strict=True):
            numbers: list[Fraction | None] = []
            for cell, found in zip(row.cells, own, strict=True):
                if found is None:
                    numbers.append(None)
                    continue
                number = found.number if found.kind == "fraction" else found.number / unit
                if number > 1:
                    limit = "100 %" if unit == 100 else "1; expected a probability, or percent with %"
                    raise self._fail(cell, f"{cell.text} is more than {limit}")
                numbers.append(number)
            result.append(row._replace(numbers=self._complete(head, row, numbers, unit)))
        return result

    def _find_unit(self, rows: Sequence[_Row], read: Sequence[Sequence[_Number | None]]) -> int:
        """Return 100 for percent: with signs, or if most rows are in percent.

        Raises:
            ParseError: some numbers have signs of percent and some have none, or a row may have either unit.
        """
        pairs = [
            pair for row, own in zip(rows, read, strict=True) for pair in zip(row.cells, own, strict=True)
        ]
        signed = [cell for cell, found in pairs if found is not None and found.kind == "percent"]
        plain = [
            cell for cell, found in pairs if found is not None and found.kind == "plain" and found.number
        ]
        if signed and plain:
            # of as many, those are wrong without which the row sums to 1, or to 100
            numbers = [found.number for _, found in pairs if found is not None and found.kind != "fraction"]
            is_small = sum(numbers) < 2 * len(rows)
            few = signed if (len(signed), not is_small) < (len(plain), True) else plain
            has = (
                "has %; other cells of this table have none" if few is signed else "without %; other cells of"
            )
            has += "" if few is signed else " this table have it"
            raise self._fail(few[0], f"{few[0].text} {has}; expected it in all, or fractions such as 1/3")
        if signed:
            return 100
        written = [[found.number for found in own if found and found.kind == "plain"] for own in read]
        whole = [sum(numbers) > 50 for numbers, own in zip(written, read, strict=True) if None not in own]
        if not whole:  # a row is in percent if its numbers are; a single 9 may be .9 without its point
            nonzero = [list(filter(None, numbers)) for numbers in written]
            whole = [
                len(numbers) > 0 and min(numbers) >= (1 if len(numbers) > 1 else 10) for numbers in nonzero
            ]
        if 2 * sum(whole) <= len(whole):
            return 1
        for row, own in zip(rows, read, strict=True):
            given = [
                (found.number, cell)
                for cell, found in zip(row.cells, own, strict=True)
                if found is not None and found.kind == "plain" and found.number
            ]
            if None in own and given and (min(given)[0] < 1 or max(given)[0] == 1):
                cell = min(given)[1]
                raise self._fail(cell, f"{cell.text} in a table of percent; expected it with %")
        return 100

    def _complete(
        self, head: Cell, row: _Row, numbers: Sequence[Fraction | None], unit: int
    ) -> list[Fraction]:
        """Compute the rest of a row, and check its sum."""
        total = sum([number for number in numbers if number is not None], Fraction(0))
        rest = [i for i, number in enumerate(numbers) if number is None]
        shown = f"{float(total * 100):.10g} %" if unit == 100 else f"{float(total):.10g}"
        whole = "100 %" if unit == 100 else "1"
        if len(rest) > 1:
            raise self._fail(row.cells[rest[1]], f"a second {REST!r} in this row; expected at most one")
        if rest:
            if total > 1:
                raise self._fail(
                    row.cells[rest[0]], f"the row sums to {shown}, so that nothing is left; expected {whole}"
                )
            return [1 - total if number is None else number for number in numbers]
        if abs(total - 1) > MAX_ROUNDING:
            raise self._fail(
                row.cells[0],
                f"the probabilities of {head.text} in this row sum to {shown}; expected {whole}, or"
                f" {REST!r} in one cell for what is left",
            )
        if total != 1:
            self._rounded.append((row.cells[0].at, head.text, float(total)))
        return [(number or Fraction(0)) / total for number in numbers]

    def _read_number(self, cell: Cell) -> _Number | None:
        """Read a number; None for the rest."""
        text = cell.text
        if text.lower() == REST:
            return None
        if len(text) <= MAX_DIGITS:
            if match := _NUMBER.fullmatch(text):
                number = Fraction(match[1]) * Fraction(10) ** int(match[2] or 0)
                return _Number(number, "percent" if match[3] else "plain")
            if (match := _FRACTION.fullmatch(text)) and int(match[2]):
                return _Number(Fraction(int(match[1]), int(match[2])), "fraction")
        expected = f"expected a probability such as 0.3, 30 % or 3/10, or {REST!r}"
        if not text:
            raise self._fail(cell, f"a blank cell; {expected}{_describe_missing(cell)}")
        if text.startswith("-") and _NUMBER.fullmatch(text[1:].strip()):
            raise self._fail(cell, f"{text} is negative; {expected}")
        raise self._fail(cell, f"{text[:40]!r} is not a number; {expected}{_describe_missing(cell)}")

    def _choose_rows(
        self, head: Cell, parents: Sequence[str], shape: tuple[int, ...], rows: Sequence[_Row]
    ) -> Any:
        """(combinations,) Choose for each combination of values of the parents the most specific row."""
        chosen = np.full(shape, -1, dtype=np.int64)
        named = np.zeros(shape, dtype=np.int64)  # the parents that rows for a combination name, as bits
        seen: dict[tuple[int | None, ...], Cell] = {}
        masks = [sum([1 << k for k, code in enumerate(row.given) if code is not None]) for row in rows]
        for i in sorted(range(len(rows)), key=lambda i: masks[i].bit_count()):
            row = rows[i]
            if row.given in seen:
                first = seen[row.given]
                text = f"a second row for {self._describe(parents, row.given)}; the first is"
                raise self._fail(row.cells[0], f"{text} {_name_row(first)}")
            seen[row.given] = row.cells[0]
            where = tuple([slice(None) if code is None else code for code in row.given])
            chosen[where] = i
            named[where] |= masks[i]
        wrong = np.flatnonzero(named.ravel() != np.array([*masks, 0])[chosen.ravel()])
        missing = np.flatnonzero(chosen.ravel() < 0)
        if len(missing):
            boxes, n_more = _find_boxes(missing, shape)
            text = "; ".join([self._describe(parents, box) for box in boxes])
            more = f", and {n_more} more" if n_more else ""
            raise self._fail(head, f"the table of {head.text} has no row for {text}{more}; expected one")
        for place in wrong[:1].tolist():
            codes = tuple([int(code) for code in np.unravel_index(place, shape)])
            combination = self._describe(parents, codes)
            fits = [
                i
                for i, row in enumerate(rows)
                if all(own is None or own == code for own, code in zip(row.given, codes, strict=True))
            ]
            best = [
                rows[i] for i in fits if not any(masks[i] | masks[k] == masks[k] != masks[i] for k in fits)
            ]
            last = max(best, key=rows.index)
            others = ", ".join([_name_row(row.cells[0]) for row in best if row is not last])
            raise self._fail(
                last.cells[0],
                f"this row and {others} are both for {combination}, and neither is more specific;"
                " expected a row for all that they name",
            )
        return chosen.ravel()

    def _describe(self, parents: Sequence[str], codes: Sequence[int | None]) -> str:
        pairs = zip(parents, codes, strict=True)
        text = ", ".join([f"{p}={'' if c is None else self._values[p][c]}" for p, c in pairs])
        return text or "this attribute"


def _find_boxes(places: Any, shape: Sequence[int]) -> tuple[list[list[int | None]], int]:
    """Return combinations of values that cover the places, at most `MAX_SHOWN`; None is any value.

    Returns:
        The combinations, and the number of places that none of them covers.
    """
    among = np.zeros(shape, dtype=bool)
    among.ravel()[places] = True
    left, boxes = among.copy(), list[list[int | None]]()
    while left.any() and len(boxes) < MAX_SHOWN:
        where: list[Any] = [int(code) for code in np.argwhere(left)[0]]
        for axis in range(len(shape)):
            whole = [*where[:axis], slice(None), *where[axis + 1 :]]
            if shape[axis] > 1 and among[tuple(whole)].all():
                where = whole
        left[tuple(where)] = False
        boxes.append([None if isinstance(code, slice) else code for code in where])
    return boxes, int(left.sum())


def _name_row(cell: Cell) -> str:
    """Name the row of a cell: ``row 3`` in CSV, ``[time] row 3`` in TOML."""
    return re.sub(r"^cell [A-Z]+", "row ", cell.name.partition(", cell ")[0])


def _describe_missing(cell: Cell) -> str:
    n = cell.n_missing
    return f"; the row has {n} cell{'s' if n > 1 else ''} less than the head" if n else ""
