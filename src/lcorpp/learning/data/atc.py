"""The tracking data of the ATC shopping centre, and files of the same form: one row a person and time.

A row is: time (s since 1970), id of the person, x, y and z (mm; z is the height of the head), velocity
(mm/s), angle of motion (rad), facing angle (rad). There is no heading and no label.

Source: Brscic, Kanda, Ikeda and Miyashita, IEEE Transactions on Human-Machine Systems 43, 2013.
"""

from __future__ import annotations

from pathlib import Path

from lcorpp.errors import ParseError
from lcorpp.learning.data.assembly import TrackAssembler
from lcorpp.learning.data.csv_reader import CsvFile
from lcorpp.learning.data.ingest import ReadOptions, assemble_tracks
from lcorpp.learning.data.tracks import Track

FIELDS = ("time", "track", "x", "y", "z", "velocity", "heading", "facing")
MILLIMETRE = 1e-3


def read_atc(path: Path, options: ReadOptions) -> tuple[list[Track], tuple[str, ...]]:
    """Read a file of this form; only batches of its text are in memory, and the rows that are asked for.

    Returns:
        The tracks, in metres and metres per second, and notes on them.

    Raises:
        FileError: the file cannot be read.
        ParseError: a row or a track is wrong, and its repair was not asked for.
    """
    numbers = tuple(name for name in FIELDS if name != "track")
    file = CsvFile(path, {name: cell for cell, name in enumerate(FIELDS)}, len(FIELDS), numbers)
    scale = dict.fromkeys(("x", "y", "z", "velocity"), MILLIMETRE)
    assembler = TrackAssembler(numbers[1:], scale=scale)
    tracks = assemble_tracks(file, file.batches(options.repair_log, options.progress), assembler, options)
    if not tracks and options.only is None and not options.repair_log.repairs:
        raise ParseError(str(path), 1, 1, f"the file is empty; expected rows of {', '.join(FIELDS)}")
    return tracks, file.notes(options.repair_log)
