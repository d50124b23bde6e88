"""The tables of a factored problem: numbers for combinations of values, zeros left out."""

from __future__ import annotations

from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.factored.variables import Scope, described
from lcorpp.planning.pomdp import SUM_TOLERANCE
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class Table:
    """P(children | parents), or a reward for the values of the parents when there are no children.

    parents, children: names of variables; ``x`` is a part of the state before the action, ``x'`` after it.
    shape: the number of values of each parent, then of each child.
    rows: (1, combinations of the parents, combinations of the children), the last variable counting
        fastest; without children there is one column, the reward.

    `np.asarray(table)` is the dense array of `shape`.

    Raises:
        ModelError: the parts do not fit together.
    """

    parents: tuple[str, ...]
    children: tuple[str, ...]
    shape: tuple[int, ...]
    rows: SparseTables

    def __post_init__(self) -> None:
        for field in ("parents", "children", "shape"):
            object.__setattr__(self, field, tuple(getattr(self, field)))
        names = (*self.parents, *self.children)
        if len(set(names)) != len(names):
            twice = next(name for i, name in enumerate(names) if name in names[:i])
            raise ModelError(f"a table names {twice!r} twice")
        height, width = self.shape[: len(self.parents)], self.shape[len(self.parents) :]
        if len(self.shape) != len(names) or self.rows.shape != (1, prod(height), prod(width)):
            raise ModelError(f"rows {self.rows.shape} are no table of {', '.join(names)}: {self.shape}")

    @classmethod
    def of(cls, parents: tuple[str, ...], children: tuple[str, ...], values: npt.ArrayLike) -> Table:
        """From a dense array with an axis for each parent, then for each child."""
        array = np.asarray(values, dtype=np.float64)
        height = prod(array.shape[: len(parents)])
        return cls(parents, children, array.shape, SparseTables.of(array.reshape(1, height, -1)))

    @property
    def strides(self) -> tuple[int, ...]:
        """By how much the number of a row grows with the value of each parent."""
        sizes = self.shape[: len(self.parents)]
        return tuple(prod(sizes[i + 1 :]) for i in range(len(sizes)))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return np.asarray(self.rows.dense, dtype=dtype).reshape(self.shape)

    def reward(self, row: npt.NDArray[np.int64]) -> Array:
        """(n,) the rewards in rows (n,) of a table without children."""
        begins, values = self.rows.begins, np.append(self.rows.values, 0.0)
        filled = begins[row + 1] > begins[row]
        return np.where(filled, values[np.where(filled, begins[row], -1)], 0.0)

    def same(self, other: Table) -> bool:
        """Whether both hold the same numbers, bit for bit, for the same variables."""
        return (
            (self.parents, self.children, self.shape) == (other.parents, other.children, other.shape)
            and np.array_equal(self.rows.begins, other.rows.begins)
            and np.array_equal(self.rows.columns, other.rows.columns)
            and np.array_equal(self.rows.values, other.rows.values)
        )


def check_distributions(table: Table, scope: Scope, what: str) -> None:
    """Refuse a table with a row that is no distribution; the row is named.

    Raises:
        ModelError: a probability is negative, or a row does not sum to 1.
    """
    rows = table.rows
    if len(rows.values) and not rows.values.min() >= 0:
        at = int(rows.values.argmin())
        row = row_name(table, scope, int(rows.rows[at]))
        raise ModelError(f"{what}{row} has a negative probability, {rows.values[at]:.10g}")
    sums = rows.row_sums()[0]
    off = np.abs(sums - 1)
    if off.max() > SUM_TOLERANCE:
        worst = int(off.argmax())
        row = row_name(table, scope, worst)
        if not sums[worst]:
            raise ModelError(f"{what}{row} is missing: no probability is given there")
        raise ModelError(f"{what}{row} sums to {sums[worst]:.10g}, not 1")


def row_name(table: Table, scope: Scope, row: int) -> str:
    """A row for messages: `` given x=1, y=2``, nothing where the table has one row."""
    return f" given {described(scope, table.parents, row)}" if table.parents else ""
