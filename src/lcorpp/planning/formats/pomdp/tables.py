"""Statements of the tables T, O and R, and the resolution of overridden ones.

Statements are stored as they are; rows are built at the end. No dense table is allocated, so memory follows
the length of the text and the size of the resulting rows. Among statements with the same scope only the last
one is kept; each row takes the last whole-row statement that covers it, and then the single numbers after it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.formats.pomdp.preamble import ALL
from lcorpp.planning.formats.pomdp.scanner import PlainTable
from lcorpp.planning.formats.pomdp.tokens import Offsets
from lcorpp.planning.sparse import MAX_BYTES, SparseTables, ragged_indices, sort_entries
from lcorpp.values import Array, Indices

MAX_NUMBERS = MAX_BYTES // 32
"""Maximum number of numbers of a table; row, column, value and order of each need memory at once."""

PART_ROWS = 2**17
"""Rows of a table are built in parts of about this size."""


class Columns:
    """Arrays of equal lengths that grow.

    Args:
        widths: the number of entries in a row of each array; 0 for one dimension.
        kinds: the type of each array.
    """

    def __init__(self, widths: tuple[int, ...], kinds: tuple[type, ...]) -> None:
        self._shapes = [(-1, width) if width else (-1,) for width in widths]
        self._kinds = kinds
        self._chunks: list[list[npt.NDArray[Any]]] = [[] for _ in kinds]

    def add(self, *arrays: npt.ArrayLike) -> None:
        """Append one array or number to each array."""
        columns = zip(self._chunks, arrays, self._kinds, self._shapes, strict=True)
        for chunks, array, kind, shape in columns:
            chunks.append(np.asarray(array, dtype=kind).reshape(shape))

    def clear(self) -> None:
        """Remove all rows."""
        for chunks in self._chunks:
            chunks.clear()

    def arrays(self) -> list[npt.NDArray[Any]]:
        """Return the arrays."""
        for chunks, kind, shape in zip(self._chunks, self._kinds, self._shapes, strict=True):
            empty: npt.NDArray[Any] = np.zeros(0, dtype=kind).reshape(0, *shape[1:])
            if len(chunks) != 1:  # one array after the other, so that the chunks are not all there twice
                chunks[:] = [np.concatenate([empty, *chunks])]
        return [chunks[0] for chunks in self._chunks]


def make_reward_columns() -> Columns:
    """Return the columns of R statements: indices by action, state, next state and observation; values."""
    return Columns((4, 0), (np.int32, np.float64))


class StoredRows(NamedTuple):
    """Range of a table's stored numbers that form a row; for a matrix, arrays (S,) of ranges."""

    begin: Any
    length: Any

    def row(self, index: int) -> StoredRows:
        """Return one row of several."""
        return StoredRows(int(self.begin[index]), int(self.length[index]))


