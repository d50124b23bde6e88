"""Statements of the tables T, O and R, and the resolution of overridden ones.

Statements are stored as they are; rows are built at the end. No dense table is allocated, so memory follows
the length of the text and the size of the resulting rows. Among statements with the same scope only the last
one is kept; each row takes the last whole-row statement that covers it, and then the single numbers after it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.formats.pomdp.preamble import ALL
from lcorpp.planning.formats.pomdp.tokens import Offsets
from lcorpp.planning.sparse import MAX_BYTES, SparseTables, ragged_indices
from lcorpp.values import Array, Indices

MAX_NUMBERS = MAX_BYTES // 32
"""Maximum number of numbers of a table; row, column, value and order of each need memory at once."""


class Entries:
    """Statements with one number each, in the order of the text.

    axes: number of indices of a statement; an index may be `ALL`.
    """

    def __init__(self, axes: int) -> None:
        self._axes = axes
        self._chunks: list[tuple[Indices, Array, Offsets]] = []

    def add(self, indices: npt.ArrayLike, values: npt.ArrayLike, offsets: npt.ArrayLike) -> None:
        """Append indices (n, axes), values (n,) and their offsets in the text (n,)."""
        self._chunks.append(
            (
                np.asarray(indices, dtype=np.int64).reshape(-1, self._axes),
                np.asarray(values, dtype=np.float64).reshape(-1),
                np.asarray(offsets, dtype=np.int64).reshape(-1),
            )
        )

    def clear(self) -> None:
        """Remove all: a later statement replaces them."""
        self._chunks.clear()

    def arrays(self) -> tuple[Indices, Array, Offsets]:
        """Return the indices (n, axes), values (n,) and offsets (n,) of all statements."""
        if not self._chunks:
            return np.zeros((0, self._axes), dtype=np.int64), np.zeros(0), np.zeros(0, dtype=np.int64)
        if len(self._chunks) > 1:
            parts = zip(*self._chunks, strict=True)
            self._chunks = [tuple(np.concatenate(part) for part in parts)]  # type: ignore[list-item]
        return self._chunks[0]


class StoredRows(NamedTuple):
    """Range of a table's stored numbers that form a row; for a matrix, arrays (S,) of ranges."""

    begin: int | Indices
    length: int | Indices


