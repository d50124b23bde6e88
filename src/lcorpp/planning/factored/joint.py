"""Joint distributions: products of a factored problem's tables, for many cases at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import prod

import numpy as np
import numpy.typing as npt

from lcorpp.planning.factored.table import Table
from lcorpp.planning.factored.variables import Variable
from lcorpp.planning.sparse import ragged_indices
from lcorpp.values import Array

Numbers = npt.NDArray[np.int64]


class Joint:
    """A joint distribution over some variables in each of C cases, as a list of n possible outcomes.

    case: (n,) the case of each outcome, non-decreasing.
    values: by name the indices of a variable's values, (n,) or one index for all.
    weight: (n,) the probability of the outcome in its case.
    """

    def __init__(self, case: Numbers, values: Mapping[str, Numbers], weight: Array) -> None:
        self.case, self.values, self.weight = case, dict(values), weight

    @classmethod
    def of(cls, cases: int, values: Mapping[str, Numbers]) -> Joint:
        """Return cases with known values by name: (C,) or one index for all."""
        return cls(np.arange(cases), values, np.ones(cases))

    def multiply(self, tables: Iterable[Table]) -> Joint:
        """Multiply with conditional tables, each of which must follow its parents' tables."""
        joint = self
        for table in tables:
            joint = joint._multiply_table(table)
        return joint

    def _multiply_table(self, table: Table) -> Joint:
        begins = table.rows.begins
        row = self.row(table)
        counts = begins[row + 1] - begins[row]
        begin = np.broadcast_to(begins[row], self.case.shape)
        case, values, weight = self.case, self.values, self.weight
        if (counts != 1).any():
            counts = np.broadcast_to(counts, self.case.shape)
            source = np.repeat(np.arange(len(case)), counts)
            begin = ragged_indices(begin, counts)
            case, weight = case[source], weight[source]
            values = {name: v[source] if v.ndim else v for name, v in values.items()}
        values = dict(values)
        column = table.rows.columns[begin].astype(np.int64)
        for i in range(len(table.children) - 1, 0, -1):
            column, values[table.children[i]] = np.divmod(column, table.shape[len(table.parents) + i])
        values[table.children[0]] = column
        return Joint(case, values, weight * table.rows.values[begin])

    def row(self, table: Table) -> Numbers:
        """Return (n,) the row of a table for each outcome, or one row for all."""
        row = np.zeros((), dtype=np.int64)
        for name, stride in zip(table.parents, table.strides, strict=True):
            row = row + self.values[name] * stride
        return row

    def mean(self, table: Table, cases: int) -> Array:
        """Return (C,) the mean of a reward table in each case."""
        reward = np.broadcast_to(table.reward(np.atleast_1d(self.row(table))), self.case.shape)
        return np.asarray(np.bincount(self.case, self.weight * reward, minlength=cases), dtype=np.float64)


class MixedRadix:
    """Combinations of variables' values as single numbers; the last variable varies fastest.

    names: the variables' keys among values; their own names by default.
    """

    def __init__(self, variables: Iterable[Variable], names: Iterable[str] | None = None) -> None:
        self.variables = tuple(variables)
        self.names = tuple(names or (variable.name for variable in self.variables))
        self.sizes = tuple(len(variable.values) for variable in self.variables)
        self.count = prod(self.sizes)

    def encode(self, values: Mapping[str, Numbers]) -> Numbers:
        """Return the codes of combinations of values, given by name."""
        code = np.zeros((), dtype=np.int64)
        for name, size in zip(self.names, self.sizes, strict=True):
            code = code * size + values[name]
        return code

    def decode(self, code: Numbers) -> dict[str, Numbers]:
        """Return the values by name of codes (n,)."""
        values = {}
        for name, size in zip(reversed(self.names), reversed(self.sizes), strict=True):
            code, values[name] = np.divmod(code, size)
        return values

    def labels(self, code: Numbers) -> tuple[str, ...]:
        """Return the names of codes (n,): ``x=1,y=2``, or the plain value of a single variable."""
        if not self.variables:
            return ("none",) * len(code)
        values = self.decode(code)
        single = len(self.variables) == 1
        columns = [
            np.array(v.values if single else [f"{v.name}={value}" for value in v.values], object)[
                values[name]
            ]
            for v, name in zip(self.variables, self.names, strict=True)
        ]
        return tuple(map(",".join, zip(*columns, strict=True)))
