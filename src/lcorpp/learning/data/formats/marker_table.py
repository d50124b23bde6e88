"""Tables with a row for each moment and columns for each marker: motion capture by QTM, e.g. THÖR.

The first lines have a name and values each, e.g. FREQUENCY 100; a heading names the columns of each marker,
"Helmet_1 - 3 X", or of each body, "Helmet_1 Centroid_X", in millimetres. A person's position is the
body's, or that of its marker that is visible most often; a marker that is not visible is 0, empty or NaN.

Source: Rudenko and others, IEEE Robotics and Automation Letters 5, 2020; Schreiter and others, IJRR 2024.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError, ParseError
from lcorpp.files import open_text
from lcorpp.learning.data.csv_reader import CsvFile, RowBatch, detect_delimiter, parse_line
from lcorpp.learning.data.ingest import ReadOptions, assemble_tracks
from lcorpp.learning.data.measures import Measures
from lcorpp.learning.data.repairs import RepairLog
from lcorpp.learning.data.tracks import Track
from lcorpp.notebook import join_some
from lcorpp.values import Array

MAX_HEADER = 40
"""Maximum number of lines before the heading."""

PERSON = "helmet"
"""Beginning of the names of people, in lower case; where there are any, other bodies are not people."""

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
    others: the bodies that are not people.
    """

    columns: tuple[str, ...]
    bodies: dict[str, list[tuple[int, ...]]]
    delimiter: str
    header: int
    frequency: float | None
    others: tuple[str, ...]


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

    def open_table(repair_log: RepairLog) -> CsvFile:
        return CsvFile(
            path,
            ["time" if cell == clock else key for cell, key in enumerate(keys)],
            ("time", *(keys[cell] for cell in used)),
            (),
            repair_log,
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
    markers = _choose_markers(open_table(RepairLog(options.repair_log.requested)).batches(), table, keys)
    file = open_table(options.repair_log)
    batches = _melt(file.batches(options.progress), markers, keys)
    tracks = assemble_tracks(file, batches, options, empty, AXES, measures=measures)
    several = sum(len(own) > 1 for own in table.bodies.values())
    note = f"the position of {several} bodies is that of the marker that is visible most often"
    notes = [note] if several else []
    if table.others:
        notes.append(f"left out, as others are named {PERSON}: {join_some(table.others)}")
    return tracks, (*notes, *file.notes())


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
    people = {name: cells for name, cells in bodies.items() if name.lower().startswith(PERSON)} or bodies
    others = tuple(name for name in bodies if name not in people)
    return MarkerTable(tuple(name.lower() for name in names), people, delimiter, header, frequency, others)


def _choose_markers(
    batches: Iterator[RowBatch], table: MarkerTable, keys: Sequence[str]
) -> dict[str, tuple[int, ...]]:
    """Return body -> the columns of its marker that is visible in most rows."""
    if all(len(markers) == 1 for markers in table.bodies.values()):
        return {name: markers[0] for name, markers in table.bodies.items()}
    counts = {name: [0] * len(markers) for name, markers in table.bodies.items()}
    for batch in batches:
        for name, markers in table.bodies.items():
            for number, marker in enumerate(markers):
                counts[name][number] += len(_find_visible(batch, marker, keys)[1])
    return {name: markers[int(np.argmax(counts[name]))] for name, markers in table.bodies.items()}


def _melt(
    batches: Iterator[RowBatch], markers: Mapping[str, tuple[int, ...]], keys: Sequence[str]
) -> Iterator[RowBatch]:
    """Yield the rows of each body in which its marker is visible."""
    for batch in batches:
        for name, marker in markers.items():
            place, rows = _find_visible(batch, marker, keys)
            numbers = {"time": batch.numbers["time"], **dict(zip(AXES, place, strict=True))}
            numbers = {axis: values[rows] for axis, values in numbers.items()}
            yield RowBatch(batch.lines[rows], numbers, {"track": [name] * len(rows)})


def _find_visible(
    batch: RowBatch, marker: Sequence[int], keys: Sequence[str]
) -> tuple[Array, npt.NDArray[np.intp]]:
    """Return the positions (3, rows) of a marker, and the rows in which it is visible."""
    place = np.stack([batch.numbers[keys[cell]] for cell in marker])
    return place, np.flatnonzero(np.isfinite(place).all(axis=0) & place.any(axis=0))
