"""Sparse tables (A, R, N), one matrix in compressed rows for each action."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.values import Array, Indices

Int32Array = npt.NDArray[np.int32]
Int64Array = npt.NDArray[np.int64]
_Scalar = TypeVar("_Scalar", bound=np.generic)

MAX_BYTES = 2**31
"""The maximal size of a dense table."""


@dataclass(frozen=True, eq=False)
class SparseTables:
    """A table (A, R, N) in compressed sparse rows; row (a, r) is stored as row a R + r.

    shape: (A, R, N).
    begins: (A R + 1,) the entries of row i are begins[i] to begins[i + 1] (`indptr` in scipy).
    columns: (entries,) increasing within a row. values: (entries,) zeros are dropped.

    `table[a]`, `table[a, r]` and `np.asarray(table)` return dense arrays.

    Raises:
        ModelError: the arrays do not have matching shapes and values.

    Examples:
        >>> from lcorpp.planning import SparseTables
        >>> table = SparseTables.of([[[1, 0], [0.1, 0.9]]])  # one action, two states
        >>> table.shape, table[0, 1].tolist()
        ((1, 2, 2), [0.1, 0.9])
    """

    shape: tuple[int, int, int]
    begins: Int64Array
    columns: Int32Array
    values: Array

    def __post_init__(self) -> None:
        A, R, N = self.shape
        for field, kind in (("begins", np.int64), ("columns", np.int32), ("values", np.float64)):
            original = np.asarray(getattr(self, field))
            with np.errstate(invalid="ignore"):  # a change of the value is an error, below
                array = np.ascontiguousarray(original, dtype=kind)
            if field != "values" and not np.array_equal(array, original):
                limit = 2**31 - 1 if field == "columns" else 2**63 - 1
                same_shape = array.shape == original.shape
                wrong = original[array != original].flat[0] if same_shape else original.shape
                raise ModelError(f"{field} are whole numbers up to {limit}, not {wrong}")
            if array is getattr(self, field) and array.flags.writeable:
                array = array.copy()
            array.setflags(write=False)
            object.__setattr__(self, field, array)
        begins, columns = self.begins, self.columns
        valid = (
            begins.shape == (A * R + 1,)
            and begins[0] == 0
            and begins[-1] == len(columns) == len(self.values)
            and (np.diff(begins) >= 0).all()
            and (not len(columns) or (columns.min() >= 0 and columns.max() < N))
        )
        if not valid:
            raise ModelError(f"rows of shape {begins.shape} and {columns.shape} are not a table {self.shape}")
        inner = np.ones(len(columns), dtype=bool)
        inner[begins[:-1][np.diff(begins) > 0]] = False
        if (np.diff(columns, prepend=0)[inner] <= 0).any():
            raise ModelError("the columns of a row must increase")
        if not self.values.all():
            kept = self.values != 0
            object.__setattr__(self, "begins", _freeze(np.concatenate([[0], np.cumsum(kept)])[begins]))
            object.__setattr__(self, "columns", _freeze(columns[kept]))
            object.__setattr__(self, "values", _freeze(self.values[kept]))

    @classmethod
    def of(cls, table: object) -> SparseTables:
        """Convert a dense array (A, R, N) or A matrices (R, N), dense or of scipy.sparse.

        Raises:
            ModelError: the shape is not (A, R, N).
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
        from scipy.sparse import vstack

        shape = matrices[0].shape
        for matrix in matrices:
            if matrix.shape != shape:
                raise ModelError(
                    f"the matrices of a table must have equal shapes, not {shape} and {matrix.shape}"
                )
        stack = vstack([matrix.tocsr() for matrix in matrices], format="csr")
        stack.sum_duplicates()
        return cls((len(matrices), *shape), stack.indptr, stack.indices, stack.data)

    @classmethod
    def of_entries(
        cls, shape: tuple[int, int, int], row: npt.ArrayLike, column: npt.ArrayLike, value: npt.ArrayLike
    ) -> SparseTables:
        """Return the table of entries (n,); `row` is a R + r, and the last of duplicate entries counts."""
        rows = np.asarray(row, dtype=np.int64)
        columns, values = np.asarray(column, dtype=np.int64), np.asarray(value, dtype=np.float64)
        return cls.of_parts(shape, [sort_entries(rows, columns, values, shape[0] * shape[1], shape[2])])

    @classmethod
    def of_parts(
        cls, shape: tuple[int, int, int], parts: list[tuple[Int64Array, npt.NDArray[np.integer], Array]]
    ) -> SparseTables:
        """Return the table of consecutive rows in parts; the list is emptied.

        Args:
            parts: for each part the end of each row in it (n,), and columns and values of its entries.
        """
        sizes = [len(columns) for _, columns, _ in parts]
        offsets = np.cumsum([0, *sizes[:-1]])
        begins = np.concatenate([[0], *(ends + at for (ends, _, _), at in zip(parts, offsets, strict=True))])
        columns, values = np.empty(sum(sizes), dtype=np.int32), np.empty(sum(sizes))
        for at in reversed(offsets.tolist()):  # each part is released when it has been copied
            _, part_columns, part_values = parts.pop()
            columns[at : at + len(part_columns)] = part_columns
            values[at : at + len(part_values)] = part_values
        return cls(shape, *(_freeze(array) for array in (begins, columns, values)))

    def __repr__(self) -> str:
        return f"<SparseTables {' x '.join(map(str, self.shape))}, {len(self.values)} entries>"

    def __getitem__(self, key: Any) -> Any:
        return self.dense[key]

    def __len__(self) -> int:
        return self.shape[0]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return np.array(self.dense, dtype=dtype) if copy else np.asarray(self.dense, dtype=dtype)

    @property
    def memory_size(self) -> int:
        """Memory in bytes."""
        return self.begins.nbytes + self.columns.nbytes + self.values.nbytes

    @cached_property
    def dense(self) -> Array:
        """(A, R, N) the dense table, computed on first use.

        Raises:
            ModelError: it is larger than `MAX_BYTES`.
        """
        size = 8 * int(np.prod(self.shape, dtype=np.int64))
        if size > MAX_BYTES:
            raise ModelError(
                f"the dense table {self.shape} takes {size / 2**30:.1f} GiB;"
                f" the limit is {MAX_BYTES / 2**30:.0f} GiB"
            )
        table = np.zeros((self.shape[0] * self.shape[1], self.shape[2]))
        table[self.rows, self.columns] = self.values
        table = table.reshape(self.shape)
        table.setflags(write=False)
        return table

    @cached_property
    def rows(self) -> Indices:
        """(entries,) the row a R + r of each entry."""
        return np.repeat(np.arange(len(self.begins) - 1), np.diff(self.begins))

    def action_slice(self, action: int) -> slice:
        """Return the slice of the entries of an action."""
        R = self.shape[1]
        return slice(int(self.begins[action * R]), int(self.begins[(action + 1) * R]))

    def matrix(self, action: int) -> Any:
        """Return the matrix (R, N) of an action, as `scipy.sparse.csr_array`."""
        from scipy.sparse import csr_array  # it takes memory and time to import

        part, rows = self.action_slice(action), self.shape[1]
        begins = self.begins[action * rows : (action + 1) * rows + 1]
        return csr_array((self.values[part], self.columns[part], begins - begins[0]), shape=self.shape[1:])

    def row(self, action: int, row: int) -> tuple[Int32Array, Array]:
        """Return the columns and values of one row."""
        at = action * self.shape[1] + row
        part = slice(int(self.begins[at]), int(self.begins[at + 1]))
        return self.columns[part], self.values[part]

    def column(self, action: int, column: int) -> tuple[Indices, Array]:
        """Return the rows, increasing, and the values of one column of an action."""
        begins, rows, values = self._by_column
        at = action * self.shape[2] + column
        part = slice(begins[at], begins[at + 1])
        return rows[part], values[part]

    def row_entries(self, rows: npt.NDArray[np.integer]) -> tuple[Int64Array, Indices]:
        """Return the indices (k,) of the entries of rows a R + r (n,), and their positions in `rows` (k,)."""
        sizes = self.begins[rows + 1] - self.begins[rows]
        return ragged_indices(self.begins[rows], sizes), np.repeat(np.arange(len(rows)), sizes)

    def forward(self, action: int, weights: Array) -> Array:
        """Return (N,) the weights (R,) times the matrix of an action."""
        rows, columns, values = self._parts[action]
        return np.asarray(np.bincount(columns, values * weights[rows], self.shape[2]), dtype=np.float64)

    def forward_many(self, actions: Indices, weights: Array) -> Array:
        """Return (n, N) each row of weights (n, R) times the matrix of its action (n,)."""
        n, N = len(weights), self.shape[2]
        i, r = np.nonzero(weights)
        entries, position = self.row_entries(actions[i] * self.shape[1] + r)
        products = self.values[entries] * weights[i, r][position]
        sums = np.bincount(i[position] * N + self.columns[entries], products, n * N)
        return np.asarray(sums, dtype=np.float64).reshape(n, N)

    def backward(self, action: int, column: Array) -> Array:
        """Return (R,) the matrix of an action times a column vector (N,)."""
        rows, columns, values = self._parts[action]
        return np.asarray(np.bincount(rows, values * column[columns], self.shape[1]), dtype=np.float64)

    @cached_property
    def _parts(self) -> list[tuple[Indices, Indices, Array]]:
        """For each action the rows, columns and values of its entries."""
        A, R, _ = self.shape
        rows, columns = self.rows % R, self.columns.astype(np.intp)
        return [(rows[part], columns[part], self.values[part]) for part in map(self.action_slice, range(A))]

    @cached_property
    def _by_column(self) -> tuple[list[int], Indices, Array]:
        A, R, N = self.shape
        key = self.rows // R * N + self.columns
        order = np.argsort(key, kind="stable")
        begins = np.searchsorted(key[order], np.arange(A * N + 1))
        return begins.tolist(), (self.rows % R)[order], self.values[order]

    def row_sums(self) -> Array:
        """Return (A, R) the sum of each row."""
        A, R, _ = self.shape
        sums = np.empty((A, R))
        for a in range(A):  # the row of each entry needs as much memory as the values
            rows = np.repeat(np.arange(R), np.diff(self.begins[a * R : (a + 1) * R + 1]))
            sums[a] = np.bincount(rows, self.values[self.action_slice(a)], minlength=R)
        return sums

    def scale_rows(self, factors: Array) -> SparseTables:
        """Return the table with each row multiplied by its factor (A, R)."""
        return SparseTables(
            self.shape, self.begins, self.columns, self.values * factors.reshape(-1)[self.rows]
        )