class TableStatements:
    """The statements of T or O so far.

    title: name for messages. shape: (A, S, N).
    """

    def __init__(self, title: str, shape: tuple[int, int, int]) -> None:
        self.title, self.shape = title, shape
        # indices, values and offsets of single numbers
        self._entries = Columns((3, 0, 0), (np.int32, np.float64, np.int64))
        # action and state, begin, length and offset of rows of one action and state
        self._rows = Columns((2, 0, 0, 0), (np.int32, np.int64, np.int64, np.int64))
        # rows and offsets by action and state, one of which is `ALL`, in the order of the text
        self._shared_rows: dict[tuple[int, int], tuple[StoredRows, int | Offsets]] = {}
        # columns and values of the numbers of rows
        self._numbers = Columns((0, 0), (np.int32, np.float64))
        self._stored = 0

    def store(self, begins: Indices, columns: npt.NDArray[np.int32], values: Array) -> StoredRows:
        """Store rows of numbers in compressed form; raise a ModelError if there are too many."""
        begin = self._stored
        self._stored += len(columns)
        self._check_size(self._stored)
        self._numbers.add(columns, values)
        return StoredRows(begin + begins[:-1], np.diff(begins))

    def store_row(self, numbers: Array) -> StoredRows:
        """Store the nonzero numbers of a row (N,)."""
        nonzero = np.flatnonzero(numbers)
        rows = self.store(np.array([0, len(nonzero)]), nonzero.astype(np.int32), numbers[nonzero])
        return rows.row(0)

    def store_identity(self) -> StoredRows:
        """Store the rows of an identity matrix."""
        S = self.shape[1]
        return self.store(np.arange(S + 1), np.arange(S, dtype=np.int32), np.ones(S))

    def add_entry(self, indices: tuple[int, int, int], value: float, offset: int) -> None:
        """Set one number; the action and the state may be `ALL`."""
        self._entries.add(indices, value, offset)

    def add_plain(self, table: PlainTable) -> None:
        """Set the numbers and rows of plain statements."""
        rows = self.store(table.row_begins, table.row_columns, table.row_values)
        shared = (table.row_indices == ALL).any(axis=1)
        for i in np.flatnonzero(shared).tolist():
            action, state = table.row_indices[i].tolist()
            self.set_rows(action, state, rows.row(i), int(table.row_offsets[i]))
        # after `set_rows`, which may clear what is earlier in the text; offsets decide what overrides what
        self._entries.add(table.entry_indices, table.entry_values, table.entry_offsets)
        self._rows.add(*(part[~shared] for part in (table.row_indices, *rows, table.row_offsets)))

    def set_rows(self, action: int, state: int, rows: StoredRows, offsets: int | Offsets) -> None:
        """Set whole rows for an action and a state, either of which may be `ALL`.

        A matrix has the state `ALL` and an offset for each row.
        """
        if ALL not in (action, state):
            self._rows.add((action, state), *rows, offsets)
            return
        if action == state == ALL:  # overrides everything before it
            self._shared_rows.clear()
            self._rows.clear()
            self._entries.clear()
        self._shared_rows.pop((action, state), None)  # so that the new one goes to the end
        self._shared_rows[action, state] = rows, offsets

    def take_rows(self) -> tuple[SparseTables, Offsets]:
        """Return the table, and for each row (A, S) the offset of the last statement about it, or -1.

        It removes the statements, since they may need more memory than the table.
        """
        A, S, _ = self.shape
        begins, lengths, offsets = self._find_last_rows()
        stored = self._numbers.arrays()
        selected = self._select_entries(offsets, int(lengths.sum()))
        parts, step = [], max(1, PART_ROWS // S)
        for first in range(0, A, step):  # in parts: the temporary arrays are larger than the table
            part = slice(first * S, min(first + step, A) * S)
            row, column, value = self._find_overriding_entries(first, offsets[part], selected)
            index = ragged_indices(begins[part], lengths[part])
            rows = np.repeat(np.arange(len(offsets[part])), lengths[part])
            columns, values = (numbers[index] for numbers in stored)
            if len(row):
                row, column = np.concatenate([rows, row]), np.concatenate([columns, column])
                value = np.concatenate([values, value])
                parts.append(sort_entries(row, column, value, len(offsets[part]), self.shape[2]))
            else:
                parts.append((np.cumsum(lengths[part]), columns, values))
        self._clear()
        return SparseTables.of_parts(self.shape, parts), offsets.reshape(A, S)

    def _find_last_rows(self) -> tuple[Indices, Indices, Offsets]:
        """Return begin, length and offset (A S,) of the last statement that sets each whole row; -1: none."""
        A, S, _ = self.shape
        begins, lengths, offsets = np.zeros((3, A, S), dtype=np.int64)
        offsets[:] = -1
        for (a, s), (stored, at) in self._shared_rows.items():
            scope = (slice(None) if a == ALL else a, slice(None) if s == ALL else s)
            begins[scope], lengths[scope] = stored
            offsets[scope] = at
        scopes, begin, length, at = self._rows.arrays()
        row = scopes[:, 0].astype(np.int64) * S + scopes[:, 1]
        later = np.flatnonzero(at > offsets.reshape(-1)[row])
        flat = [part.reshape(-1) for part in (begins, lengths, offsets)]
        for part, values in zip(flat, (begin, length, at), strict=True):
            part[row[later]] = values[later]  # numpy keeps the last of several
        return flat[0], flat[1], flat[2]

    def _select_entries(self, offsets: Offsets, stored: int) -> Indices:
        """Return the indices of the entries to expand, increasing, without overridden entries of `ALL`.

        Args:
            offsets: (A S,) of the whole-row statements. stored: how many numbers these have.

        Raises:
            ModelError: there are too many numbers.
        """
        A, S, N = self.shape
        indices, _, at = self._entries.arrays()
        shared = np.flatnonzero((indices[:, 0] == ALL) | (indices[:, 1] == ALL))
        single = len(indices) - len(shared)
        # an entry of `ALL` is overridden if all its rows were set later, or if it is repeated later
        action, state, column = indices[shared].astype(np.int64).T
        earliest = np.pad(offsets.reshape(A, S), (0, 1), mode="minimum")  # `ALL`, -1: the last row or column
        late = np.flatnonzero(at[shared] > earliest[action, state])
        key = ((action[late] + 1) * (S + 1) + state[late] + 1) * N + column[late]
        late = late[find_last_occurrences(key)]
        copies = np.where(action[late] == ALL, A, 1) * np.where(state[late] == ALL, S, 1)
        self._check_size(stored + single + int(copies.sum()))
        kept = np.ones(len(indices), dtype=bool)
        kept[shared] = False
        kept[shared[late]] = True
        return np.flatnonzero(kept)

    def _find_overriding_entries(
        self, first: int, offsets: Offsets, selected: Indices
    ) -> tuple[Indices, npt.NDArray[np.int32], Array]:
        """Return row, column and value of each number after the last whole-row statement of its row.

        Args:
            first: the first of some actions; rows are counted from its first one.
            offsets: (n,) of the whole-row statements of these actions; the numbers' offsets replace them.
            selected: the indices of all entries to expand.
        """
        S = self.shape[1]
        A = len(offsets) // S
        indices, values, at = self._entries.arrays()
        action = indices[selected, 0]
        source = selected[(action == ALL) | ((action >= first) & (action < first + A))]
        action, state = indices[source, 0].astype(np.int64), indices[source, 1].astype(np.int64)
        action[action != ALL] -= first
        if ((action == ALL) | (state == ALL)).any():
            copies = np.where(action == ALL, A, 1) * np.where(state == ALL, S, 1)
            # copies of an entry are in the order of actions, then states
            step = ragged_indices(np.zeros_like(copies), copies)
            source, action, state = (np.repeat(part, copies) for part in (source, action, state))
            states = np.where(state == ALL, S, 1)
            action = np.where(action == ALL, step // states, action)
            state = np.where(state == ALL, step % states, state)
        row = action * S + state
        later = at[source] > offsets[row]
        row, source = row[later], source[later]
        offsets[row] = at[source]  # numpy keeps the last of several
        return row, indices[source, 2], values[source]

    def _clear(self) -> None:
        for columns in (self._entries, self._rows, self._numbers):
            columns.clear()
        self._shared_rows.clear()

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
