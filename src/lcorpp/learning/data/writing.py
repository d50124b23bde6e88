"""Write recordings as long CSV or as Parquet with the same columns."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from lcorpp.arguments import check_arguments
from lcorpp.csv_text import format_csv
from lcorpp.errors import DataError, FileError, expected_one_of
from lcorpp.files import PARQUET_SUFFIXES, open_atomically
from lcorpp.learning.data.formats.columns import LONG_COLUMNS
from lcorpp.learning.data.formats.parquet import import_pyarrow
from lcorpp.learning.data.tracks import COLUMNS, Recording, Track
from lcorpp.values import Array

DECIMALS = 4
"""Decimals of numbers in CSV: a tenth of a millimetre or millisecond."""

WORDS: dict[str, Callable[[Track], str]] = {
    "track": lambda track: track.id,
    "label": lambda track: str(track.label),
    "group": lambda track: track.group,
}
"""Columns of words -> their value for a track."""


@check_arguments
def write_recording(recording: Recording, path: str | Path) -> None:
    """Write all tracks as a long CSV (.csv) or as Parquet (.parquet), whole or not at all.

    Numbers have four decimals in CSV and are exact in Parquet. A column is written if every track has it,
    the labels if every track has one.

    Raises:
        FileError: the file cannot be written, or its name has another ending.
        DataError: there are no tracks, a track has two samples within a tenth of a millisecond, which CSV
            cannot tell apart, or pyarrow is not installed.

    Examples:
        >>> from pathlib import Path
        >>> from lcorpp.learning import Recording, Track, write_recording
        >>> track = Track("7", [0.0, 4.0], {"x": [0.0, 4.0], "y": [1.0, 1.0]}, "interested")
        >>> write_recording(Recording([track]), "people.csv")
        >>> print(Path("people.csv").read_text())
        track,time,x,y,label
        7,0.0000,0.0000,1.0000,interested
        7,4.0000,4.0000,1.0000,interested
    """
    if not recording.tracks:
        raise DataError(f"{path}: there are no tracks to write")
    suffix = Path(path).suffix.lower()
    if suffix == ".csv":
        _write_csv(recording, path)
    elif suffix in PARQUET_SUFFIXES:
        _write_parquet(recording, path)
    else:
        raise FileError(
            f"{path}: not the name of a recording; {expected_one_of(('.csv', *PARQUET_SUFFIXES))} at its end"
        )


def select_columns(recording: Recording) -> tuple[str, ...]:
    """Return the columns to write, in the order of `LONG_COLUMNS`."""
    numbers = [name for name in COLUMNS if all(name in track.columns for track in recording.tracks)]
    words = [] if None in recording.labels else ["label"]
    if any(track.group != track.id for track in recording.tracks):
        words.append("group")
    return tuple(name for name in LONG_COLUMNS if name in ("track", "time", *numbers, *words))


def _write_csv(recording: Recording, path: str | Path) -> None:
    names = select_columns(recording)
    with open_atomically(path) as file:
        file.write(format_csv([names]).encode())
        for track in recording.tracks:
            file.write(_format_rows(track, names, path))


def _format_rows(track: Track, names: tuple[str, ...], path: str | Path) -> bytes:
    times = np.round(track.times, DECIMALS)
    if np.diff(times).min() <= 0:
        raise DataError(
            f"{path}: track {track.id!r} has samples within {10**-DECIMALS:g} s, which CSV with {DECIMALS}"
            " decimals cannot tell apart; expected a longer interval, or a name that ends in .parquet"
        )
    form, numbers = [], []
    for name in names:
        if name in WORDS:  # a word with a comma is quoted, and a per cent sign is a plain one
            form.append(format_csv([[WORDS[name](track)]]).rstrip("\n").replace("%", "%%"))
        else:
            form.append(f"%.{DECIMALS}f")
            numbers.append(_get_numbers(track, name))
    line = ",".join(form) + "\n"
    return "".join(line % row for row in zip(*(n.tolist() for n in numbers), strict=True)).encode()


def _get_numbers(track: Track, name: str) -> Array:
    return track.times if name == "time" else track.columns[name]


def _write_parquet(recording: Recording, path: str | Path) -> None:
    arrow, names = import_pyarrow(), select_columns(recording)
    schema = arrow.schema([(name, arrow.string() if name in WORDS else arrow.float64()) for name in names])
    with open_atomically(path) as file, arrow.parquet.ParquetWriter(file, schema) as writer:
        for start in range(0, len(recording), 1000):
            some = recording.tracks[start : start + 1000]
            columns = [
                np.repeat([WORDS[name](track) for track in some], [len(track) for track in some])
                if name in WORDS
                else np.concatenate([_get_numbers(track, name) for track in some])
                for name in names
            ]
            writer.write_table(arrow.table(dict(zip(names, map(arrow.array, columns), strict=True)), schema))
