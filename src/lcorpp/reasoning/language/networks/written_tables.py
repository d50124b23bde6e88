"""Tables of knowledge as they are written, in CSV or TOML: heads and cells with their places."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from lcorpp.errors import LcorppError, ParseError, ProgramError, expected_one_of
from lcorpp.files import read_text
from lcorpp.reasoning.language.issues import Place
from lcorpp.toml_text import parse_toml

MAX_BYTES = 2**24
"""Maximum size of a file."""

_DECIMAL_COMMA = re.compile(r"(?<![0-9.])[0-9]*,[0-9]+")

_KEYS = ("given", "values", "rows")


class Cell(NamedTuple):
    """A cell of a table.

    text: without space around it. name: as a spreadsheet names it, or of TOML. at: its place in the file.
    """

    text: str
    name: str
    at: Place


@dataclass(frozen=True, slots=True, eq=False)
class WrittenTable:
    """A table as it is written.

    attribute: its name. parents, values: the heads of the columns.
    rows: for each row the cells of the parents, and those of the values.
    """

    attribute: Cell
    parents: Sequence[Cell]
    values: Sequence[Cell]
    rows: Sequence[tuple[Sequence[Cell], Sequence[Cell]]]


class TableSource:
    """The text of a file of tables."""

    def __init__(self, file: str, text: str) -> None:
        self.file, self.text, self.lines = file, text, text.splitlines()

    def fail(self, cell: Cell, message: str) -> ParseError:
        """Make an error for a cell."""
        line = self.lines[cell.at.line - 1] if 0 < cell.at.line <= len(self.lines) else ""
        return ParseError(self.file, cell.at.line, cell.at.column, f"{cell.name}: {message}", line)


def split_csv(source: TableSource) -> Iterator[WrittenTable]:
    """Split a text into tables; a row with a cell `attribute = value` is a head."""
    lines = [line for line in source.lines if line.strip()]
    first = next((line for line in lines if not line.lstrip().startswith("#")), "")
    delimiter = max(";\t,", key=lambda sign: (sign in first, sign == ";"))
    head: list[Cell] | None = None
    heads: list[tuple[list[Cell], list[list[Cell]]]] = []
    rows = csv.reader(
        source.text.splitlines(keepends=True), delimiter=delimiter, skipinitialspace=True, strict=True
    )
    number = 0
    while True:
        try:
            record = next(rows, None)
        except csv.Error as error:
            at = Place(source.file, max(rows.line_num, 1), 1)
            raise source.fail(Cell("", f"row {number + 1}", at), f"is no CSV: {error}") from None
        if record is None:
            break
        number += 1
        cells = _make_cells(source, delimiter, rows.line_num, number, record)
        while cells and not cells[-1].text:
            cells.pop()
        if cells and cells[0].text.startswith("#"):
            continue
        if not cells:
            head = None
        elif any("=" in cell.text for cell in cells):
            head = cells
            heads.append((cells, []))
        elif head is None:
            raise source.fail(
                cells[0], f"{cells[0].text!r} is in no table; expected a head with 'attribute = value'"
            )
        else:
            if len(cells) > len(head):
                raise source.fail(
                    cells[len(head)], f"a cell beyond the head, which has {len(head)} columns; expected none"
                )
            missing = len(head) - len(cells)
            cells = _make_cells(source, delimiter, rows.line_num, number, [*record, *[""] * missing])
            heads[-1][1].append(cells[: len(head)])
    for head, body in heads:
        yield _arrange(source, head, body, has_decimal_commas=delimiter != ",")


def _make_cells(
    source: TableSource, delimiter: str, line: int, row: int, record: Sequence[str]
) -> list[Cell]:
    """Make the cells of a row, with their names in a spreadsheet, e.g. A1, and their places in the line."""
    shown = source.lines[line - 1] if line <= len(source.lines) else ""
    starts, is_quoted = [0], False
    for i, sign in enumerate(shown):
        is_quoted ^= sign == '"'
        if sign == delimiter and not is_quoted:
            starts.append(i + 1)
    cells = []
    for column, text in enumerate(record):
        letters, rest = "", column + 1
        while rest:
            rest, digit = divmod(rest - 1, 26)
            letters = chr(ord("A") + digit) + letters
        start = starts[column] if column < len(starts) else len(shown)
        while start < len(shown) and shown[start].isspace():
            start += 1
        cells.append(Cell(text.strip(), f"cell {letters}{row}", Place(source.file, line, start + 1)))
    return cells


def _arrange(
    source: TableSource, head: Sequence[Cell], body: Sequence[Sequence[Cell]], has_decimal_commas: bool
) -> WrittenTable:
    """Divide the columns of a table into those of parents and those of values."""
    attribute: Cell | None = None
    parents, values = dict[int, Cell](), dict[int, Cell]()
    for column, cell in enumerate(head):
        name, sign, value = [part.strip() for part in cell.text.partition("=")]
        if not name or (sign and not value):
            raise source.fail(cell, f"{cell.text!r} is no head; expected a parent, or 'attribute = value'")
        if not sign:
            parents[column] = cell
            continue
        if attribute is not None and name != attribute.text:
            raise source.fail(
                cell, f"a column of {name} in the table of {attribute.text}; expected one attribute a table"
            )
        attribute = attribute or cell._replace(text=name)
        values[column] = cell._replace(text=value)
    assert attribute is not None
    rows = []
    for cells in body:
        numbers = [cells[column] for column in values]
        if has_decimal_commas:
            numbers = [c._replace(text=_DECIMAL_COMMA.sub(_replace_comma, c.text)) for c in numbers]
        rows.append(([cells[column] for column in parents], numbers))
    return WrittenTable(attribute, list(parents.values()), list(values.values()), rows)


def _replace_comma(match: re.Match[str]) -> str:
    return match[0].replace(",", ".")


def split_toml(source: TableSource) -> Iterator[WrittenTable]:
    """Read the tables of TOML, each with `values`, `rows` and, if it has parents, `given`."""
    document = parse_toml(source.file, source.text, ProgramError)
    for name, table in document.items():
        head = Cell(name.strip(), f"[{name}]", _find_head(source, name))
        if not isinstance(table, Mapping):
            raise source.fail(head, "expected a table with values and rows")
        for key in table:
            if key not in _KEYS:
                raise source.fail(head, f"unknown key {key!r}; {expected_one_of(_KEYS)}")
        columns = {
            key: [
                _make_toml_cell(source, head, value, f"[{name}] {key}, entry {i + 1}")
                for i, value in enumerate(_get_list(source, head, table, key))
            ]
            for key in ("given", "values")
        }
        if not columns["values"]:
            raise source.fail(head, "no values; expected a list of at least one")
        n_parents, width = len(columns["given"]), len(columns["given"]) + len(columns["values"])
        rows = []
        for i, row in enumerate(_get_list(source, head, table, "rows")):
            where = head._replace(name=f"[{name}] row {i + 1}")
            if not isinstance(row, list) or len(row) != width:
                n_cells = f"{len(row)} cells" if isinstance(row, list) else repr(row)
                expected = f"{n_parents} of the parents and {width - n_parents} probabilities"
                raise source.fail(where, f"{n_cells}; expected a list of {expected}")
            cells = [
                _make_toml_cell(source, head, value, f"[{name}] row {i + 1}, cell {k + 1}")
                for k, value in enumerate(row)
            ]
            rows.append((cells[:n_parents], cells[n_parents:]))
        yield WrittenTable(head, columns["given"], columns["values"], rows)


def is_table_file(path: Path) -> bool:
    """Whether a TOML file has tables of knowledge, perhaps with errors, and nothing else."""
    if path.name in ("domain.toml", "robot.toml") or not path.is_file():
        return False
    try:
        document = parse_toml(str(path), read_text(path, MAX_BYTES), ProgramError)
    except LcorppError:  # the reader of the file names the reason
        return False
    return bool(document) and all(
        isinstance(table, Mapping) and not {"values", "rows"}.isdisjoint(table) for table in document.values()
    )


def _find_head(source: TableSource, name: str) -> Place:
    """Find the line of a table's head."""
    for number, line in enumerate(source.lines, 1):
        if re.fullmatch(rf"\s*\[\s*[\"']?{re.escape(name)}[\"']?\s*\]\s*(#.*)?", line):
            return Place(source.file, number, line.index("[") + 1)
    return Place(source.file, 1, 1)


def _get_list(source: TableSource, head: Cell, table: Mapping[str, Any], key: str) -> Sequence[Any]:
    found = table.get(key, [] if key == "given" else None)
    if not isinstance(found, list):
        given = "no" if found is None else "no list as"
        raise source.fail(head, f"{given} {key}; expected '{key} = [...]'")
    return found


def _make_toml_cell(source: TableSource, head: Cell, value: Any, name: str) -> Cell:
    cell = Cell("", name, head.at)
    if isinstance(value, bool):
        return cell._replace(text=str(value).lower())
    if isinstance(value, int | float):
        return cell._replace(text=repr(value))
    if isinstance(value, str):
        return cell._replace(text=value.strip())
    raise source.fail(cell, f"{str(value)[:40]} is no cell; expected a number or a text")
