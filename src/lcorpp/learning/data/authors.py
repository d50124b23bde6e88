"""Read the 123 trajectories that the paper's authors released."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.errors import ParseError, expected_one_of
from lcorpp.files import read_text
from lcorpp.learning.data.csv_reader import column_of
from lcorpp.values import Array, Dataset

POINTS = 304
"""Time points of a track; a row has an id before them and a label after them."""
MILLIMETRE = 1e-3

NOTE = (
    "This data leaks its label: the tracks of interested people end in front of the robot, those of others"
    " elsewhere in the mall, so that the end position alone predicts 99 % of the labels; tracks of different"
    " length were stretched to 304 points, and the resampling artefacts alone reach AUC .89. Only motion"
    " relative to the first point is a fair input; its realistic upper limit is about AUC .79 to .84, and a"
    " better score has used the leak."
)


@dataclass(frozen=True)
class _Row:
    """One line of a file. positions: (304,) mm."""

    file: Path
    line: int
    text: str
    id: str
    positions: Array
    label: str

    def fail(self, cell: int, message: str) -> NoReturn:
        """Raise for a cell, counted from 0."""
        raise ParseError(str(self.file), self.line, column_of(self.text, cell), message, self.text)


@check_arguments
def read_authors(folder: str | Path, *, labels: Mapping[str, str]) -> Dataset:
    r"""Read `interposx.csv` and `interposy.csv` of the authors' repository.

    Args:
        folder: contains the two files. A row is an id, 304 positions in mm (x in one file, y in the other)
            and a label; rows of the same number belong together.
        labels: label in the files -> class, e.g. {"1": "interested", "0": "not_interested"}.

    Returns:
        Trajectories (cases, 2, 304) in metres, grouped by id, with a note about the leak.

    Raises:
        FileError: a file is missing or cannot be read.
        ParseError: a file is empty, a row has another number of columns, a position is not a finite
            number, a label is not in `labels`, or the rows of the files do not belong together.

    Source: bu-air-lab/LCORPP; Kato, Kanda and Ishiguro, HRI 2015.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.learning import read_authors
        >>> for file in ("interposx.csv", "interposy.csv"):  # a row: id, 304 positions in mm, label
        ...     _ = Path(file).write_text("1," + 304 * "2500," + "1\n")
        >>> data = read_authors(".", labels={"1": "interested", "0": "not_interested"})
        >>> data.labels, data.trajectories[0, :, 0].tolist()
        (('interested',), [2.5, 2.5])
    """
    x_rows, y_rows = (_read(Path(folder) / f"interpos{axis}.csv", labels) for axis in "xy")
    for x, y in zip(x_rows, y_rows, strict=False):
        there = f"as in line {x.line} of {x.file.name}"
        if x.id != y.id:
            y.fail(0, f"id {y.id!r}; expected {x.id!r} {there}")
        if x.label != y.label:
            y.fail(POINTS + 1, f"label {y.label!r}; expected {x.label!r} {there}")
    if len(x_rows) != len(y_rows):
        short, long = sorted((x_rows, y_rows), key=len)
        short[-1].fail(0, f"the file ends after {len(short)} rows; expected {len(long)} as in the other file")
    tracks = np.stack([[row.positions for row in x_rows], [row.positions for row in y_rows]], axis=1)
    return Dataset(
        tracks * MILLIMETRE,
        tuple(labels[row.label] for row in x_rows),
        tuple(row.id for row in x_rows),
        source="trajectories released with LCORPP (AAAI 2020), from the mall of Kato et al. (HRI 2015)",
        notes=(NOTE,),
    )


def _read(path: Path, labels: Mapping[str, str]) -> list[_Row]:
    lines = read_text(path).splitlines()
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise ParseError(str(path), 1, 1, f"the file is empty; expected rows of {POINTS + 2} columns")
    return [_parse_row(path, number, text, labels) for number, text in enumerate(lines, start=1)]


def _parse_row(path: Path, line: int, text: str, labels: Mapping[str, str]) -> _Row:
    cells = text.split(",")
    if len(cells) != POINTS + 2:
        message = f"{len(cells)} columns; expected {POINTS + 2}: id, {POINTS} positions in mm, label"
        raise ParseError(str(path), line, 1, message, text)
    row = _Row(path, line, text, cells[0].strip(), np.empty(POINTS), cells[-1].strip())
    if not row.id:
        row.fail(0, "no id; expected the number of a person")
    for index, cell in enumerate(cells[1:-1]):
        try:
            row.positions[index] = float(cell)
        except ValueError:
            row.fail(index + 1, f"{cell!r} is not a number; expected a position in mm")
        if not np.isfinite(row.positions[index]):
            row.fail(index + 1, f"{cell!r} is not finite; expected a position in mm")
    if row.label not in labels:
        row.fail(POINTS + 1, f"unknown label {row.label!r}; {expected_one_of(list(labels))}")
    return row
