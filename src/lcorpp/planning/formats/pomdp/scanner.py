"""The scanner of plain statements and numbers, in C++ (native/pomdp).

Plain statements are those that large files consist of: an entry with known names and one number, and a row of
T or O with a known action and state and one number per column. All other statements, and all errors, are left
to `statements.py`.
"""

from __future__ import annotations

import mmap
from collections.abc import Mapping
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from lcorpp.planning.formats.numbers import ROW_TOLERANCE
from lcorpp.planning.formats.pomdp import _scanner
from lcorpp.values import Array

Text = bytes | mmap.mmap
"""The text of a file in UTF-8, in memory or mapped."""

MAX_NUMBERS = 2**16
"""Maximum number of numbers that are scanned at once."""


class PlainTable(NamedTuple):
    """Plain statements of one table, in the order of the text. Offsets in the text are those of numbers.

    entry_indices: (n, 3 or 4). entry_values, entry_offsets: (n,).
    row_indices: (m, 2) action and state. row_offsets: (m,) of the first number.
    row_begins: (m + 1,) index of the first nonzero number of each row. row_columns, row_values: of these.
    """

    entry_indices: npt.NDArray[np.int32]
    entry_values: Array
    entry_offsets: npt.NDArray[np.int64]
    row_indices: npt.NDArray[np.int32]
    row_offsets: npt.NDArray[np.int64]
    row_begins: npt.NDArray[np.int64]
    row_columns: npt.NDArray[np.int32]
    row_values: Array


class Scanner:
    """Scans the plain statements of one file.

    Args:
        indices: for actions, states and observations: name or number -> index, and -1 for ``*``.
        states, observations: how many there are.
        is_mdp: whether an entry of R has three references, without an observation.
    """

    def __init__(
        self,
        indices: Mapping[str, Mapping[str, int]],
        states: int,
        observations: int,
        *,
        is_mdp: bool = False,
    ) -> None:
        kinds = ("actions", "states", "observations")
        self._names = [_scanner.Names(dict(indices[kind])) for kind in kinds]
        self._counts = states, observations, 3 if is_mdp else 4

    def scan(self, text: Text, offset: int) -> tuple[int, PlainTable, PlainTable, PlainTable]:
        """Read plain statements from the token at an offset on, at most some `MAX_NUMBERS` numbers.

        Returns:
            The offset of the first statement that was not read, and the statements of T, O and R.
        """
        arguments: tuple[Any, ...] = (*self._names, *self._counts, 1 + ROW_TOLERANCE, MAX_NUMBERS)
        end, *tables = _scanner.scan_statements(text, offset, *arguments)
        T, Z, R = (PlainTable(*table) for table in tables)
        return end, T, Z, R


def scan_rows(text: Text, offset: int, rows: int, count: int) -> tuple[Any, ...] | None:
    """Read rows of `count` finite numbers from the token at an offset on; None if there are fewer.

    Returns:
        The offset of the next token, and the fields of `NumberRows` but the first.
    """
    return cast("tuple[Any, ...] | None", _scanner.scan_rows(text, offset, rows, count))
