"""The first rows of a text file without a heading, as numbers, by which its format is recognised."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lcorpp.learning.data.csv_reader import detect_delimiter, is_number, parse_line
from lcorpp.learning.data.formats.columns import COMMENT
from lcorpp.values import Array

MAX_ROWS = 400
"""Maximum number of rows in a sample."""

MAX_SIZE = 1e100
"""Maximum size of a number: differences and squares of those of a sample are finite."""


@dataclass(frozen=True, eq=False)
class Sample:
    """Rows of equal width.

    table: (rows, columns) numbers, NaN for words and for numbers beyond `MAX_SIZE`. line, text: the first
        row. delimiter: between its cells.
    per_second: units of time per second, if the caller gives them.
    frame_rate: frames per second, if a comment before the first row states them.
    """

    table: Array
    line: int
    text: str
    delimiter: str
    per_second: float | None = None
    frame_rate: float | None = None

    @property
    def width(self) -> int:
        """Number of columns."""
        return int(self.table.shape[1])

    def has_whole(self, *columns: int) -> bool:
        """Whether all numbers of some columns are whole."""
        return bool((self.table[:, list(columns)] % 1 == 0).all())

    def persons(self, track: int, time: int) -> Iterator[Array]:
        """Yield the rows (samples, columns) of each id that has several, in the order of time."""
        for name in np.unique(self.table[:, track]):
            rows = self.table[self.table[:, track] == name]
            if len(rows) > 1:
                yield rows[np.argsort(rows[:, time], kind="stable")]

    def steps(self, track: int, time: int, x: int, y: int) -> tuple[Array, Array]:
        """Return times and distances (2 x steps) from each row of an id to the next, if time passes."""
        parts = [np.diff(rows[:, [time, x, y]], axis=0) for rows in self.persons(track, time)]
        change = np.concatenate([np.zeros((0, 3)), *parts])
        change = change[change[:, 0] > 0]
        return change[:, 0], np.hypot(change[:, 1], change[:, 2])

    def stated_rates(self, track: int, time: int, x: int, y: int, speed: Array) -> Array:
        """(steps,) how many units of time a second has, for stated speeds (rows,) to agree with positions."""
        rates = []
        for name in np.unique(self.table[:, track]):
            own = self.table[:, track] == name
            order = np.argsort(self.table[own, time], kind="stable")
            rows, stated = self.table[own][order], speed[own][order]
            dt, distance = np.diff(rows[:, time]), np.hypot(np.diff(rows[:, x]), np.diff(rows[:, y]))
            mean = (stated[1:] + stated[:-1]) / 2
            moved = (dt > 0) & (distance > 0) & (mean > 0)
            rates.append(mean[moved] * dt[moved] / distance[moved])
        return np.concatenate([np.zeros(0), *rates])


def read_sample(file: str, start: str, per_second: float | None) -> Sample | None:
    """Return the sample of a file whose first row consists of numbers, perhaps with one last word.

    Args:
        file: its name. start: the beginning of its text.

    Raises:
        ParseError: the first row is not a row of CSV.
    """
    lines = start.splitlines()
    if not start.endswith("\n") and len(lines) > 1:
        lines.pop()  # it may be cut
    rate, rows, first, delimiter = None, list[list[float]](), 0, ","
    for number, text in enumerate(lines, start=1):
        if not text.strip():
            continue
        if text.startswith(COMMENT) and not rows:
            found = re.search(r"frame ?rate\D*(\d+(\.\d+)?)", text, re.IGNORECASE)
            rate = float(found[1]) if found else rate
            continue
        if not rows:
            first, delimiter = number, detect_delimiter(text)
        cells = parse_line(file, number, text, delimiter) if not rows else _split(text, delimiter)
        if not rows and not all(map(is_number, cells[:-1] or cells)):
            return None
        if not rows and len(cells) < 2:
            return None
        if not rows or len(cells) == len(rows[0]):
            rows.append([_read_cell(cell) for cell in cells])
        if len(rows) == MAX_ROWS:
            break
    if not rows:
        return None
    return Sample(np.array(rows), first, lines[first - 1], delimiter, per_second, rate)


def _read_cell(cell: str) -> float:
    number = float(cell) if is_number(cell) else np.nan
    return number if abs(number) <= MAX_SIZE else np.nan


def _split(text: str, delimiter: str) -> list[str]:
    return [cell.strip() for cell in (text.split() if delimiter == " " else text.split(delimiter))]
