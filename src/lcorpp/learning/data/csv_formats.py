"""The plain long CSV: a line that names the columns, then one row a person and time, in metres.

track, time (s), x and y (m) are needed; z (m), velocity (m/s), heading and facing (rad), label and group may
be there. Columns of other names are not used.
"""

from __future__ import annotations

import csv
from pathlib import Path

from lcorpp.errors import FileError, ParseError, expected_one_of
from lcorpp.files import open_text
from lcorpp.learning.data.assembly import TrackAssembler
from lcorpp.learning.data.csv_reader import CsvFile, column_of
from lcorpp.learning.data.ingest import ReadOptions, assemble_tracks
from lcorpp.learning.data.tracks import COLUMNS, Track

NEEDED = ("track", "time", "x", "y")
WORDS = ("label", "group")
NAMES = dict.fromkeys((*NEEDED, *COLUMNS, *WORDS))
"""Every column that has a meaning, in the order in which they are written."""


def read_long_csv(path: Path, options: ReadOptions) -> tuple[list[Track], tuple[str, ...]]:
    """Read a file of this form.

    Returns:
        The tracks, in metres, and notes on them.

    Raises:
        FileError: the file cannot be read.
        ParseError: the heading, a row or a track is wrong, and its repair was not asked for.
    """
    names = read_header(path)
    cells = {name: cell for cell, name in enumerate(names) if name in NAMES}
    words = tuple(name for name in WORDS if name in cells)
    numbers = tuple(name for name in NAMES if name in cells and name not in ("track", *WORDS))
    file = CsvFile(path, cells, len(names), numbers, header=1)
    assembler = TrackAssembler(numbers[1:], words)
    tracks = assemble_tracks(file, file.batches(options.repair_log, options.progress), assembler, options)
    if not tracks and options.only is None and not options.repair_log.repairs:
        raise ParseError(str(path), 2, 1, f"no rows after the heading; expected {', '.join(names)}")
    return tracks, (*note_unused_columns(names), *file.notes(options.repair_log))


def note_unused_columns(names: list[str]) -> tuple[str, ...]:
    """A note on columns without a meaning here, if there are any."""
    others = [name for name in names if name not in NAMES]
    return (f"columns that are not used: {', '.join(others)}",) if others else ()


def read_header(path: Path) -> list[str]:
    """The names of the columns, in small letters.

    Raises:
        FileError: the file cannot be read.
        ParseError: a needed column is missing, or a name is there twice.
    """
    with open_text(path) as file:
        try:
            text = file.readline()
        except UnicodeDecodeError:
            raise FileError(f"{path}:1: not UTF-8 text") from None
    try:
        names = [name.strip().lower() for name in next(csv.reader([text], strict=True), [])]
    except csv.Error as error:
        raise ParseError(str(path), 1, 1, f"not a row of CSV ({error})", text) from None
    for name in NEEDED:
        if name not in names:
            message = f"no column {name!r}; expected {', '.join(NEEDED)} among {', '.join(NAMES)}"
            raise ParseError(str(path), 1, 1, message, text)
    for cell, name in enumerate(names):
        if name in names[:cell]:
            message = f"column {name!r} for the second time; {expected_one_of(list(NAMES))}, each once"
            raise ParseError(str(path), 1, column_of(text, cell), message, text)
    return names
