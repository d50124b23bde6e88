"""Represent a table by few PomdpX entries: a general rule, then its exceptions.

Equal rows get the same class, so a table becomes an array of classes with one axis for each parent. If most
values of a variable have the same rows, one entry with ``*`` covers all of them, and later entries override
the rest.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from lcorpp.planning.factored.table import Table
from lcorpp.planning.factored.variables import ALL, EACH, Scope

SPARSE_RATIO = 16
"""A table with fewer than one nonzero in this many numbers is written number by number."""

MAX_BLOCK_NUMBERS = 64
"""Maximum length of an entry that contains the rows of all values of the last parent."""

RowClasses = npt.NDArray[np.int32]

Place = list[int | str]
"""For each parent the index of a value, or `ALL`."""

Entry = tuple[list[str], str]
"""The words of an ``<Instance>`` and the text of its table."""

_UNSET = -1


def compact_entries(table: Table, scope: Scope) -> Iterator[Entry]:
    """Return the entries of a table; a later entry overrides earlier ones."""
    writer = _EntryWriter(table, scope)
    if not table.children:
        return writer.make_reward_entries()
    rows = table.rows
    is_dense = rows.shape[1] * rows.shape[2] <= SPARSE_RATIO * len(rows.values)
    return writer.make_row_entries() if is_dense else writer.make_number_entries()


class _EntryWriter:
    """Writes one table. classes: of its rows, see `_classify_rows`. content: columns and values by class."""

    def __init__(self, table: Table, scope: Scope) -> None:
        self.table, self.width = table, table.rows.shape[2]
        self.values = [scope[name].values for name in (*table.parents, *table.children)]
        self.classes, first = _classify_rows(table)
        self.content = [table.rows.row(0, row) for row in first]

    def make_reward_entries(self) -> Iterator[Entry]:
        """Yield an entry for each number; 0 needs none, so all rows begin in the class of empty rows."""
        zero = next((k for k, (columns, _) in enumerate(self.content) if not len(columns)), _UNSET)
        for place, row_class, _ in self._find_changes(zero):
            yield self._format_place(place), repr(float(self.content[row_class][1].sum()))

    def make_row_entries(self) -> Iterator[Entry]:
        """Yield whole rows, with their zeros."""
        dense = np.zeros((len(self.content), self.width))
        for row, (columns, values) in zip(dense, self.content, strict=True):
            row[columns] = values
        each = [EACH] * len(self.table.children)
        places = [(place, row_class) for place, row_class, _ in self._find_changes(_UNSET)]
        for place, block in _join_blocks(places, self.classes.shape, self.width):
            rows = dense[block]
            if not self.table.parents and (rows == 1 / self.width).all():
                text = "uniform"
            elif len(block) > 1 and len(each) == 1 and np.array_equal(rows, np.eye(self.width)):
                text = "identity"
            else:
                text = " ".join(map(repr, rows.reshape(-1).tolist()))
            yield [*self._format_place(place), *each], text

    def make_number_entries(self) -> Iterator[Entry]:
        """Yield an entry for each nonzero number, and for the zeros that override earlier entries."""
        sizes = self.table.shape[len(self.table.parents) :]
        for place, row_class, overridden in self._find_changes(_UNSET):
            numbers = dict.fromkeys((c for k in overridden for c in self.content[k][0].tolist()), 0.0)
            columns, values = self.content[row_class]
            numbers |= dict(zip(columns.tolist(), values.tolist(), strict=True))
            for column, value in numbers.items():
                yield self._format_place([*place, *map(int, np.unravel_index(column, sizes))]), repr(value)

    def _find_changes(self, initial: int) -> Iterator[tuple[Place, int, list[int]]]:
        return _find_entries(self.classes, np.full_like(self.classes, initial))

    def _format_place(self, place: Sequence[int | str]) -> list[str]:
        return [s if isinstance(s, str) else names[s] for s, names in zip(place, self.values, strict=False)]


def _classify_rows(table: Table) -> tuple[RowClasses, list[int]]:
    """Return the class of each row, with an axis for each parent; and the first row of each class."""
    begins, columns, values = (a.tolist() for a in (table.rows.begins, table.rows.columns, table.rows.values))
    known: dict[tuple[tuple[int, ...], tuple[float, ...]], int] = {}
    classes = np.empty(len(begins) - 1, dtype=np.int32)
    first: list[int] = []
    for row in range(len(classes)):
        part = slice(begins[row], begins[row + 1])
        row_class = known.setdefault((tuple(columns[part]), tuple(values[part])), len(known))
        if row_class == len(first):
            first.append(row)
        classes[row] = row_class
    return classes.reshape(table.shape[: len(table.parents)]), first


def _find_entries(classes: RowClasses, current: RowClasses) -> Iterator[tuple[Place, int, list[int]]]:
    """Find entries that change the current row classes into the given ones.

    Args:
        classes, current: one axis for each parent.

    Returns:
        For each entry its place, its row class and the row classes that it overrides.
    """
    if np.array_equal(classes, current):
        return
    if classes.min() == classes.max():  # also if no parents are left
        overridden = [k for k in np.unique(current).tolist() if k != _UNSET]
        yield [ALL] * classes.ndim, int(classes.flat[0]), overridden
        return
    if (current == current[0]).all():  # it does not depend on the first parent
        slices = [part.tobytes() for part in classes]
        most_common, count = Counter(slices).most_common(1)[0]
        if 2 * count > len(slices):
            common = classes[slices.index(most_common)]
            for place, row_class, overridden in _find_entries(common, current[0]):
                yield [ALL, *place], row_class, overridden
            current = np.broadcast_to(common, classes.shape)
    for i, (part, current_part) in enumerate(zip(classes, current, strict=True)):
        for place, row_class, overridden in _find_entries(part, current_part):
            yield [i, *place], row_class, overridden


def _join_blocks(
    places: Sequence[tuple[Place, int]], shape: tuple[int, ...], width: int
) -> Iterator[tuple[Place, list[int]]]:
    """Join consecutive entries for all values of the last parent into one."""
    size = shape[-1] if shape else 1
    joins = 1 < size <= MAX_BLOCK_NUMBERS // width
    start = 0
    while start < len(places):
        place, row_class = places[start]
        run = places[start : start + size]
        if joins and [p for p, _ in run] == [[*place[:-1], i] for i in range(size)]:
            yield [*place[:-1], EACH], [k for _, k in run]
            start += size
        else:
            yield place, [row_class]
            start += 1
