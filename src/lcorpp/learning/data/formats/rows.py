"""Read the rows of a layout as tracks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from lcorpp.errors import ParseError
from lcorpp.learning.data.csv_reader import CsvFile, RowBatch
from lcorpp.learning.data.formats.columns import LONG_COLUMNS, WORD_COLUMNS, note_unused_columns
from lcorpp.learning.data.formats.layouts import LONG, Layout
from lcorpp.learning.data.ingest import ReadOptions, assemble_tracks
from lcorpp.learning.data.measures import SCALE_HINT, Measures
from lcorpp.learning.data.tracks import Track


@dataclass(frozen=True)
class RowFile:
    """A file of rows whose layout is known.

    layout: with the columns of this file. header: number of lines before the first row.
    """

    path: Path
    layout: Layout
    delimiter: str
    header: int


def read_rows(file: RowFile, options: ReadOptions) -> tuple[list[Track], tuple[str, ...]]:
    """Read a file of rows; return its tracks, in metres, and notes about it.

    Only the requested rows and one batch of text are in memory.

    Raises:
        ParseError: the layout needs a scale or a frame rate that the caller does not give; a row or a track
            has a fault whose repair was not requested.
    """
    layout, names = file.layout, file.layout.columns
    measures, notes = _choose_measures(file, options)
    made = (*names, *layout.made)
    numbers = tuple(n for n in LONG_COLUMNS if n in made and n not in ("track", *WORD_COLUMNS))
    read = tuple(name for name in (*numbers, *layout.numbers) if name in names)
    words = tuple(name for name in WORD_COLUMNS if name in names)
    source = CsvFile(
        file.path,
        names,
        read,
        ("track", *words, *layout.words),
        options.repair_log,
        header=file.header,
        delimiter=file.delimiter,
        allows_dates=not layout.is_frames and options.measures.per_second is None,
    )
    expected = f"expected rows of {', '.join(names)}"
    message = "no rows after the heading" if file.header else "no rows"
    empty = ParseError(str(file.path), file.header + 1, 1, f"{message}; {expected}")
    left_out = Counter[str]()
    batches = source.batches(options.progress)
    if layout.convert is not None:
        batches = _convert(batches, layout, left_out)
    tracks = assemble_tracks(source, batches, options, empty, numbers[1:], words, measures)
    for reason, rows in left_out.items():
        if rows:
            notes.append(f"left out {rows} rows: {reason}")
    if layout is LONG or layout.name == LONG.name:
        notes = [*note_unused_columns(names), *notes]
    return tracks, (*notes, *source.notes())


def _convert(batches: Iterator[RowBatch], layout: Layout, left_out: Counter[str]) -> Iterator[RowBatch]:
    assert layout.convert is not None
    for batch in batches:
        yield layout.convert(batch, left_out)


def _choose_measures(file: RowFile, options: ReadOptions) -> tuple[Measures, list[str]]:
    """Return the units of a file, and notes about those that its format fixes.

    Raises:
        ParseError: one is neither given nor fixed.
    """
    layout, given = file.layout, options.measures
    length, per_second = layout.measures.length, layout.measures.per_second
    missing, notes = [], []
    if given.length is None and length is None:
        missing.append(f"positions are in pixels; expected their scale: --unit with {SCALE_HINT}")
    if given.per_second is None and per_second is None:
        rate = layout.suggestion or "--fps with frames per second, e.g. --fps 25"
        missing.append(f"times are frame numbers; expected their rate: {rate}")
    if missing:
        raise ParseError(str(file.path), file.header + 1, 1, f"{layout.name}: {'; '.join(missing)}")
    if given.per_second is None and layout.is_frames:
        notes.append(
            f"{layout.name}: times are frame numbers, read as {per_second:g} frames per second; --fps gives"
            " another rate"
        )
    return Measures(given.length or length, given.per_second or per_second), notes
