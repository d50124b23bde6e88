"""Names of columns: those of the long format, and the names that other files use for them.

Long format: a heading, then one row per person and time, in metres. track, time (s), x and y (m) are
required; z (m), velocity (m/s), heading, facing, tilt, gaze_angle and robot_angle (rad), face_distance (m),
label and group are optional; others are ignored.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from lcorpp.errors import DataError, ParseError, expected_one_of
from lcorpp.files import locate_bad_byte, open_text
from lcorpp.learning.data.csv_reader import column_of, detect_delimiter, parse_line
from lcorpp.learning.data.measures import LENGTHS, TIMES
from lcorpp.learning.data.tracks import COLUMNS

REQUIRED = ("track", "time", "x", "y")
COMMENT, MAX_COMMENTS = "#", 1000
"""What begins a comment before the heading, and the maximum number of its lines."""
WORD_COLUMNS = ("label", "group")
LONG_COLUMNS = dict.fromkeys((*REQUIRED, *COLUMNS, *WORD_COLUMNS))
"""All columns of the long format, in the order in which they are written."""

FRAME_NAMES = ("frame", "framenumber", "framenum", "frameindex", "frameid", "frameno")

_ALIASES = {
    "track": (
        *("track", "id", "trackid", "tracknumber", "objectid", "objid", "agentid", "agent", "pid", "ped"),
        *(
            "pedid",
            "pedestrian",
            "pedestrianid",
            "person",
            "personid",
            "humanid",
            "targetid",
            "uid",
            "userid",
        ),
        *("participant", "participantid", "subject", "subjectid", "traj", "trajid", "trajectoryid"),
    ),
    "time": (
        *("time", "t", "timestamp", "stamp", "times", "sec", "secs", "second", "seconds", "elapsed", "clock"),
        *("unixtime", "epoch", "rostime", "headerstamp", "ts", *FRAME_NAMES),
    ),
    **{
        axis: (
            *(axis, f"pos{axis}", f"{axis}pos", f"position{axis}", f"{axis}position", f"p{axis}"),
            *(f"{axis}center", f"center{axis}", f"{axis}centre", f"centre{axis}", f"centroid{axis}"),
            *(f"{axis}world", f"world{axis}", f"{axis}est", f"{axis}coord", f"coord{axis}", f"loc{axis}"),
            *(f"poseposition{axis}", f"location{axis}", f"{axis}coordinate"),
        )
        for axis in "xy"
    },
}
"""Column -> names that other files use for it, in lower case without signs; the first has precedence."""


def find_columns(names: Collection[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the columns of numbers, time first, and those of words besides "track", among the given ones."""
    numbers = [name for name in LONG_COLUMNS if name in names and name not in ("track", *WORD_COLUMNS)]
    return tuple(numbers), tuple(name for name in WORD_COLUMNS if name in names)


def rename_columns(names: Sequence[str], columns: Mapping[str, str]) -> list[str]:
    """Return the names of a file's columns with those of `LONG_COLUMNS` that the caller chose.

    Args:
        names: the names of the file, or the numbers of its columns from 1, in lower case.
        columns: column of the long format -> name in the file, e.g. {"time": "stamp"}.

    Raises:
        DataError: an unknown column on either side, or two columns of the same name in the file.
    """
    chosen: dict[int, str] = {}
    for column, name in columns.items():
        if column not in LONG_COLUMNS:
            raise DataError(
                f"column {column}={name}: unknown column {column!r}; {expected_one_of(LONG_COLUMNS)}"
            )
        places = [place for place, other in enumerate(names) if other == name.strip().lower()]
        if len(places) != 1:
            count = "no" if not places else "more than one"
            raise DataError(
                f"column {column}={name}: the file has {count} column {name!r}; {expected_one_of(names)}"
            )
        if places[0] in chosen:
            raise DataError(f"column {name!r} is {chosen[places[0]]} and {column}; expected one of them")
        chosen[places[0]] = column
    return [
        chosen.get(place, f"{name} of the file" if name in columns else name)
        for place, name in enumerate(names)
    ]


def guess_columns(names: Sequence[str]) -> dict[str, str]:
    """Return required column -> the name in the file that seems to be it, as far as there is one."""
    guessed: dict[str, str] = {}
    bare = {_strip_unit(name)[0]: name for name in reversed(names)}
    for column, aliases in _ALIASES.items():
        alias = next((alias for alias in aliases if alias in bare), None)
        if alias is not None:
            guessed[column] = bare[alias]
    return guessed


