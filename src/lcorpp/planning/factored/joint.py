"""The tables of a factored problem multiplied out, for many cases at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import prod

import numpy as np
import numpy.typing as npt

from lcorpp.planning.factored.table import Table
from lcorpp.planning.factored.variables import Variable
from lcorpp.values import Array

Numbers = npt.NDArray[np.int64]


class Joint:
    """What may happen in each of C cases: n outcomes that are possible, over the variables so far.

    case: (n,) the case of each outcome, never falling.
    values: by name the number of a variable's value, (n,) or one for all.
    weight: (n,) the probability of the outcome in its case.
    """

    def __init__(self, case: Numbers, values: Mapping[str, Numbers], weight: Array) -> None:
        self.case, self.values, self.weight = case, dict(values), weight

    @classmethod
    def of(cls, cases: int, values: Mapping[str, Numbers]) -> Joint:
        """Cases with what is known in them: (C,) or one number for all, by name."""
        return cls(np.arange(cases), values, np.ones(cases))

    def multiply(self, tables: Iterable[Table]) -> Joint:
        """With the children of some tables, each after those it depends on."""
        joint = self
        for table in tables:
            joint = joint._with(table)
        return joint

    def _with(self, table: Table) -> Joint:
        begins = table.rows.begins
        row = self.row(table)
        counts = begins[row + 1] - begins[row]
        begin = np.broadcast_to(begins[row], self.case.shape)
        case, values, weight = self.case, self.values, self.weight
        if (counts != 1).any():
            counts = np.broadcast_to(counts, self.case.shape)
            source = np.repeat(np.arange(len(case)), counts)
            # the first entry of the row, and how many outcomes of the same source come before this one
            begin = begin[source] + np.arange(len(source)) - np.repeat(np.cumsum(counts) - counts, counts)
            case, weight = case[source], weight[source]
            values = {name: v[source] if v.ndim else v for name, v in values.items()}
        values = dict(values)
        column = table.rows.columns[begin].astype(np.int64)
        for i in range(len(table.children) - 1, 0, -1):
            column, values[table.children[i]] = np.divmod(column, table.shape[len(table.parents) + i])
        values[table.children[0]] = column
        return Joint(case, values, weight * table.rows.values[begin])

    def row(self, table: Table) -> Numbers:
        """(n,) the row of a table that holds in each outcome, or one number for all."""
        row = np.zeros((), dtype=np.int64)
        for name, stride in zip(table.parents, table.strides, strict=True):
            row = row + self.values[name] * stride
        return row

    def mean(self, table: Table, cases: int) -> Array:
        """(C,) the mean in each case of a table without children."""
        worth = np.broadcast_to(table.reward(np.atleast_1d(self.row(table))), self.case.shape)
        return np.asarray(np.bincount(self.case, self.weight * worth, minlength=cases), dtype=np.float64)


class MixedRadix:
    """Combinations of values of some variables as one number, the last variable counting fastest.

    names: what the variables are called among values; as they are themselves, where not given.
    """

    def __init__(self, variables: Iterable[Variable], names: Iterable[str] | None = None) -> None:
        self.variables = tuple(variables)
        self.names = tuple(names or (variable.name for variable in self.variables))
        self.sizes = tuple(len(variable.values) for variable in self.variables)
        self.count = prod(self.sizes)

    def of(self, values: Mapping[str, Numbers]) -> Numbers:
        """The numbers of combinations given by variable."""
        code = np.zeros((), dtype=np.int64)
        for name, size in zip(self.names, self.sizes, strict=True):
            code = code * size + values[name]
        return code

    def values(self, code: Numbers) -> dict[str, Numbers]:
        """By variable, the values in combinations (n,)."""
        found = {}
        for name, size in zip(reversed(self.names), reversed(self.sizes), strict=True):
            code, found[name] = np.divmod(code, size)
        return found

    def labels(self, code: Numbers) -> tuple[str, ...]:
        """The names of combinations (n,): ``x=1,y=2``, or the value alone of a single variable."""
        if not self.variables:
            return ("none",) * len(code)
        values = self.values(code)
        alone = len(self.variables) == 1
        columns = [
            np.array([value if alone else f"{v.name}={value}" for value in v.values], dtype=object)[
                values[name]
            ]
            for v, name in zip(self.variables, self.names, strict=True)
        ]
        return tuple(map(",".join, zip(*columns, strict=True)))