def joint_matrix(
    transition: SparseTables, observation: SparseTables, action: int
) -> tuple[Any, Int64Array, Int64Array]:
    """Return P(s', o | s, a) of an action as a sparse matrix, and the observation and state of its rows.

    The matrix (k, S) has a column for each s' and a row for each of the k possible pairs (o, s), by rising o.
    """
    from scipy.sparse import csr_array

    T, Z, S = transition, observation, transition.shape[1]
    part = T.action_slice(action)
    z_entry, offset = Z.row_entries(action * S + T.columns[part].astype(np.int64))
    t_entry = part.start + offset
    keys = Z.columns[z_entry] * np.int64(S) + T.rows[t_entry] - action * S
    pairs, row = np.unique(keys, return_inverse=True)
    entries = T.values[t_entry] * Z.values[z_entry], (row, T.columns[t_entry])
    return csr_array(entries, shape=(len(pairs), S)), *np.divmod(pairs, S)


def sort_entries(
    rows: Int64Array, columns: npt.NDArray[np.integer], values: Array, n_rows: int, n_columns: int
) -> tuple[Int64Array, npt.NDArray[np.integer], Array]:
    """Sort the entries (n,) of some rows; the last of duplicate entries counts, zeros are dropped.

    Returns:
        The end of each row (n_rows,), and columns and values of the entries.
    """
    key = rows * n_columns + columns
    if not (np.diff(key) > 0).all():
        order = np.argsort(key, kind="stable")
        order = order[np.append(np.diff(key[order]) != 0, True)]
        rows, columns, values = rows[order], columns[order], values[order]
    if not values.all():
        kept = values != 0
        rows, columns, values = rows[kept], columns[kept], values[kept]
    return np.searchsorted(rows, np.arange(n_rows), side="right"), columns, values


def ragged_indices(begins: npt.NDArray[np.integer], sizes: npt.NDArray[np.integer]) -> Int64Array:
    """Return the ranges begins[i] to begins[i] + sizes[i], one after the other."""
    ends = np.cumsum(sizes)
    total = int(ends[-1]) if len(ends) else 0
    indices: Int64Array = np.arange(total, dtype=np.int64) + np.repeat(begins - (ends - sizes), sizes)
    return indices


def _freeze(array: npt.NDArray[_Scalar]) -> npt.NDArray[_Scalar]:
    array.setflags(write=False)
    return array