def format_guess(guessed: Mapping[str, str]) -> str:
    """Return the options that read a file with guessed columns, e.g. "--column time=stamp --unit mm"."""
    options = [f"--column {_quote(f'{column}={name}')}" for column, name in guessed.items() if column != name]
    time, time_unit = _strip_unit(guessed.get("time", ""))
    unit = next((unit for axis in "xy" if (unit := _strip_unit(guessed.get(axis, ""))[1]) in LENGTHS), "")
    if time in FRAME_NAMES:
        options.append("--fps FRAMES_PER_SECOND")
    elif time_unit in TIMES and time_unit != "s":
        options.append(f"--time-unit {time_unit}")
    if unit and unit != "m":
        options.append(f"--unit {unit}")
    return " ".join(options)


def _quote(text: str) -> str:
    return text if re.fullmatch(r"[\w=.:/-]+", text) else f"'{text}'"


def _strip_unit(name: str) -> tuple[str, str]:
    """Return a name in lower case without signs and unit, and the unit, e.g. of "Pos X [mm]" or "time_ms"."""
    words = re.findall(r"[a-z0-9]+", name.lower())
    if len(words) > 1 and words[-1] in (*LENGTHS, *TIMES):
        return "".join(words[:-1]), words[-1]
    return "".join(words), ""


def note_unused_columns(names: Sequence[str]) -> tuple[str, ...]:
    """Return a note that names the ignored columns, if there are any."""
    others = [
        name or f"column {place} (no name)" for place, name in enumerate(names, 1) if name not in LONG_COLUMNS
    ]
    return (f"columns that are not used: {', '.join(others)}",) if others else ()


def describe_missing_column(name: str, names: Sequence[str]) -> str:
    """Return the message for a column that is not among the names: of tracks, or of a table of features."""
    guessed = guess_columns(names)
    if set(REQUIRED) <= set(guessed):
        return (
            f"no column {name!r}; expected {', '.join(REQUIRED)}; these columns seem to be them:"
            f" {format_guess(guessed)}"
        )
    label = "" if {"track", "time", "label"} & set(names) else ", and no column 'label'"
    found = {column: other for column, other in guessed.items() if column != other}
    similar = f" ({format_guess(found)} seems to fit)" if found else ""
    return (
        f"no column {name!r}{label}; expected {', '.join(REQUIRED)} among {', '.join(LONG_COLUMNS)}{similar},"
        " or --column NAME=COLUMN for other names; or, for a table of features, a column"
        " 'label' and none named track or time"
    )


@dataclass(frozen=True)
class Heading:
    """The line that names the columns: its number, its text without a comment sign, and the delimiter.

    is_comment: whether it has a comment sign.
    """

    line: int
    text: str
    delimiter: str
    is_comment: bool = False


def read_header(
    path: Path, required: tuple[str, ...] = (), columns: Mapping[str, str] | None = None
) -> tuple[list[str], Heading]:
    """Read the names of the columns, in lower case, and the line that has them.

    Args:
        columns: as in `rename_columns`.

    Raises:
        FileError: the file cannot be read.
        ParseError: a required column is missing, or a name is repeated.
        DataError: as `rename_columns`.
    """
    heading = find_heading(path)
    text, delimiter = heading.text, heading.delimiter
    names = [name.lower() for name in parse_line(str(path), heading.line, text, delimiter)]
    names = rename_columns(names, columns or {})
    for name in required:
        if name not in names:
            raise ParseError(str(path), heading.line, 1, describe_missing_column(name, names), text)
    for cell, name in enumerate(names):
        if name and name in names[:cell]:
            message = f"column {name!r} for the second time; expected every name once"
            raise ParseError(str(path), heading.line, column_of(text, cell, delimiter), message, text)
    return names, heading


def find_heading(path: Path) -> Heading:
    """Return the first line that is not a comment, or a comment that names all columns of `REQUIRED`.

    Raises:
        FileError: the file cannot be read.
    """
    first = Heading(1, "", ",")
    with open_text(path) as file:
        try:
            for number, text in enumerate(islice(file, MAX_COMMENTS), start=1):
                is_comment = text.lstrip().startswith(COMMENT)
                bare = text.lstrip().removeprefix(COMMENT) if is_comment else text
                heading = Heading(number, bare, detect_delimiter(bare), is_comment)
                first = heading if number == 1 else first
                if not is_comment and text.strip():
                    return heading
                if is_comment and _names_all(bare, heading.delimiter):
                    return heading
        except UnicodeDecodeError:
            raise locate_bad_byte(path) from None
    return first


def _names_all(text: str, delimiter: str) -> bool:
    """Whether a line has the names of all columns of `REQUIRED`."""
    return set(REQUIRED) <= {
        name.strip().strip('"').lower() for name in text.split(delimiter.strip() or None)
    }
