"""Detect the format of a file by its content."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

from lcorpp.errors import DataError, FileError, ParseError
from lcorpp.files import PARQUET_SUFFIXES, locate_bad_byte, open_text
from lcorpp.learning.data.csv_reader import is_number, parse_line
from lcorpp.learning.data.dates import parse_date
from lcorpp.learning.data.formats.columns import (
    REQUIRED,
    Heading,
    describe_missing_column,
    find_heading,
    format_guess,
    guess_columns,
    read_header,
    rename_columns,
)
from lcorpp.learning.data.formats.json_tracks import starts_json
from lcorpp.learning.data.formats.layouts import LONG, Layout, recognise_heading, recognise_rows
from lcorpp.learning.data.formats.marker_table import starts_marker_table
from lcorpp.learning.data.formats.parquet import ParquetFile
from lcorpp.learning.data.formats.rows import RowFile
from lcorpp.learning.data.formats.sample import Sample, read_sample
from lcorpp.learning.data.formats.table import has_table_columns
from lcorpp.learning.data.formats.time_series import starts_time_series
from lcorpp.learning.data.measures import UNKNOWN, Measures
from lcorpp.learning.data.npz import SUFFIX
from lcorpp.learning.data.repairs import RepairLog
from lcorpp.learning.store import is_store

Kind = Literal["authors", "npz", "store", "parquet", "rows", "table", "json", "markers", "series"]

DATASETS = ("authors", "npz", "store", "table", "series")
"""Kinds of data sets: tracks of one interval, time series, or tables of features."""

MAX_HEADING = 1_000_000
"""Maximum length of a heading in letters."""


@dataclass(frozen=True)
class FileFormat:
    """The format of a file; rows: its layout, if it consists of rows."""

    kind: Kind
    rows: RowFile | None = None

    @property
    def name(self) -> str:
        """The name of the format, for people to read."""
        return self.kind if self.rows is None else self.rows.layout.name


def detect_format(
    path: str | Path, columns: Mapping[str, str] | None = None, measures: Measures = UNKNOWN
) -> FileFormat:
    """Detect the format of a file or a folder.

    Args:
        columns: the columns that the caller names, as in `rename_columns`. measures: the units it gives.

    Raises:
        FileError: the file is missing or unreadable, or is not text.
        ParseError: the first rows are of no known format.
        DataError: a column that the caller names is not there.
    """
    file = Path(path)
    if os.path.isdir(file):  # unlike a Path, without an error for a name that is too long
        return FileFormat("authors")
    suffix = file.suffix.lower()
    if suffix == SUFFIX:
        return FileFormat("npz")
    if is_store(file):
        return FileFormat("store")
    if suffix in PARQUET_SUFFIXES:
        names = ParquetFile(file, RepairLog(), columns).names
        return FileFormat("table" if has_table_columns(names) else "parquet")
    start = _read_start(file)
    if starts_json(start):
        return FileFormat("json")
    if starts_time_series(start):
        return FileFormat("series")
    if starts_marker_table(start):
        return FileFormat("markers")
    return _detect_rows(file, start, columns or {}, measures)


def _read_start(file: Path) -> str:
    with open_text(file) as opened:
        try:
            start = opened.read(20_000)
            if "\n" not in start:  # a heading of many features
                start += opened.readline(MAX_HEADING)
        except UnicodeDecodeError as error:
            if b"\0" not in error.object:
                raise locate_bad_byte(file) from None
            start = "\0"
    if "\0" in start:
        raise FileError(
            f"{file}: not text; expected CSV (UTF-8, or UTF-16 with a byte order mark), .npz, .parquet or a"
            " folder of the authors' files"
        )
    if not start.strip():
        expected = f"expected a line that names {', '.join(REQUIRED)}"
        raise ParseError(str(file), 1, 1, f"the file is empty; {expected}")
    return start


def _detect_rows(file: Path, start: str, columns: Mapping[str, str], measures: Measures) -> FileFormat:
    heading = find_heading(file)
    sample = None if heading.is_comment else read_sample(str(file), start, measures.per_second)
    if sample is not None:
        layout = _find_layout(file, sample, columns)
        return FileFormat("rows", RowFile(file, layout, sample.delimiter, sample.line - 1))
    delimiter = heading.delimiter
    if columns and all(
        name.isdecimal() for name in columns.values()
    ):  # ids are words, and there is no heading
        width = len(parse_line(str(file), heading.line, heading.text, delimiter))
        layout = _number_columns(file, width, columns)
        return FileFormat("rows", RowFile(file, layout, delimiter, heading.line - 1))
    names, heading = read_header(file, (), columns)
    known = None if columns else recognise_heading(names)
    if known is not None:
        return FileFormat("rows", RowFile(file, known, delimiter, heading.line))
    if has_table_columns(names):
        if not columns and _repeats_ids(file, start, names, heading):
            options = format_guess(guess_columns(names))
            message = f"rows of tracks with other names of columns; expected {options}"
            raise ParseError(str(file), heading.line, 1, message, heading.text)
        return FileFormat("table")
    for name in REQUIRED:
        if name not in names:
            message = describe_missing_column(name, names)
            raise ParseError(str(file), heading.line, 1, message, heading.text)
    return FileFormat("rows", RowFile(file, replace(LONG, columns=tuple(names)), delimiter, heading.line))


def _find_layout(file: Path, sample: Sample, columns: Mapping[str, str]) -> Layout:
    """Return the layout of rows without a heading; the caller's columns are numbers from 1."""
    if columns:
        return _number_columns(file, sample.width, columns)
    layout, reasons = recognise_rows(sample)
    if layout is not None:
        return layout
    hint = " (the authors' files are read as a folder)" if file.stem.startswith("interpos") else ""
    message = (
        f"{sample.width} columns of numbers; expected a line that names {', '.join(REQUIRED)}, the number"
        " of each of these columns, e.g. --column track=1 --column time=2 --column x=3 --column y=4, or a"
        f" format of docs/guides/data/formats.md{hint}"
    )
    if reasons:
        message += f"; it is not {'; nor '.join(reasons)}"
    raise ParseError(str(file), sample.line, 1, message, sample.text)


def _number_columns(file: Path, width: int, columns: Mapping[str, str]) -> Layout:
    """Return the layout of a file without a heading whose columns the caller names by their numbers."""
    names = rename_columns([str(number + 1) for number in range(width)], columns)
    missing = [name for name in REQUIRED if name not in names]
    if missing:
        expected = " ".join(f"--column {name}=NUMBER" for name in missing)
        raise DataError(f"{file}: no heading; expected the number of each column, from 1: {expected}")
    return replace(LONG, columns=tuple(names))


def _repeats_ids(file: Path, start: str, names: Sequence[str], heading: Heading) -> bool:
    """Whether a table has columns of ids, times and positions, and an id has several rows of rising time."""
    guessed = guess_columns(names)
    if not set(REQUIRED) <= set(guessed):
        return False
    track, time = (names.index(guessed[name]) for name in ("track", "time"))
    times: dict[str, list[float]] = {}
    for number, text in enumerate(start.splitlines()[heading.line : -1], start=heading.line + 1):
        cells = parse_line(str(file), number, text, heading.delimiter)
        if len(cells) != len(names):
            continue
        if is_number(cells[time]):
            times.setdefault(cells[track], []).append(float(cells[time]))
        elif (date := parse_date(cells[time])) is not None:
            times.setdefault(cells[track], []).append(date[1])
    return any(len(own) > 2 and all(a < b for a, b in pairwise(own)) for own in times.values())
