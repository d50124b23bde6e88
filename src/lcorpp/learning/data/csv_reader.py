"""CSV text as columns of numbers, some ten thousand lines at a time, every mistake with its line and column.

A batch of lines is split and converted at once; only a batch that fails is gone through line by line.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lcorpp.errors import FileError, LcorppError, ParseError
from lcorpp.files import open_text
from lcorpp.learning.data.repairs import RepairLog
from lcorpp.values import Array

LINES = 50_000
"""Lines of a batch: some megabytes of text."""

LONGEST = 40
"""Letters of a word from which on a batch is gone through line by line."""

Progress = Callable[[int, int], None]
"""Told (bytes read, bytes in all)."""

Lines = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class RowBatch:
    """Rows in columns.

    lines: (rows,) their numbers in the file, from 1. numbers: name -> (rows,), NaN where a cell is empty.
    texts: name -> (rows,) words, without the blanks around them.
    """

    lines: Lines
    numbers: Mapping[str, Array]
    texts: Mapping[str, list[str]]


class CsvFile:
    """A CSV file of known columns.

    Args:
        path: the file, UTF-8.
        cells: name -> which cell of a row it is, counted from 0. width: cells of a row.
        numbers: those of the names that are numbers; the others are words.
        header: lines before the first row.
    """

    def __init__(
        self, path: Path, cells: Mapping[str, int], width: int, numbers: tuple[str, ...], *, header: int = 0
    ) -> None:
        self.path, self.file = path, str(path)
        self._cells, self._width, self._numbers, self._header = dict(cells), width, numbers, header
        self._texts = tuple(name for name in cells if name not in numbers)
        name_of = {cell: name for name, cell in cells.items()}
        self._kinds = np.dtype(
            [
                (name_of.get(cell, f"unused {cell}"), "f8" if name_of.get(cell) in numbers else f"U{LONGEST}")
                for cell in range(width)
            ]
        )
        self.ended = True

    def notes(self, repair_log: RepairLog) -> tuple[str, ...]:
        """What is to be known of a file that was read."""
        if self.ended or any(repair.reason == "cut" for repair in repair_log.repairs):
            return ()
        return ("the last line has no line end: its last number may have been cut",)

    def error_at(self, line: int, field: str, message: str) -> LcorppError:
        """A ParseError at a field; the line is read again to show it."""
        with open_text(self.path) as file:
            text = next(islice(file, line - 1, None), "")
        return ParseError(self.file, line, column_of(text, self._cells.get(field, 0)), message, text)

    def batches(self, repair_log: RepairLog, progress: Progress | None = None) -> Iterator[RowBatch]:
        """All rows, blank lines aside.

        Raises:
            FileError: the file cannot be read, or is not UTF-8.
            ParseError: a row cannot be read, unless `repair_log` allows the repairs `rows` and `cut`.
        """
        size, read, number = self.path.stat().st_size, 0, 1
        with open_text(self.path) as file:
            while lines := self._some(file, number):
                self.ended = lines[-1].endswith("\n")
                first = min(max(0, self._header + 1 - number), len(lines))
                yield self._batch(lines[first:], number + first, repair_log)
                number += len(lines)
                read += sum(map(len, lines))
                if progress is not None:
                    progress(min(read, size), size)

    def _some(self, file: Iterator[str], number: int) -> list[str]:
        try:
            return list(islice(file, LINES))
        except UnicodeDecodeError as error:
            raise FileError(
                f"{self.file}: not UTF-8 text after line {number} (byte {error.object[error.start]:#04x})"
            ) from None
        except OSError as error:
            raise FileError(f"{self.file}: cannot be read: {error.strerror or error}") from None

    def _batch(self, lines: list[str], number: int, repair_log: RepairLog) -> RowBatch:
        batch = self._at_once(lines, number)
        if batch is not None:
            return batch
        kept, numbers = [], []
        for line, text in enumerate(lines, start=number):
            row = self._row(line, text, repair_log)
            if row is not None:
                kept.append(row)
                numbers.append(line)
        columns = list(zip(*kept, strict=True)) or [()] * self._width
        return RowBatch(
            np.array(numbers, dtype=np.int64),
            {name: np.array([float(c) for c in columns[self._cells[name]]]) for name in self._numbers},
            {name: [word.strip() for word in columns[self._cells[name]]] for name in self._texts},
        )

    def _at_once(self, lines: list[str], number: int) -> RowBatch | None:
        """All lines converted by numpy, a tenth of the time; None where that fails."""
        if not lines or not lines[0].strip():
            return None
        try:
            table = np.loadtxt(lines, dtype=self._kinds, delimiter=",", comments=None, quotechar='"', ndmin=1)
        except ValueError:
            return None
        texts = {name: table[name].tolist() for name in self._texts}
        if len(table) != len(lines) or any(max(map(len, words)) >= LONGEST for words in texts.values()):
            return None
        return RowBatch(
            np.arange(number, number + len(lines), dtype=np.int64),
            {name: np.ascontiguousarray(table[name]) for name in self._numbers},
            {name: [word.strip() for word in words] for name, words in texts.items()},
        )

    def _row(self, line: int, text: str, repair_log: RepairLog) -> list[str] | None:
        """The cells of a line, empty numbers as NaN; None if it is blank or left out."""
        if not text.strip():
            return None
        cut, left_out = not text.endswith("\n"), "left out"
        reason, aside = ("cut", "; the file ends in the middle of its last line") if cut else ("rows", "")
        try:
            (row,) = csv.reader([text], strict=True)
        except (ValueError, csv.Error) as error:
            repair_log.repair_or_raise(reason, self, line, f"not a row of CSV ({error}){aside}", left_out)
            return None
        if len(row) != self._width:
            names = ", ".join(sorted(self._cells, key=self._cells.__getitem__))
            message = f"{len(row)} columns; expected {self._width}, with {names}{aside}"
            repair_log.repair_or_raise(reason, self, line, message, left_out)
            return None
        for name in self._numbers:
            cell = row[self._cells[name]]
            if not cell.strip():
                row[self._cells[name]] = "nan"
            elif not _is_number(cell):
                message = f"{cell!r} is not a number; expected the {name}{aside}"
                repair_log.repair_or_raise(reason, self, line, message, left_out, field=name)
                return None
        return row


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell and cell.isascii()


def column_of(text: str, cell: int) -> int:
    """The column, counted from 1, at which a cell (counted from 0) of a line begins."""
    quoted, commas = False, 0
    for column, letter in enumerate(text, start=1):
        if commas == cell:
            return column
        if letter == '"':
            quoted = not quoted
        elif letter == "," and not quoted:
            commas += 1
    return len(text.rstrip("\n")) + 1 if commas == cell else 1
