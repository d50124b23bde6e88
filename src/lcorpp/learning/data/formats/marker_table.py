"""Tables with a row for each moment and columns for each marker: motion capture by QTM, e.g. THÖR.

The first lines have a name and values each, e.g. FREQUENCY 100; a heading names the columns of each marker,
"Helmet_1 - 3 X", or of each body, "Helmet_1 Centroid_X", in millimetres. A person's position is the
body's, or the mean of its visible markers; a marker that is not visible is 0, empty or NaN.

Source: Rudenko and others, IEEE Robotics and Automation Letters 5, 2020; Schreiter and others, IJRR 2024.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lcorpp.errors import DataError, ParseError
from lcorpp.files import open_text
from lcorpp.learning.data.csv_reader import CsvFile, RowBatch, detect_delimiter, parse_line
from lcorpp.learning.data.ingest import ReadOptions, assemble_tracks
from lcorpp.learning.data.measures import Measures
from lcorpp.learning.data.tracks import Track

MAX_HEADER = 40
"""Maximum number of lines before the heading."""

AXES = ("x", "y", "z")

_MARKER = re.compile(r"(.+?)(?: - \w+)? (?:Centroid_)?([XYZ])")
"""The name of a column of positions: the body, perhaps a marker, and the axis."""


def starts_marker_table(start: str) -> bool:
    """Whether a text begins like an export of QTM, or of THÖR-MAGNI."""
    head = "\n".join(start.splitlines()[:MAX_HEADER])
    names = re.findall(r"^\W*([A-Z_]{5,})\b", head, re.MULTILINE)
    return bool({"MARKER_NAMES", "BODY_NAMES"} & set(names)) and bool(
        {"NO_OF_FRAMES", "N_FRAMES_QTM", "FREQUENCY", "FILE_ID"} & set(names)
    )


@dataclass(frozen=True)
class MarkerTable:
    """The heading of a table. columns: name of each. bodies: body -> indices (markers, 3) of its positions.

    header: number of lines before the first row. frequency: rows per second, if stated.
    """

    columns: tuple[str, ...]
    bodies: dict[str, list[tuple[int, ...]]]
    delimiter: str
    header: int
    frequency: float | None


def read_marker_table(path: Path, options: ReadOptions) -> tuple[list[Track], tuple[str, ...]]:
    """Read a table of markers; return the tracks of its bodies, in metres, and notes about it.

    Raises:
        ParseError: the heading is missing or has no positions, or a row or a track has a fault.
    """
    if options.columns:
        raise DataError(f"{path}: a table of markers has several columns of each axis; expected no --column")
    table = _read_heading(path)
    keys = [f"cell {cell}" for cell in range(len(table.columns))]
    has_time = "time" in table.columns
    clock = table.columns.index("time" if has_time else "frame")
    used = sorted({cell for markers in table.bodies.values() for marker in markers for cell in marker})
    file = CsvFile(
        path,
        ["time" if cell == clock else key for cell, key in enumerate(keys)],
        ("time", *(keys[cell] for cell in used)),
        (),
        options.repair_log,
        header=table.header,
        delimiter=table.delimiter,
    )
    if not has_time and table.frequency is None and options.measures.per_second is None:
        raise ParseError(
            str(path),
            table.header,
            1,
            "no column Time, and no FREQUENCY; expected --fps with rows per second",
        )
    measures = Measures(1e-3, 1.0 if has_time else table.frequency)
    empty = ParseError(str(path), table.header + 1, 1, "no rows after the heading")
    batches = _melt(file.batches(options.progress), table, keys)
    tracks = assemble_tracks(file, batches, options, empty, AXES, measures=measures)
    note = "each position is the mean of the visible markers of a body, in millimetres"
    return tracks, (note, *file.notes())


def _read_heading(path: Path) -> MarkerTable:
    frequency, names, header = None, list[str](), 0
    with open_text(path) as file:
        for number, text in enumerate(file, start=1):
            delimiter = detect_delimiter(text)
            cells = parse_line(str(path), number, text, delimiter)
            if cells and cells[0].upper() == "FREQUENCY" and len(cells) > 1:
                frequency = float(cells[1]) if re.fullmatch(r"\d+(\.\d+)?", cells[1]) else None
            if {"frame", "time"} & {cell.lower() for cell in cells}:
                names, header = cells, number
                break
            if number > MAX_HEADER:
                break
    if not names:
        message = "no heading of the columns; expected Frame, Time and the markers, e.g. 'Helmet_1 - 1 X'"
        raise ParseError(str(path), 1, 1, f"a table of markers (QTM): {message}")
    places = {name: place for place, name in enumerate(names)}
    markers: dict[str, dict[str, list[tuple[int, ...]]]] = {}
    for name in names:
        found = _MARKER.fullmatch(name)
        if found is None or found[2] != "X":
            continue
        axes = [name[:-1] + axis for axis in "XYZ"]
        if all(axis in places for axis in axes):
            kind = "body" if "Centroid" in name or " - " not in name else "marker"
            markers.setdefault(found[1], {}).setdefault(kind, []).append(tuple(places[axis] for axis in axes))
    if not markers:
        message = f"no columns of positions; expected e.g. 'Helmet_1 - 1 X', not {', '.join(names[:6])}"
        raise ParseError(str(path), header, 1, f"a table of markers (QTM): {message}")
    bodies = {name: kinds.get("body") or kinds["marker"] for name, kinds in markers.items()}
    return MarkerTable(tuple(name.lower() for name in names), bodies, delimiter, header, frequency)


def _melt(batches: Iterator[RowBatch], table: MarkerTable, keys: Sequence[str]) -> Iterator[RowBatch]:
    """Yield a row for each body that is visible."""
    for batch in batches:
        for name, markers in table.bodies.items():
            places = np.array([[batch.numbers[keys[cell]] for cell in marker] for marker in markers])
            places[np.broadcast_to((places == 0).all(axis=1, keepdims=True), places.shape)] = np.nan
            is_known = np.isfinite(places).all(axis=1)  # (markers, rows)
            rows = np.flatnonzero(is_known.any(axis=0))
            weights = is_known / np.maximum(is_known.sum(axis=0), 1)
            mean = np.einsum("mr,mar->ar", weights, np.nan_to_num(places))[:, rows]
            numbers = {"time": batch.numbers["time"][rows], **dict(zip(AXES, mean, strict=True))}
            yield RowBatch(batch.lines[rows], numbers, {"track": [name] * len(rows)})
