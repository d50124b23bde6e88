"""What may be wrong with recorded rows and tracks: refused, or repaired where that is asked for.

Nothing is repaired silently. Each repair has a name; what is not asked for by name is refused with its place,
and what is repaired is kept in a `RepairLog`, row by row.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Protocol

from lcorpp.errors import DataError, LcorppError, expected_one_of
from lcorpp.learning.data.tracks import Repair

REPAIRS = {
    "rows": "leave out rows that cannot be read: too many or too few columns, or words for numbers",
    "cut": "leave out the last line of a file that ends in the middle of it",
    "nonfinite": "leave out samples that are missing, NaN or infinite",
    "order": "sort the samples of a track by time",
    "duplicates": "keep the first of several samples of a track at one time",
    "gaps": "split a track where its id was given away: silent for too long, or at times it already had",
    "short": "leave out tracks of fewer than two samples",
    "constant": "leave out tracks that never move",
    "units": "rescale positions and speeds that no human has by a factor of 1000",
    "labels": "leave out tracks without a label, with an unknown one or with several",
}
"""Every repair by its name, and what it does."""

ALL = "all"
"""The name that asks for every repair."""


class RowSource(Protocol):
    """Something rows are read from, which can tell where a row is.

    file: its name. ended: whether its last line, once read, had an end.
    """

    file: str
    ended: bool

    def error_at(self, line: int, field: str, message: str) -> LcorppError:
        """The error to raise for a field of a line (counted from 1)."""
        ...


class RepairLog:
    """Which repairs were asked for, and what was repaired so far.

    Args:
        asked: names among `REPAIRS`, or "all".

    Raises:
        DataError: a name is none of them.
    """

    def __init__(self, asked: Collection[str] = ()) -> None:
        names = [asked] if isinstance(asked, str) else list(asked)
        for name in names:
            if name not in REPAIRS and name != ALL:
                raise DataError(f"unknown repair {name!r}; {expected_one_of((*REPAIRS, ALL))}")
        self.asked = frozenset(REPAIRS if ALL in names else names)
        self.repairs: list[Repair] = []

    def repair_or_raise(
        self,
        reason: str,
        source: RowSource,
        line: int,
        message: str,
        done: str,
        *,
        field: str = "",
        track: str = "",
        rows: int = 1,
    ) -> None:
        """Note a repair that was asked for, or refuse.

        Args:
            reason: the repair. line, field: where the fault is.
            message: what is wrong and what was expected, for who did not ask.
            done: what is done about it, for who did.
            track: whose row it is. rows: how many rows are changed.

        Raises:
            ParseError, DataError: the repair was not asked for; see `RowSource.error_at`.
        """
        if reason not in self.asked:
            whose = f"track {track!r}: " if track else ""
            raise source.error_at(line, field, f"{whose}{message}; repair {reason!r} would {REPAIRS[reason]}")
        self.repairs.append(Repair(reason, source.file, line, track, rows, f"{message}: {done}"))
