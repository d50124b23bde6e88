"""Repairs of recorded rows and tracks, each requested by its name.

A fault whose repair was not requested is an error with its place; each repair is recorded in a `RepairLog`.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from lcorpp.errors import DataError, LcorppError, expected_one_of
from lcorpp.learning.data.tracks import Repair

REPAIRS = {
    "rows": "leave out rows that cannot be read: too many or too few columns, or words for numbers",
    "cut": "leave out the last line of a file that ends in the middle of it",
    "nonfinite": "leave out samples that are missing, NaN, infinite or of negative speed",
    "order": "sort the samples of a track by time",
    "duplicates": "keep the first of several samples of a track at one time",
    "gaps": "split a track whose id was reused: silent for too long, jumps, or times that start again",
    "short": "leave out tracks of fewer than two samples",
    "constant": "leave out tracks that never move",
    "units": "convert positions, speeds and angles that no human has from millimetres, centimetres, degrees",
    "labels": "leave out tracks without a label, with an unknown one or with several",
}
"""Repairs: name -> what it does."""

ALL = "all"
"""Name that requests every repair."""


class RepairLog:
    """The requested repairs, and those made so far.

    Args:
        requested: names from `REPAIRS`, or "all".

    Raises:
        DataError: an unknown name.
    """

    def __init__(self, requested: Collection[str] = ()) -> None:
        names = [requested] if isinstance(requested, str) else list(requested)
        for name in names:
            if name not in REPAIRS and name != ALL:
                raise DataError(f"unknown repair {name!r}; {expected_one_of((*REPAIRS, ALL))}")
        self.requested = frozenset(REPAIRS if ALL in names else names)
        self.repairs: list[Repair] = []


class RowSource:
    """A file of rows that locates its errors; faults whose repair was requested go to its log.

    file: its name. ended: whether its last line, once read, has a line end. header: the line before the rows.
    """

    header = 1

    def __init__(self, path: Path, repair_log: RepairLog) -> None:
        self.file, self.repair_log, self.ended = str(path), repair_log, True

    def error_at(self, line: int, field: str, message: str) -> LcorppError:
        """Return the error for a field of a line (counted from 1); here without a place, for a whole file."""
        return DataError(f"{self.file}: {message}")

    def repair_or_raise(
        self,
        reason: str,
        line: int,
        message: str,
        done: str = "left out",
        *,
        field: str = "",
        track: str = "",
        rows: int = 1,
    ) -> None:
        """Record a repair if it was requested; otherwise raise the error.

        Args:
            reason: the repair. line, field: the place of the fault.
            message: the error raised if this repair was not requested.
            done: the action. track: the id of the track. rows: number of rows changed.

        Raises:
            ParseError, DataError: the repair was not requested; see `error_at`.
        """
        if reason not in self.repair_log.requested:
            whose = f"track {track!r}: " if track else ""
            raise self.error_at(line, field, f"{whose}{message}; repair {reason!r} would {REPAIRS[reason]}")
        self.repair_log.repairs.append(Repair(reason, self.file, line, track, rows, f"{message}: {done}"))
