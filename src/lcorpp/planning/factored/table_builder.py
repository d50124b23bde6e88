"""Builder of sparse tables from statements, of which later ones override earlier ones."""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.factored.table import Table, compute_strides
from lcorpp.planning.factored.variables import ALL, EACH, Scope
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array, Indices

MAX_NUMBERS = 2**26
"""The maximal number of rows, and of numbers, of a table: more do not fit into memory."""

Selector = int | str
"""The index of a value, `ALL` or `EACH`."""


class TableBuilder:
    """A table under construction. A statement overrides the numbers of earlier statements.

    A statement about whole rows also clears them. Only non-zero numbers of statements take memory.
    """

    def __init__(self, scope: Scope, parents: Sequence[str], children: Sequence[str]) -> None:
        self.parents, self.children = tuple(parents), tuple(children)
        self.sizes = tuple(len(scope[name].values) for name in (*parents, *children))
        heights, widths = self.sizes[: len(parents)], self.sizes[len(parents) :]
        self._height, self._width = prod(heights), prod(widths)
        if max(self._height, self._width) > MAX_NUMBERS:
            raise ModelError(
                f"a table of {self._height} rows of {self._width} numbers is too large,"
                f" with over {MAX_NUMBERS}"
            )
        # the index of a cell is row * width + column, a sum of a term for each variable
        self._strides = compute_strides(self.sizes)
        self._turn = 0
        self._cleared = np.full(self._height, -1, dtype=np.int32)  # the last statement about the whole row
        self._single: list[tuple[int, float, int]] = []  # cell, value, turn
        self._blocks: list[tuple[Indices, Array, int]] = []
        self._count = 0

    def put(self, place: Sequence[Selector], values: npt.ArrayLike) -> None:
        """Put numbers.

        Args:
            place: for each parent, then each child, the index of a value, `ALL` or `EACH`.
            values: an axis for each `EACH`, in the order of `place`, or another shape of equal size.
        """
        if EACH not in place and ALL not in place:
            cell = sum(int(s) * t for s, t in zip(place, self._strides, strict=True))
            if not self.children:
                self._cleared[cell] = self._turn
            self._single.append((cell, float(np.asarray(values).reshape(())), self._turn))
            self._turn += 1
            self._count_numbers(1)
            return
        block = np.asarray(values, dtype=np.float64).reshape(-1)
        shape = [n for n, selector in zip(self.sizes, place, strict=True) if selector == EACH]
        kept = np.flatnonzero(block) if self._has_whole_rows(place) else np.arange(len(block))
        self.put_entries(place, np.unravel_index(kept, shape) if shape else (), block[kept])

    def put_entries(self, place: Sequence[Selector], where: Sequence[Indices], values: Array) -> None:
        """Put some numbers (n,) of a block; if the place covers whole rows, all others are zero.

        Args:
            place: as for `put`.
            where: for each `EACH` of the place, (n,) indices of its values.
        """
        turn, self._turn = self._turn, self._turn + 1
        begin = sum(s * t for s, t in zip(place, self._strides, strict=True) if not isinstance(s, str))
        each = np.full(len(values), begin, dtype=np.int64)
        for axis, index in zip((i for i, s in enumerate(place) if s == EACH), where, strict=True):
            each += np.asarray(index, dtype=np.int64) * self._strides[axis]
        if self._has_whole_rows(place):
            self._cleared[self._find_rows(place)] = turn
        terms = self._index_terms([i for i, selector in enumerate(place) if selector == ALL])
        self._count_numbers(len(terms) * len(each))
        cells = (terms[:, None] + each[None, :]).reshape(-1)
        self._blocks.append((cells, np.tile(values, len(terms)), turn))

    def build(self) -> Table:
        """Return the table."""
        kinds = [("cell", np.int64), ("value", np.float64), ("turn", np.int32)]
        single = np.array(self._single, dtype=kinds)
        turns = [np.full(len(cells), turn, dtype=np.int32) for cells, _, turn in self._blocks]
        cell = np.concatenate([*(cells for cells, _, _ in self._blocks), single["cell"]])
        value = np.concatenate([*(values for _, values, _ in self._blocks), single["value"]])
        turn = np.concatenate([*turns, single["turn"]])
        valid = np.flatnonzero(turn >= self._cleared[cell // self._width])
        valid = valid[np.argsort(turn[valid], kind="stable")]  # the last of several numbers of a cell counts
        row, column = np.divmod(cell[valid], self._width)
        rows = SparseTables.of_entries((1, self._height, self._width), row, column, value[valid])
        return Table(self.parents, self.children, self.sizes, rows)

    def _has_whole_rows(self, place: Sequence[Selector]) -> bool:
        return all(isinstance(selector, str) for selector in place[len(self.parents) :])

    def _find_rows(self, place: Sequence[Selector]) -> Indices:
        """Return the rows of a place."""
        parents = place[: len(self.parents)]
        begin = sum(s * t for s, t in zip(parents, self._strides, strict=False) if not isinstance(s, str))
        return (
            begin + self._index_terms([i for i, s in enumerate(parents) if isinstance(s, str)])
        ) // self._width

    def _index_terms(self, axes: Sequence[int]) -> Indices:
        """Return the index terms of all combinations of the values of some variables."""
        if prod(self.sizes[axis] for axis in axes) > MAX_NUMBERS:
            self._count_numbers(MAX_NUMBERS + 1)
        terms = np.zeros(1, dtype=np.int64)
        for axis in axes:
            steps = np.arange(self.sizes[axis], dtype=np.int64) * self._strides[axis]
            terms = (terms[:, None] + steps).reshape(-1)
        return terms

    def _count_numbers(self, count: int) -> None:
        self._count += count
        if self._count > MAX_NUMBERS:
            raise ModelError(
                f"a table over {', '.join((*self.parents, *self.children))} has over {MAX_NUMBERS} numbers"
            )
