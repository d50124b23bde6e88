"""A table in few entries, as people would write it: what holds mostly, then the exceptions.

Rows that hold the same numbers get the same kind, so that a table is an array of kinds with an axis for each
parent. Where several values of a variable lead to the same, one entry with ``*`` speaks of all of them, and
entries after it of those that differ.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from lcorpp.planning.factored.table import Table
from lcorpp.planning.factored.variables import ALL, EACH, Scope
from lcorpp.values import Array

SHARE = 16
"""Rows are written whole where at least one number in so many is above 0: an entry takes the room of as many
zeros."""

BLOCK = 64
"""The most numbers in an entry that gives the rows for all values of the last parent."""

Kinds = npt.NDArray[np.int32]

Place = list[int | str]
"""For each parent the number of a value, or `ALL`."""

Entry = tuple[list[str], str]
"""The words of an ``<Instance>``, and what stands in the table beside it."""

_NOTHING = -1


def entries(table: Table, scope: Scope) -> Iterator[Entry]:
    """The entries of a table; of those about the same number the later one counts."""
    writer = _Writer(table, scope)
    if not table.children:
        return writer.rewards()
    rows = table.rows
    few_zeros = rows.shape[1] * rows.shape[2] <= SHARE * len(rows.values)
    return writer.rows() if few_zeros else writer.numbers()


class _Writer:
    """A table as it is written. kinds: of its rows, see `_kinds`. content: columns and values of each."""

    def __init__(self, table: Table, scope: Scope) -> None:
        self.table, self.width = table, table.rows.shape[2]
        self.values = [scope[name].values for name in (*table.parents, *table.children)]
        self.kinds, first = _kinds(table)
        self.content = [table.rows.row(0, row) for row in first]

    def rewards(self) -> Iterator[Entry]:
        """One number each; what no entry speaks of is 0."""
        zero = next((kind for kind, (columns, _) in enumerate(self.content) if not len(columns)), _NOTHING)
        for place, kind, _ in _cover(self.kinds, np.full_like(self.kinds, zero)):
            yield self._named(place), repr(float(self.content[kind][1].sum()))

    def rows(self) -> Iterator[Entry]:
        """Whole rows, with their zeros."""
        dense = [self._dense(kind) for kind in range(len(self.content))]
        each = [EACH] * len(self.table.children)
        places = [(place, kind) for place, kind, _ in _cover(self.kinds, np.full_like(self.kinds, _NOTHING))]
        for place, block in _blocks(places, self.kinds.shape, self.width):
            numbers = np.concatenate([dense[kind] for kind in block])
            if not self.table.parents and (numbers == 1 / self.width).all():
                text = "uniform"
            elif (
                len(block) > 1 and len(each) == 1 and np.array_equal(numbers, np.eye(self.width).reshape(-1))
            ):
                text = "identity"
            else:
                text = " ".join(map(repr, numbers.tolist()))
            yield [*self._named(place), *each], text

    def numbers(self) -> Iterator[Entry]:
        """What is above 0, one number each, and the zeros that take away what was there before."""
        sizes = self.table.shape[len(self.table.parents) :]
        for place, kind, before in _cover(self.kinds, np.full_like(self.kinds, _NOTHING)):
            found = dict.fromkeys((c for old in before for c in self.content[old][0].tolist()), 0.0)
            found |= dict(zip(*(array.tolist() for array in self.content[kind]), strict=True))
            for column, value in found.items():
                yield self._named([*place, *map(int, np.unravel_index(column, sizes))]), repr(value)

    def _named(self, place: Sequence[int | str]) -> list[str]:
        return [s if isinstance(s, str) else names[s] for s, names in zip(place, self.values, strict=False)]

    def _dense(self, kind: int) -> Array:
        row = np.zeros(self.width)
        row[self.content[kind][0]] = self.content[kind][1]
        return row


def _kinds(table: Table) -> tuple[Kinds, list[int]]:
    """The kind of each row, an axis for each parent; and of each kind the first row."""
    begins, columns, values = (a.tolist() for a in (table.rows.begins, table.rows.columns, table.rows.values))
    known: dict[tuple[tuple[int, ...], tuple[float, ...]], int] = {}
    kinds = np.empty(len(begins) - 1, dtype=np.int32)
    first: list[int] = []
    for row in range(len(kinds)):
        part = slice(begins[row], begins[row + 1])
        kind = known.setdefault((tuple(columns[part]), tuple(values[part])), len(known))
        if kind == len(first):
            first.append(row)
        kinds[row] = kind
    return kinds.reshape(table.shape[: len(table.parents)]), first


def _cover(kinds: Kinds, force: Kinds) -> Iterator[tuple[Place, int, list[int]]]:
    """Entries that turn what is in force into the kinds.

    Args:
        kinds, force: an axis for each parent.

    Returns:
        For each entry its place, the kind that is to hold there and those in force there until then.
    """
    if np.array_equal(kinds, force):
        return
    if kinds.min() == kinds.max():
        yield [ALL] * kinds.ndim, int(kinds.flat[0]), [k for k in np.unique(force).tolist() if k != _NOTHING]
        return
    if (force == force[0]).all():
        slices = [part.tobytes() for part in kinds]
        common, count = Counter(slices).most_common(1)[0]
        if 2 * count > len(slices):
            mostly = kinds[slices.index(common)]
            for place, kind, before in _cover(mostly, force[0]):
                yield [ALL, *place], kind, before
            force = np.broadcast_to(mostly, kinds.shape)
    for i, (part, held) in enumerate(zip(kinds, force, strict=True)):
        for place, kind, before in _cover(part, held):
            yield [i, *place], kind, before


def _blocks(
    places: Sequence[tuple[Place, int]], shape: tuple[int, ...], width: int
) -> Iterator[tuple[Place, list[int]]]:
    """The entries, those joined that follow each other for all values of the last parent."""
    size = shape[-1] if shape else 1
    at = 0
    while at < len(places):
        place, kind = places[at]
        run = places[at : at + size]
        if 1 < size <= BLOCK // width and [p for p, _ in run] == [[*place[:-1], i] for i in range(size)]:
            yield [*place[:-1], EACH], [k for _, k in run]
            at += size
        else:
            yield place, [kind]
            at += 1