class TableStatements:
    """The statements of T or O so far.

    title: name for messages. shape: (A, S, N). entries: numbers given one at a time.
    """

    def __init__(self, title: str, shape: tuple[int, int, int]) -> None:
        self.title, self.shape = title, shape
        self.entries = Entries(3)
        # rows and offsets by action and state, in the order of the text
        self._statements: dict[tuple[int, int], tuple[StoredRows, int | Offsets]] = {}
        self._columns: list[npt.NDArray[np.int32]] = []
        self._values: list[Array] = []
        self._stored = 0

    def store(self, numbers: Array) -> StoredRows:
        """Store the nonzero numbers of a row (N,) or a matrix (S, N); raise a ModelError if too many."""
        nonzero = np.nonzero(numbers)
        begin = self._store(nonzero[-1].astype(np.int32), numbers[nonzero])
        if numbers.ndim == 1:
            return StoredRows(begin, len(nonzero[0]))
        ends = np.searchsorted(nonzero[0], np.arange(len(numbers) + 1))
        return StoredRows(begin + ends[:-1], np.diff(ends))

    def store_identity(self) -> StoredRows:
        """Store the rows of an identity matrix."""
        S = self.shape[1]
        begin = self._store(np.arange(S, dtype=np.int32), np.ones(S))
        return StoredRows(begin + np.arange(S), np.ones(S, dtype=np.int64))

    def _store(self, columns: npt.NDArray[np.int32], values: Array) -> int:
        begin = self._stored
        self._stored += len(columns)
        self._check_size(self._stored)
        self._columns.append(columns)
        self._values.append(values)
        return begin

    def set_rows(self, action: int, state: int, rows: StoredRows, offsets: int | Offsets) -> None:
        """Set whole rows for an action and a state, either of which may be `ALL`.

        A matrix has the state `ALL` and an offset for each row.
        """
        if action == state == ALL:  # overrides everything before it
            self._statements.clear()
            self.entries.clear()
        self._statements.pop((action, state), None)  # so that the new one goes to the end
        self._statements[action, state] = rows, offsets

    def rows(self) -> tuple[SparseTables, Offsets]:
        """Return the table, and for each row (A, S) the offset of the last statement about it, or -1."""
        A, S, _ = self.shape
        begins, lengths, offsets = np.zeros((3, A, S), dtype=np.int64)
        offsets[:] = -1
        for (a, s), (stored, at) in self._statements.items():
            scope = (slice(None) if a == ALL else a, slice(None) if s == ALL else s)
            begins[scope], lengths[scope] = stored
            offsets[scope] = at
        total = int(lengths.sum())
        self._check_size(total)
        row, column, value, entry_offsets = self._find_overriding_entries(offsets, MAX_NUMBERS - total)
        index = ragged_indices(begins.reshape(-1), lengths.reshape(-1))
        columns = np.concatenate(self._columns or [np.zeros(0, dtype=np.int32)])[index]
        values = np.concatenate(self._values or [np.zeros(0)])[index]
        offsets.reshape(-1)[row] = entry_offsets  # numpy keeps the last of several
        if not len(row):
            ends = np.concatenate([[0], np.cumsum(lengths)])
            return SparseTables(self.shape, ends, columns, values), offsets
        rows = np.repeat(np.arange(A * S), lengths.reshape(-1))
        return SparseTables.of_entries(
            self.shape,
            np.concatenate([rows, row]),
            np.concatenate([columns, column]),
            np.concatenate([values, value]),
        ), offsets

    def _find_overriding_entries(
        self, offsets: Offsets, limit: int
    ) -> tuple[Indices, Indices, Array, Offsets]:
        """Return row, column, value and offset of each number after the last whole-row statement of its row.

        Args:
            offsets: (A, S) of these statements. limit: maximum number of numbers.
        """
        A, S, _ = self.shape
        indices, values, at = self.entries.arrays()
        selected = self._select_entries(offsets)
        action, state, _ = indices[selected].T
        copies = np.where(action == ALL, A, 1) * np.where(state == ALL, S, 1)
        total = int(copies.sum())
        if total > limit:
            self._check_size(total + MAX_NUMBERS - limit)
        step = np.arange(total) - np.repeat(np.cumsum(copies) - copies, copies)
        selected = np.repeat(selected, copies)
        action, state, column = indices[selected].T
        # copies of an entry are in the order of actions, then states
        states = np.where(state == ALL, S, 1)
        row = np.where(action == ALL, step // states, action) * S
        row += np.where(state == ALL, step % states, state)
        later = np.flatnonzero(at[selected] > offsets.reshape(-1)[row])
        selected = selected[later]
        return row[later], column[later], values[selected], at[selected]

    def _select_entries(self, offsets: Offsets) -> npt.NDArray[np.intp]:
        """Return the indices (n,) of the entries to expand, without overridden entries of ``*``."""
        _, S, N = self.shape
        indices, _, at = self.entries.arrays()
        action, state, column = indices.T
        if not ((action == ALL) | (state == ALL)).any():
            return np.arange(len(at))
        # the smallest offset among the rows of each scope; `ALL`, -1, is the last row or column
        late = np.flatnonzero(at > np.pad(offsets, (0, 1), mode="minimum")[action, state])
        key = ((action[late] + 1) * (S + 1) + state[late] + 1) * N + column[late]
        return late[find_last_occurrences(key)]

    def _check_size(self, numbers: int) -> None:
        if numbers > MAX_NUMBERS:
            raise ModelError(
                f"the statements of the {self.title} table {self.shape} give {numbers} numbers,"
                f" {12 * numbers / 2**30:.1f} GiB; at most {MAX_NUMBERS} are read"
            )


def find_last_occurrences(keys: Indices) -> npt.NDArray[np.intp]:
    """Return the index of the last occurrence of each key, increasing."""
    _, last = np.unique(keys[::-1], return_index=True)
    return np.sort(len(keys) - 1 - last)
