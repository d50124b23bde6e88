"""Tables of probabilities with one row for each action and state, zeros left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.values import Array

Int32Array = npt.NDArray[np.int32]
Int64Array = npt.NDArray[np.int64]

_Kind = TypeVar("_Kind", bound=np.generic)

MAX_BYTES = 2**31
"""The largest table that is made, dense or not."""


def _frozen(array: npt.NDArray[_Kind]) -> npt.NDArray[_Kind]:
    array.setflags(write=False)
    return array


def _odd(array: npt.NDArray[Any], given: npt.NDArray[Any]) -> object:
    """The first number given that came to be another."""
    return given[array != given].flat[0] if array.shape == given.shape else given.shape


@dataclass(frozen=True, eq=False)
class SparseTables:
    """An (A, R, N) table in compressed rows: row (a, r) has the entries begins[a R + r] to the next one's.

    shape: (A, R, N).
    begins: (A R + 1,) where the entries of each row begin.
    columns: (entries,) rising within a row. values: (entries,) zeros among them are dropped.

    `table[a]`, `table[a, r]` and `np.asarray(table)` give what a dense array would.

    Raises:
        ModelError: the arrays do not fit together.
    """

    shape: tuple[int, int, int]
    begins: Int64Array
    columns: Int32Array
    values: Array

    def __post_init__(self) -> None:
        A, R, N = self.shape
        for field, kind in (("begins", np.int64), ("columns", np.int32), ("values", np.float64)):
            given = np.asarray(getattr(self, field))
            with np.errstate(invalid="ignore"):  # what does not fit is told below
                array = np.ascontiguousarray(given, dtype=kind)
            if field != "values" and not np.array_equal(array, given):
                most = 2**31 - 1 if field == "columns" else 2**63 - 1
                raise ModelError(f"{field} are whole numbers up to {most}, not {_odd(array, given)}")
            if array is getattr(self, field) and array.flags.writeable:
                array = array.copy()
            array.setflags(write=False)
            object.__setattr__(self, field, array)
        begins, columns = self.begins, self.columns
        fits = (
            begins.shape == (A * R + 1,)
            and begins[0] == 0
            and begins[-1] == len(columns) == len(self.values)
            and (np.diff(begins) >= 0).all()
            and (not len(columns) or (columns.min() >= 0 and columns.max() < N))
        )
        if not fits:
            raise ModelError(f"rows of shape {begins.shape} and {columns.shape} are no table {self.shape}")
        inner = np.ones(len(columns), dtype=bool)
        inner[begins[:-1][np.diff(begins) > 0]] = False
        if (np.diff(columns, prepend=0)[inner] <= 0).any():
            raise ModelError("the columns of a row must rise")
        if not self.values.all():
            kept = self.values != 0
            object.__setattr__(self, "begins", _frozen(np.concatenate([[0], np.cumsum(kept)])[begins]))
            object.__setattr__(self, "columns", _frozen(columns[kept]))
            object.__setattr__(self, "values", _frozen(self.values[kept]))

    @classmethod
    def of(cls, table: object) -> SparseTables:
        """From rows, a dense array (A, R, N), or A matrices (R, N), dense or of scipy.sparse.

        Raises:
            ModelError: the shape is not that of a table.
        """
        if isinstance(table, SparseTables):
            return table
        if isinstance(table, Sequence) and len(table) and all(hasattr(m, "tocsr") for m in table):
            return cls._of_matrices(table)
        try:
            dense = np.asarray(table, dtype=np.float64)
        except (TypeError, ValueError):
            raise ModelError("a table is an array of numbers (actions, rows, columns)") from None
        if dense.ndim != 3:
            raise ModelError(f"a table has the shape (actions, rows, columns), not {dense.shape}")
        flat = dense.reshape(-1, dense.shape[2])
        row, column = np.nonzero(flat)
        begins = np.searchsorted(row, np.arange(len(flat) + 1))
        return cls(dense.shape, begins, column.astype(np.int32), flat[row, column])

    @classmethod
    def _of_matrices(cls, matrices: Sequence[Any]) -> SparseTables:
        parts = [matrix.tocsr(copy=True) for matrix in matrices]
        for part in parts:
            part.sum_duplicates()
            part.eliminate_zeros()
            if part.shape != parts[0].shape:
                raise ModelError(f"matrices of a table have one shape, not {parts[0].shape} and {part.shape}")
        ends = np.cumsum([0, *(part.nnz for part in parts)])
        begins = [part.indptr[:-1].astype(np.int64) + end for part, end in zip(parts, ends[:-1], strict=True)]
        return cls(
            (len(parts), *parts[0].shape),
            np.concatenate([*begins, ends[-1:]]),
            np.concatenate([part.indices for part in parts]).astype(np.int32),
            np.concatenate([part.data for part in parts]),
        )

    @classmethod
    def of_entries(
        cls, shape: tuple[int, int, int], row: npt.ArrayLike, column: npt.ArrayLike, value: npt.ArrayLike
    ) -> SparseTables:
        """From entries (n,) in any order, row being a R + r; of those at one place the last one counts."""
        rows = np.asarray(row, dtype=np.int64)
        columns = np.asarray(column, dtype=np.int64)
        values = np.asarray(value, dtype=np.float64)
        key = rows * shape[2] + columns
        order = np.argsort(key, kind="stable")
        last = np.append(key[order][1:] != key[order][:-1], True) if len(key) else np.zeros(0, dtype=bool)
        order = order[last]
        order = order[values[order] != 0]
        begins = np.searchsorted(rows[order], np.arange(shape[0] * shape[1] + 1))
        return cls(shape, begins, columns[order].astype(np.int32), values[order])

    def __getitem__(self, key: Any) -> Any:
        return self.dense[key]

    def __len__(self) -> int:
        return self.shape[0]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return np.array(self.dense, dtype=dtype) if copy else np.asarray(self.dense, dtype=dtype)

    @cached_property
    def dense(self) -> Array:
        """(A, R, N) the table with its zeros, made when first asked for.

        Raises:
            ModelError: it would be too large.
        """
        size = 8 * int(np.prod(self.shape, dtype=np.int64))
        if size > MAX_BYTES:
            raise ModelError(
                f"the table {self.shape} written out takes {size / 2**30:.1f} GiB;"
                f" at most {MAX_BYTES / 2**30:.0f} GiB are made"
            )
        table = np.zeros((self.shape[0] * self.shape[1], self.shape[2]))
        table[self.rows, self.columns] = self.values
        table = table.reshape(self.shape)
        table.setflags(write=False)
        return table

    @cached_property
    def rows(self) -> npt.NDArray[np.intp]:
        """(entries,) the row a R + r of each entry."""
        return np.repeat(np.arange(len(self.begins) - 1), np.diff(self.begins))

    def action_slice(self, action: int) -> slice:
        """Where the entries of an action are."""
        R = self.shape[1]
        return slice(int(self.begins[action * R]), int(self.begins[(action + 1) * R]))

    def row(self, action: int, row: int) -> tuple[Int32Array, Array]:
        """The columns and values of one row."""
        at = action * self.shape[1] + row
        part = slice(int(self.begins[at]), int(self.begins[at + 1]))
        return self.columns[part], self.values[part]

    def column(self, action: int, column: int) -> tuple[npt.NDArray[np.intp], Array]:
        """The rows, rising, and the values of one column of an action."""
        begins, rows, values = self._by_column
        at = action * self.shape[2] + column
        part = slice(begins[at], begins[at + 1])
        return rows[part], values[part]

    def forward(self, action: int, weights: Array) -> Array:
        """(N,) the sum over r of weights (R,) times row (action, r)."""
        rows, columns, values = self._parts[action]
        return np.asarray(np.bincount(columns, values * weights[rows], self.shape[2]), dtype=np.float64)

    def backward(self, action: int, worth: Array) -> Array:
        """(R,) the product of each row of an action with worth (N,)."""
        rows, columns, values = self._parts[action]
        return np.asarray(np.bincount(rows, values * worth[columns], self.shape[1]), dtype=np.float64)

    @cached_property
    def _parts(self) -> list[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp], Array]]:
        """For each action the row within it, the column and the value of each entry."""
        A, R, _ = self.shape
        rows, columns = self.rows % R, self.columns.astype(np.intp)
        return [(rows[part], columns[part], self.values[part]) for part in map(self.action_slice, range(A))]

    @cached_property
    def _by_column(self) -> tuple[list[int], npt.NDArray[np.intp], Array]:
        A, R, N = self.shape
        key = self.rows // R * N + self.columns
        order = np.argsort(key, kind="stable")
        begins = np.searchsorted(key[order], np.arange(A * N + 1))
        return begins.tolist(), (self.rows % R)[order], self.values[order]

    def row_sums(self) -> Array:
        """(A, R) what each row adds up to."""
        sums = np.bincount(self.rows, self.values, minlength=len(self.begins) - 1)
        return np.asarray(sums, dtype=np.float64).reshape(self.shape[:2])

    def scale_rows(self, factors: Array) -> SparseTables:
        """Every row times its factor (A, R)."""
        return SparseTables(
            self.shape, self.begins, self.columns, self.values * factors.reshape(-1)[self.rows]
        )
