"""Tables of knowledge as they are written, in CSV or TOML: heads and cells with their places."""

from __future__ import annotations

import re
from collections import Counter
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

_SPACES = " \t\u00a0\u200b\u2060\ufeff"

_ODD_SPACE = re.compile("[\u00a0\u2000-\u200a\u202f\u205f\u3000]")

_NO_WIDTH = re.compile("[\u200b\u2060\ufeff]")

_QUOTED = re.compile(r'"((?:[^"]|"")*)"')

_SEPARATOR_LINE = re.compile(r"(?i)\s*sep=([;,\t])\s*")

_SHEET_ERRORS = {"#N/A", "#DIV/0!", "#REF!", "#VALUE!", "#NAME?", "#NULL!", "#NUM!"}
"""What a spreadsheet shows in place of a value that it cannot compute."""


class Cell(NamedTuple):
    """A cell of a table.

    text: without space around it. name: as a spreadsheet names it, or of TOML. at: its place in the file.
    n_missing: the number of cells that its row has less than the head.
    """

    text: str
    name: str
    at: Place
    n_missing: int = 0


def clean_text(text: str) -> str:
    """Return the text of a cell: with plain spaces, as others look the same, and none around it."""
    return _NO_WIDTH.sub("", _ODD_SPACE.sub(" ", text)).strip()


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
    delimiter = _find_delimiter(source.lines)
    head: list[Cell] | None = None
    heads: list[tuple[list[Cell], list[list[Cell]]]] = []
    for number, line in enumerate(source.lines, 1):
        first = line.lstrip(_SPACES).partition(delimiter)[0].strip()
        if first.startswith("#") and first not in _SHEET_ERRORS:
            continue
        if number == 1 and _SEPARATOR_LINE.fullmatch(line):
            continue
        cells = _split_line(source, delimiter, number, line)
        n_written = len(cells)
        while cells and not cells[-1].text:
            cells.pop()
        if not cells:
            head = None
        elif any("=" in cell.text for cell in cells):
            head = cells
            heads.append((cells, []))
        elif head is None:
            ended = "; a blank line ended the table before" if heads else ""
            raise source.fail(
                cells[0],
                f"{cells[0].text!r} is in no table; expected a head with 'attribute = value'{ended}",
            )
        else:
            blank = Cell("", "", cells[-1].at)
            for column in range(len(cells), len(head)):
                cells.append(blank._replace(name=f"cell {_name_column(column)}{number}"))
            if n_written < len(head):
                cells = [cell._replace(n_missing=len(head) - n_written) for cell in cells]
            heads[-1][1].append(cells)
    parents = Counter([cell.text for head, _ in heads for cell in head if "=" not in cell.text])
    for head, body in heads:
        _check_widths(source, head, body)
        yield _arrange(source, head, body, parents, has_decimal_commas=delimiter != ",")


def _find_delimiter(lines: Sequence[str]) -> str:
    """Find the sign between cells: that of most lines, or of a line `sep=;` of a spreadsheet."""
    if lines and (match := _SEPARATOR_LINE.fullmatch(lines[0])):
        return match[1]
    bare = [_QUOTED.sub("", line) for line in lines if not line.lstrip().startswith("#")]
    counts = Counter([sign for line in bare for sign in {*";\t,"} & {*line}])
    # with semicolons or tabs a comma is the decimal sign, which is in as many lines at most
    return next((sign for sign in ";\t" if counts[sign] and counts[sign] >= counts[","]), ",")


def _split_line(source: TableSource, delimiter: str, number: int, line: str) -> list[Cell]:
    """Split a line into cells, which may be in quotes.

    Raises:
        ParseError: a quote is not closed, or is inside of a cell.
    """
    cells: list[Cell] = []
    start = 0
    while start <= len(line):
        text, end, begin = "", start, start
        while begin < len(line) and line[begin] in _SPACES and line[begin] != delimiter:
            begin += 1
        name = f"cell {_name_column(len(cells))}{number}"
        cell = Cell("", name, Place(source.file, number, begin + 1))
        if line[begin : begin + 1] == '"':
            match = _QUOTED.match(line, begin)
            if match is None:
                raise source.fail(cell, "a quote that is not closed; expected another one in this line")
            text, end = match[1].replace('""', '"'), match.end()
            while end < len(line) and line[end] in _SPACES and line[end] != delimiter:
                end += 1
            if end < len(line) and line[end] != delimiter:
                raise source.fail(cell, f"{line[end]!r} after a quote; expected {delimiter!r}")
        else:
            end = line.find(delimiter, start)
            end = len(line) if end < 0 else end
            text = line[start:end]
            if '"' in text:
                raise source.fail(cell, "a quote inside of a cell; expected quotes around the cell")
        cells.append(cell._replace(text=clean_text(text)))
        start = end + 1
    return cells


