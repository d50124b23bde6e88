"""Read CSV text into columns, in batches of lines; errors have their line and column.

numpy converts a batch at once; only a batch that fails is parsed line by line.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lcorpp.errors import FileError, LcorppError, ParseError
from lcorpp.files import locate_bad_byte, open_text
from lcorpp.learning.data.dates import parse_date
from lcorpp.learning.data.repairs import RepairLog, RowSource
from lcorpp.notebook import join_some
from lcorpp.values import Array

BATCH_LINES = 50_000
"""Lines per batch: some megabytes of text."""

MAX_WORD = 40
"""Length of a word in letters from which a batch is parsed line by line."""

DELIMITERS = ",;\t|"
"""Characters that may separate columns."""

WHITESPACE = " "
"""Delimiter of a line without any of `DELIMITERS`: spaces, any number of them."""

NUMBERS = "numbers"
"""Kind of times that are not dates."""

Progress = Callable[[int, int], None]
"""Callback with (bytes read, bytes in all)."""

Lines = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class RowBatch:
    """Rows of a file, as columns.

    lines: (rows,) line numbers in the file, from 1. numbers: name -> (rows,), NaN for an empty cell.
    texts: name -> (rows,) words, stripped.
    """

    lines: Lines
    numbers: Mapping[str, Array]
    texts: Mapping[str, list[str]]

    def take(self, rows: npt.NDArray[np.intp]) -> RowBatch:
        """Return the given rows, in their order."""
        chosen = rows.tolist()
        return RowBatch(
            self.lines[rows],
            {name: values[rows] for name, values in self.numbers.items()},
            {name: [words[row] for row in chosen] for name, words in self.texts.items()},
        )


class CsvFile(RowSource):
    """A CSV file of known columns.

    Args:
        path: the file, in an encoding of `open_text`.
        names: all columns. numbers, words: those that are read.
        repair_log: the requested repairs. header: number of lines before the first row.
        delimiter: the character between columns, or `WHITESPACE`.
        allows_dates: whether the time may be dates, which become seconds.
    """

    def __init__(
        self,
        path: Path,
        names: Sequence[str],
        numbers: tuple[str, ...],
        words: tuple[str, ...],
        repair_log: RepairLog,
        *,
        header: int = 0,
        delimiter: str = ",",
        allows_dates: bool = False,
    ) -> None:
        super().__init__(path, repair_log)
        self._allows_dates, self._clock = allows_dates, ""
        self._numbers, self._texts, self.header = numbers, words, header
        self._delimiter = delimiter
        self._names = names
        self._cells = {name: cell for cell, name in enumerate(names) if name in (*numbers, *self._texts)}
        kinds = ("f8" if name in numbers else f"U{MAX_WORD}" for name in names)
        fields = (name if name in self._cells else f"unused {cell}" for cell, name in enumerate(names))
        self._kinds = np.dtype(list(zip(fields, kinds, strict=True)))

    def notes(self) -> tuple[str, ...]:
        """Return warnings about a file that was read."""
        dates = () if self._clock in ("", NUMBERS) else (f"times are {self._clock}, read as seconds",)
        return (*dates, *self._note_end())

    def _note_end(self) -> tuple[str, ...]:
        if self.ended or any(repair.reason == "cut" for repair in self.repair_log.repairs):
            return ()
        return ("the last line has no line end: its last number may have been cut",)

    def error_at(self, line: int, field: str, message: str) -> LcorppError:
        """Return a ParseError at a field, with the text of its line."""
        with open_text(self.file) as file:
            text = next(islice(file, line - 1, None), "")
        return ParseError(
            self.file, line, column_of(text, self._cells.get(field, 0), self._delimiter), message, text
        )

    def batches(self, progress: Progress | None = None) -> Iterator[RowBatch]:
        """Yield all rows without blank lines; one that cannot be parsed needs the repair `rows` or `cut`."""
        read, number = 0, 1
        with open_text(self.file) as file:
            size = os.fstat(file.fileno()).st_size
            while lines := self._read_lines(file):
                self.ended = lines[-1].endswith("\n")
                first = min(max(0, self.header + 1 - number), len(lines))
                yield self._parse_batch(lines[first:], number + first)
                number += len(lines)
                read += sum(map(len, lines))
                if progress is not None:
                    progress(min(read, size), size)

    def _read_lines(self, file: Iterator[str]) -> list[str]:
        try:
            return list(islice(file, BATCH_LINES))
        except UnicodeDecodeError:
            raise locate_bad_byte(self.file) from None
        except OSError as error:
            raise FileError(f"{self.file}: cannot be read: {error.strerror or error}") from None

    def _parse_batch(self, lines: list[str], number: int) -> RowBatch:
        batch = self._parse_at_once(lines, number)
        if batch is not None:
            return batch
        parsed = ((line, self._parse_row(line, text)) for line, text in enumerate(lines, number))
        rows = {line: row for line, row in parsed if row is not None}
        columns = list(zip(*rows.values(), strict=True)) or [()] * len(self._names)
        return RowBatch(
            np.array(list(rows), dtype=np.int64),
            {name: np.array([float(c) for c in columns[self._cells[name]]]) for name in self._numbers},
            {name: [word.strip() for word in columns[self._cells[name]]] for name in self._texts},
        )

    def _parse_at_once(self, lines: list[str], number: int) -> RowBatch | None:
        """Convert all lines with numpy, in a tenth of the time; return None if that fails."""
        if not lines or not lines[0].strip() or self._clock not in ("", NUMBERS):
            return None
        try:
            delimiter = None if self._delimiter == WHITESPACE else self._delimiter
            table = np.loadtxt(
                lines, dtype=self._kinds, delimiter=delimiter, comments=None, quotechar='"', ndmin=1
            )
        except ValueError:
            return None
        texts = {name: table[name].tolist() for name in self._texts}
        if len(table) != len(lines) or any(max(map(len, words)) >= MAX_WORD for words in texts.values()):
            return None
        if "time" in self._numbers:
            self._clock = NUMBERS
        return RowBatch(
            np.arange(number, number + len(lines), dtype=np.int64),
            {name: np.ascontiguousarray(table[name]) for name in self._numbers},
            {name: [word.strip() for word in words] for name, words in texts.items()},
        )

    def _parse_row(self, line: int, text: str) -> list[str] | None:
        """Return the cells of a line, empty numbers as NaN; None if the line is blank or left out."""
        if not text.strip():
            return None
        cut = not text.endswith("\n")
        reason, aside = ("cut", "; the file ends in the middle of its last line") if cut else ("rows", "")
        try:
            row = _split_cells(text, self._delimiter)
        except (ValueError, csv.Error) as error:
            self.repair_or_raise(reason, line, f"not a row of CSV ({error}){aside}")
            return None
        width = len(self._names)
        if len(row) > width and line == self.header + 1 > 1 and reason not in self.repair_log.requested:
            names = join_some(self._names, width if width < 12 else 6)
            message = (
                f"{width} columns, {names}, but the first row has {len(row)}: {row[width].strip()!r} has no"
            )
            raise self.error_at(
                self.header, "", f"{message} name; expected a name for each column, and decimal points"
            )
        if len(row) != width:
            message = f"{len(row)} columns; expected {width}, with {join_some(list(self._cells))}{aside}"
            self.repair_or_raise(reason, line, message)
            return None
        for name in self._numbers:
            cell = row[self._cells[name]]
            if not cell.strip():
                row[self._cells[name]] = "nan"
                continue
            date = parse_date(cell) if name == "time" else None
            if date is not None and self._allows_dates:
                row[self._cells[name]] = repr(date[1])
            if name == "time" and (is_number(cell) or (date is not None and self._allows_dates)):
                kind = NUMBERS if date is None else date[0]
                self._clock = self._clock or kind
                if kind != self._clock:
                    message = (
                        f"the time {cell!r} is of another kind ({kind}) than those before ({self._clock})"
                    )
                    self.repair_or_raise(reason, line, f"{message}; expected one kind{aside}", field=name)
                    return None
            elif not is_number(cell):
                message = f"{cell!r} is not a number; expected the {name}{aside}"
                if date is not None:
                    raise self.error_at(
                        line, name, f"{message} in numbers, as --time-unit and --fps are not for dates"
                    )
                if re.fullmatch(r"\s*-?\d+,\d+\s*", cell):  # so is every row
                    raise self.error_at(
                        line,
                        name,
                        f"{message}, with a decimal point instead of the comma, e.g. by tr , . < IN > OUT",
                    )
                self.repair_or_raise(reason, line, message, field=name)
                return None
        return row


def detect_delimiter(text: str) -> str:
    """Return the most frequent delimiter of a line, outside quotes; among equals the comma.

    A line without delimiters that has several words is separated by whitespace.
    """
    bare = re.sub('"[^"]*"', '""', text)
    delimiter = max(DELIMITERS, key=bare.strip().count)
    return delimiter if delimiter in bare.strip() or len(bare.split()) < 2 else WHITESPACE


def _split_cells(text: str, delimiter: str) -> list[str]:
    """Return the cells of one line; raises csv.Error or ValueError."""
    if delimiter == WHITESPACE:
        return [cell.strip('"') for cell in re.findall(r'"[^"]*"|\S+', text)]
    return next(csv.reader([text], strict=True, delimiter=delimiter), [])


def parse_line(file: str, line: int, text: str, delimiter: str) -> list[str]:
    """Return the stripped cells of a line of CSV, or raise a ParseError."""
    try:
        return [cell.strip() for cell in _split_cells(text, delimiter)]
    except csv.Error as error:
        raise ParseError(file, line, 1, f"not a row of CSV ({error})", text) from None


def is_number(cell: str) -> bool:
    """Whether a cell is a decimal number."""
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell and cell.isascii()


def column_of(text: str, cell: int, delimiter: str = ",") -> int:
    """Return the column (from 1) at which a cell (from 0) of a line begins."""
    if delimiter == WHITESPACE:
        starts = [found.start() + 1 for found in re.finditer(r'"[^"]*"|\S+', text)]
        return starts[cell] if cell < len(starts) else len(text.rstrip("\n")) + 1
    quoted, cells = False, 0
    for column, letter in enumerate(text, start=1):
        if cells == cell:
            return column
        if letter == '"':
            quoted = not quoted
        elif letter == delimiter and not quoted:
            cells += 1
    return len(text.rstrip("\n")) + 1 if cells == cell else 1
