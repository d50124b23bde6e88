"""Two formats of CSV: the long format, and the tracking data of the ATC shopping centre.

Long format: a heading, then one row per person and time, in metres. track, time (s), x and y (m) are
required; z (m), velocity (m/s), heading and facing (rad), label and group are optional; others are ignored.

ATC: no heading; time (s since 1970), id of the person, x, y and z (mm; z is the height of the head), velocity
(mm/s), angle of motion (rad), facing angle (rad).

Source: Brscic, Kanda, Ikeda and Miyashita, IEEE Transactions on Human-Machine Systems 43, 2013.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from lcorpp.errors import ParseError
from lcorpp.files import locate_bad_byte, open_text
from lcorpp.learning.data.csv_reader import CsvFile, column_of, detect_delimiter, parse_line
from lcorpp.learning.data.ingest import ReadOptions, assemble_tracks
from lcorpp.learning.data.tracks import COLUMNS, Track

REQUIRED = ("track", "time", "x", "y")
WORD_COLUMNS = ("label", "group")
LONG_COLUMNS = dict.fromkeys((*REQUIRED, *COLUMNS, *WORD_COLUMNS))
"""All columns of the long format, in the order in which they are written."""

ATC_COLUMNS = ("time", "track", "x", "y", "z", "velocity", "heading", "facing")
MILLIMETRE = 1e-3


def read_long_csv(path: Path, options: ReadOptions) -> tuple[list[Track], tuple[str, ...]]:
    """Read a file in the long format; return its tracks, in metres, and notes about it."""
    names, delimiter = read_header(path)
    numbers, words = find_columns(names)
    file = CsvFile(path, names, numbers, ("track", *words), options.repair_log, header=1, delimiter=delimiter)
    empty = ParseError(str(path), 2, 1, f"no rows after the heading; expected {', '.join(names)}")
    tracks = assemble_tracks(file, file.batches(options.progress), options, empty, numbers[1:], words)
    return tracks, (*note_unused_columns(names), *file.notes())


def read_atc(path: Path, options: ReadOptions) -> tuple[list[Track], tuple[str, ...]]:
    """Read ATC tracking data; return the tracks, in metres and metres per second, and notes about the file.

    Only the requested rows and one batch of text are in memory.
    """
    numbers = tuple(name for name in ATC_COLUMNS if name != "track")
    delimiter = detect_delimiter(read_first_line(path))
    file = CsvFile(path, ATC_COLUMNS, numbers, ("track",), options.repair_log, delimiter=delimiter)
    scale = dict.fromkeys(("x", "y", "z", "velocity"), MILLIMETRE)
    empty = ParseError(str(path), 1, 1, f"the file is empty; expected rows of {', '.join(ATC_COLUMNS)}")
    tracks = assemble_tracks(file, file.batches(options.progress), options, empty, numbers[1:], scale=scale)
    return tracks, file.notes()


def find_columns(names: list[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the columns of numbers, time first, and those of words besides "track", among the given ones."""
    numbers = tuple(name for name in LONG_COLUMNS if name in names and name not in ("track", *WORD_COLUMNS))
    return numbers, tuple(name for name in WORD_COLUMNS if name in names)


def note_unused_columns(names: list[str]) -> tuple[str, ...]:
    """Return a note that names the ignored columns, if there are any."""
    others = [name for name in names if name not in LONG_COLUMNS]
    return (f"columns that are not used: {', '.join(others)}",) if others else ()


def describe_missing_column(name: str, names: Collection[str]) -> str:
    """Return the message for a column that is not among the names: of tracks, or of a table of features."""
    label = "" if {"track", "time", "label"} & set(names) else ", and no column 'label'"
    return (
        f"no column {name!r}{label}; expected {', '.join(REQUIRED)} among {', '.join(LONG_COLUMNS)};"
        " or, for a table of features, a column 'label' and none named track or time"
    )


def read_header(path: Path, required: tuple[str, ...] = REQUIRED) -> tuple[list[str], str]:
    """Read the names of the columns, in lower case, and the delimiter between them.

    Raises:
        FileError: the file cannot be read.
        ParseError: a required column is missing, or a name is repeated.
    """
    text = read_first_line(path)
    delimiter = detect_delimiter(text)
    names = [name.lower() for name in parse_line(str(path), 1, text, delimiter)]
    for name in required:
        if name not in names:
            message = describe_missing_column(name, names)
            if len(names) == 1 and " " in names[0]:
                message = f"one column, {names[0]!r}; expected columns that ',', ';', '|' or a tab separates"
            raise ParseError(str(path), 1, 1, message, text)
    for cell, name in enumerate(names):
        if name in names[:cell]:
            message = f"column {name!r} for the second time; expected every name once"
            raise ParseError(str(path), 1, column_of(text, cell, delimiter), message, text)
    return names, delimiter


def read_first_line(path: Path) -> str:
    """Read the first line of a text file.

    Raises:
        FileError: the file cannot be read.
    """
    with open_text(path) as file:
        try:
            return file.readline()
        except UnicodeDecodeError:
            raise locate_bad_byte(path) from None