def _check_widths(source: TableSource, head: Sequence[Cell], body: Sequence[Sequence[Cell]]) -> None:
    """Check that no row has more cells than the head.

    Raises:
        ParseError: that of the head if each row has more, of the blank cell in the middle if there is one.
    """
    longer = [row for row in body if len(row) > len(head)]
    if not longer:
        return
    joined = [cell for cell in head if cell.text.count("=") > 1]
    if len(longer) == len(body) and (len(body) > 1 or joined):
        at = joined[0] if joined else head[-1]
        raise source.fail(
            at, f"the head has {len(head)} columns, its rows have {len(body[0])}; is a separator missing?"
        )
    (row, *_), n = longer, len(head)
    first_value = next(column for column, cell in enumerate(head) if "=" in cell.text)
    blank = next((cell for cell in row[first_value:] if not cell.text), None)
    if blank is not None:
        raise source.fail(blank, f"a blank cell, and the row has {len(row)} cells; the head has {n} columns")
    comma = next((k for k in range(len(row) - 1) if row[k].text == "0" and row[k + 1].text.isdigit()), None)
    if comma is not None:
        hint = f"is {row[comma].text},{row[comma + 1].text} one number? expected a decimal point"
        raise source.fail(row[comma], f"the row has {len(row)} cells, the head {n} columns; {hint}")
    raise source.fail(row[n], f"a cell beyond the head, which has {n} columns; expected none")


def _name_column(column: int) -> str:
    """Name a column, numbered from 0, as a spreadsheet does: A, B, ..."""
    letters, rest = "", column + 1
    while rest:
        rest, digit = divmod(rest - 1, 26)
        letters = chr(ord("A") + digit) + letters
    return letters


def _arrange(
    source: TableSource,
    head: Sequence[Cell],
    body: Sequence[Sequence[Cell]],
    known: Mapping[str, int],
    *,
    has_decimal_commas: bool,
) -> WrittenTable:
    """Divide the columns of a table into those of parents and those of values.

    Args:
        known: name -> how many tables have it as a parent.
    """
    attribute: Cell | None = None
    parents, values = dict[int, Cell](), dict[int, Cell]()
    names = Counter([cell.text.partition("=")[0].strip() for cell in head if "=" in cell.text])
    usual = max(names, key=lambda name: (names[name], known.get(name, 0)))  # of equal ones the first
    first = next(cell for cell in head if cell.text.partition("=")[0].strip() == usual and "=" in cell.text)
    for column, cell in enumerate(head):
        name, sign, value = [part.strip() for part in cell.text.partition("=")]
        if not name or (sign and not value):
            raise source.fail(cell, f"{cell.text!r} is no head; expected a parent, or 'attribute = value'")
        if not sign:
            parents[column] = cell
            continue
        if name != usual:
            raise source.fail(
                cell,
                f"a column of {name} in the table of {usual}, {first.name}; expected one attribute a table: a"
                " parent has no '=', and a row has values alone",
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
    try:
        document = parse_toml(source.file, source.text, ProgramError)
    except ParseError as error:
        message, place = error.message, Place(source.file, error.line, error.column)
        name = _name_toml_place(source.lines, error.line, error.column)
        if message == "Cannot overwrite a value":
            name, message = (
                name.partition(",")[0],
                "a second time; is a head such as [weather] missing above?",
            )
        elif message != "Invalid value" and not message.startswith(("a text ", "a list ")):
            raise
        raise source.fail(Cell("", name, place), message) from None
    for name, table in document.items():
        head = Cell(clean_text(name), f"[{name}]", _find_head(source, name))
        if not isinstance(table, Mapping) and name in _KEYS:
            line = next((i for i, own in enumerate(source.lines, 1) if own.lstrip().startswith(name)), 1)
            cell = Cell("", name, Place(source.file, line, 1))
            raise source.fail(cell, "outside of a table; expected a head such as [weather] above")
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


def _name_toml_place(lines: Sequence[str], line: int, column: int) -> str:
    """Name the table, the key and the row or entry of a place in a text that is no TOML."""
    table, key, row = "", "", 0
    for own in lines[:line]:
        if match := re.match(r"\s*\[\s*[\"']?([^\[\]\"',]+)[\"']?\s*\]\s*(?:#.*)?$", own):
            table, key = f"[{match[1].strip()}]", ""
        elif match := re.match(rf"\s*({'|'.join(_KEYS)})\s*=", own):
            key, row = match[1], own.count("[") - 1
        elif own.lstrip().startswith("["):
            row += 1
    shown = re.sub(r'"[^"]*"?', lambda match: match[0].replace(",", " "), lines[line - 1][: column - 1])
    entry = shown.count(",") + 1
    if key == "rows":
        entry = shown.rpartition("[")[2].count(",") + 1
        return f"{table} row {max(row, 1)}, cell {entry}"
    return f"{table} {key}, entry {entry}" if key else table or "the text"


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
        return cell._replace(text=clean_text(value))
    raise source.fail(cell, f"{str(value)[:40]} is no cell; expected a number or a text")
