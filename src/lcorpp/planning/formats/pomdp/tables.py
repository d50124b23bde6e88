"""T or O while it is read: statements are kept as they came and become rows at the end.

No table is written out on the way, so a model takes the room of its text and of the rows that it comes to. Of
statements with the same scope only the last one is kept; of the others each row takes the one that stands
last in the text, and then the single numbers that stand after it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.formats.pomdp.entries import Entries, Indices, last_of_each
from lcorpp.planning.formats.pomdp.preamble import ALL
from lcorpp.planning.formats.pomdp.tokens import Places
from lcorpp.planning.sparse import MAX_BYTES, SparseTables
from lcorpp.values import Array

MAX_NUMBERS = MAX_BYTES // 32
"""The most numbers of a table: row, column, value and the order of each must be held for a moment."""


@dataclass(frozen=True, eq=False)
class Content:
    """Where in a table's store the numbers of a row are; of a matrix, arrays (S,) of it."""

    begin: int | Indices
    length: int | Indices


@dataclass(frozen=True, eq=False)
class _Whole:
    """A statement that gives whole rows.

    places: the offset of the first number; of a matrix (S,) that of each row.
    """

    places: int | Places
    content: Content


class Table:
    """The statements of T or O so far.

    title: what messages call it. shape: (A, S, N). entries: numbers given one at a time.
    """

    def __init__(self, title: str, shape: tuple[int, int, int]) -> None:
        self.title, self.shape = title, shape
        self.entries = Entries(3)
        self._whole: dict[tuple[int, int], _Whole] = {}
        self._columns: list[npt.NDArray[np.int32]] = []
        self._values: list[Array] = []
        self._stored = 0

    def store(self, numbers: Array) -> Content:
        """Keep what is not zero of the numbers (N,) of a row, or (S, N) of a matrix.

        Raises:
            ModelError: it is too much together with what is kept already.
        """
        where = np.nonzero(numbers)
        begin = self._keep(where[-1].astype(np.int32), numbers[where])
        if numbers.ndim == 1:
            return Content(begin, len(where[0]))
        ends = np.searchsorted(where[0], np.arange(len(numbers) + 1))
        return Content(begin + ends[:-1], np.diff(ends))

    def store_identity(self) -> Content:
        """Keep the rows of an identity matrix."""
        S = self.shape[1]
        begin = self._keep(np.arange(S, dtype=np.int32), np.ones(S))
        return Content(begin + np.arange(S), np.ones(S, dtype=np.int64))

    def _keep(self, columns: npt.NDArray[np.int32], values: Array) -> int:
        begin = self._stored
        self._stored += len(columns)
        self._check_size(self._stored)
        self._columns.append(columns)
        self._values.append(values)
        return begin

    def replace(self, action: int, state: int, content: Content, places: int | Places) -> None:
        """Whole rows: of an action and a state, either of which may be `ALL`.

        A matrix has the state `ALL` and a place for each row.
        """
        if action == state == ALL:  # nothing before it counts any more
            self._whole.clear()
            self.entries.clear()
        # the statement goes to the end of the dictionary, which is in the order of the text
        self._whole.pop((action, state), None)
        self._whole[action, state] = _Whole(places, content)

    def rows(self) -> tuple[SparseTables, Places]:
        """The table, and for each row (A, S) the offset of the statement that last spoke of it, or -1.

        Raises:
            ModelError: it would be too large.
        """
        A, S, _ = self.shape
        places = np.full((A, S), -1, dtype=np.int64)
        begins = np.zeros((A, S), dtype=np.int64)
        lengths = np.zeros((A, S), dtype=np.int64)
        for (a, s), whole in self._whole.items():
            scope = (slice(None) if a == ALL else a, slice(None) if s == ALL else s)
            places[scope] = whole.places
            begins[scope] = whole.content.begin
            lengths[scope] = whole.content.length
        total = int(lengths.sum())
        self._check_size(total)
        row, column, value, at = self._later_entries(places, MAX_NUMBERS - total)
        index = ranges(begins.reshape(-1), lengths.reshape(-1))
        columns = np.concatenate(self._columns or [np.zeros(0, dtype=np.int32)])[index]
        values = np.concatenate(self._values or [np.zeros(0)])[index]
        places.reshape(-1)[row] = at  # of several the last one stays
        if not len(row):
            ends = np.concatenate([[0], np.cumsum(lengths)])
            return SparseTables(self.shape, ends, columns, values), places
        rows = np.repeat(np.arange(A * S), lengths.reshape(-1))
        return SparseTables.of_entries(
            self.shape,
            np.concatenate([rows, row]),
            np.concatenate([columns, column]),
            np.concatenate([values, value]),
        ), places

    def _later_entries(self, places: Places, room: int) -> tuple[Indices, Indices, Array, Places]:
        """Row, column, value and place of each single number that stands after its row's last statement.

        places: (A, S) where that statement is. room: how many numbers there may be.
        """
        A, S, _ = self.shape
        indices, values, at = self.entries.arrays()
        kept = self._worth_writing_out(places)
        action, state, _ = indices[kept].T
        times = np.where(action == ALL, A, 1) * np.where(state == ALL, S, 1)
        total = int(times.sum())
        if total > room:
            self._check_size(total + MAX_NUMBERS - room)
        step = np.arange(total) - np.repeat(np.cumsum(times) - times, times)
        kept = np.repeat(kept, times)
        action, state, column = indices[kept].T
        # the first of an entry's copies is for the first action and state, the next one for the next state
        both = (action == ALL) & (state == ALL)
        row = np.where(action == ALL, np.where(both, step // S, step), action) * S
        row += np.where(state == ALL, np.where(both, step % S, step), state)
        later = np.flatnonzero(at[kept] > places.reshape(-1)[row])
        kept = kept[later]
        return row[later], column[later], values[kept], at[kept]

    def _worth_writing_out(self, places: Places) -> npt.NDArray[np.intp]:
        """Which entries: one with ``*`` is not when it is repeated or comes too early for all its rows."""
        _, S, N = self.shape
        indices, _, at = self.entries.arrays()
        action, state, column = indices.T
        if not ((action == ALL) | (state == ALL)).any():
            return np.arange(len(at))
        late = np.flatnonzero(at > _earliest(places, action, state))
        key = ((action[late] + 1) * (S + 1) + state[late] + 1) * N + column[late]
        return late[last_of_each(key)]

    def _check_size(self, numbers: int) -> None:
        if numbers > MAX_NUMBERS:
            raise ModelError(
                f"the statements of the {self.title} table {self.shape} give {numbers} numbers,"
                f" {12 * numbers / 2**30:.1f} GiB; at most {MAX_NUMBERS} are read"
            )


def ranges(begins: Indices, lengths: Indices) -> Indices:
    """The numbers from each begin on, as many as its length, one range after the other."""
    total = int(lengths.sum())
    shift = begins - (np.cumsum(lengths) - lengths)
    found: Indices = np.repeat(shift, lengths) + np.arange(total)
    return found


def _earliest(places: Places, action: Indices, state: Indices) -> Places:
    """(n,) the least place (A, S) among the rows of each scope."""
    found = places[np.maximum(action, 0), np.maximum(state, 0)]
    found = np.where(action == ALL, places.min(axis=0)[np.maximum(state, 0)], found)
    found = np.where(state == ALL, places.min(axis=1)[np.maximum(action, 0)], found)
    return np.where((action == ALL) & (state == ALL), places.min(), found)
