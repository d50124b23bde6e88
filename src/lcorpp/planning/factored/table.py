"""Sparse tables over variables: conditional probabilities and rewards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.factored.variables import Scope
from lcorpp.planning.pomdp import SUM_TOLERANCE
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class Table:
    """P(children | parents), or a reward by the values of the parents if there are no children.

    parents, children: names of variables; ``x`` is a state variable before the action, ``x'`` after it.
    shape: the number of values of each parent, then of each child.
    rows: (1, combinations of the parents, combinations of the children); the last variable varies fastest.
        Without children there is one column, the reward.

    `np.asarray(table)` is the dense array of `shape`.

    Raises:
        ModelError: the shapes do not match, or a variable appears twice.

    Examples:
        >>> from lcorpp.planning import Table
        >>> Table.of(("door",), ("sound",), [[0.9, 0.1], [0.2, 0.8]])
        <Table P(sound | door), 4 entries>
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
            raise ModelError(f"rows {self.rows.shape} are not a table of {', '.join(names)}: {self.shape}")

    @classmethod
    def of(cls, parents: tuple[str, ...], children: tuple[str, ...], values: npt.ArrayLike) -> Table:
        """Convert a dense array with an axis for each parent, then for each child."""
        array = np.asarray(values, dtype=np.float64)
        height = prod(array.shape[: len(parents)])
        return cls(parents, children, array.shape, SparseTables.of(array.reshape(1, height, -1)))

    @property
    def strides(self) -> tuple[int, ...]:
        """The row stride of each parent's value."""
        return compute_strides(self.shape[: len(self.parents)])

    def __repr__(self) -> str:
        condition = f" | {', '.join(self.parents)}" if self.parents else ""
        name = f"P({', '.join(self.children)}{condition})" if self.children else f"reward{condition}"
        return f"<Table {name}, {len(self.rows.values)} entries>"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return np.asarray(self.rows.dense, dtype=dtype).reshape(self.shape)

    def reward(self, row: npt.NDArray[np.int64]) -> Array:
        """Return (n,) the rewards in rows (n,) of a table without children."""
        begins, values = self.rows.begins, np.append(self.rows.values, 0.0)
        filled = begins[row + 1] > begins[row]
        return np.where(filled, values[np.where(filled, begins[row], -1)], 0.0)

    def equals(self, other: Table) -> bool:
        """Return whether both tables contain bitwise equal numbers for the same variables."""
        return (self.parents, self.children, self.shape) == (
            other.parents,
            other.children,
            other.shape,
        ) and all(
            np.array_equal(getattr(self.rows, field), getattr(other.rows, field))
            for field in ("begins", "columns", "values")
        )


def compute_strides(sizes: Sequence[int]) -> tuple[int, ...]:
    """Return the stride of each axis in the index of a combination; the last axis varies fastest."""
    return tuple(prod(sizes[i + 1 :]) for i in range(len(sizes)))


def check_distributions(table: Table, scope: Scope, what: str) -> None:
    """Raise a ModelError that names a row if it is not a distribution."""
    rows = table.rows
    if len(rows.values) and not rows.values.min() >= 0:
        at = int(rows.values.argmin())
        row = format_row(table, scope, int(rows.rows[at]))
        raise ModelError(f"{what}{row} has a negative probability, {rows.values[at]:.10g}")
    sums = rows.row_sums()[0]
    off = np.abs(sums - 1)
    if off.max() > SUM_TOLERANCE:
        worst = int(off.argmax())
        row = format_row(table, scope, worst)
        if not sums[worst]:
            raise ModelError(f"{what}{row} is missing: it has no probabilities")
        raise ModelError(f"{what}{row} sums to {sums[worst]:.10g}, not 1")


def format_row(table: Table, scope: Scope, row: int) -> str:
    """Return a row's condition for messages, `` given x=1, y=2``; empty for a table of one row."""
    if not table.parents:
        return ""
    indices = np.unravel_index(row, table.shape[: len(table.parents)])
    parts = (f"{name}={scope[name].values[i]}" for name, i in zip(table.parents, indices, strict=True))
    return f" given {', '.join(parts)}"
