"""Compilation, step 4: the layered arithmetic circuit, a tree of sparse matrices; `passes` evaluates it.

Let t1, ..., tn be the terms that evidence may name or a query may read; all other terms are summed out. The
circuit has a layer for each of them, with one matrix for each value. A layer multiplies a column of inputs by
the matrix of the observed value; without evidence by the sum of the matrices, which is the circuit with all
evidence indicators of the term set to 1. Its inputs are products of outputs of the layers before it: one
factor for each independent branch of the program. So for a chain the probability of t1=v1, ..., tn=vn is

    M_1[v1] . M_2[v2] ... M_n[vn] . [1]

A likelihood replaces the matrix of a value by the weighted sum of the matrices.

Source: Darwiche, "A differential approach to inference in Bayesian networks", J. ACM 50(3), 2003.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from lcorpp.values import Array

Index = npt.NDArray[np.intp]

_Factor = TypeVar("_Factor")

MAX_DENSE_ENTRIES = 4096
"""Matrices with at most this many entries, zeros included, are dense, which is faster."""


@dataclass(frozen=True, eq=False)
class Matrix:
    """A non-negative matrix that multiplies columns; dense if it is small, otherwise sparse by rows.

    shape: (outputs, inputs).
    dense: (outputs, inputs), None if the matrix is sparse.
    source, weight: (entries,) the input and the weight of each entry, sorted by output.
    target, start: (rows,) the outputs with entries, and the index of the first entry of each.
    smallest: the smallest weight, 1 without entries; it is 0 if the compiler lost a weight to underflow.
    """

    shape: tuple[int, int]
    dense: Array | None
    source: Index
    weight: Array
    target: Index
    start: Index
    smallest: float

    @classmethod
    def from_entries(cls, shape: tuple[int, int], entries: Mapping[tuple[int, int], float]) -> Matrix:
        """Build a matrix from (output, input) -> weight."""
        none = np.zeros(0, dtype=np.intp)
        smallest = min(entries.values(), default=1.0)
        if shape[0] * shape[1] <= MAX_DENSE_ENTRIES:
            dense = np.zeros(shape)
            for place, weight in entries.items():
                dense[place] = weight
            return cls(shape, dense, none, np.zeros(0), none, none, smallest)
        keys = sorted(entries)
        outputs = np.array([key[0] for key in keys], dtype=np.intp)
        target, start = np.unique(outputs, return_index=True)
        source = np.array([key[1] for key in keys], dtype=np.intp)
        weights = np.array([entries[key] for key in keys])
        return cls(shape, None, source, weights, target, start.astype(np.intp), smallest)

    def __repr__(self) -> str:
        n_entries = np.count_nonzero(self.dense) if self.dense is not None else len(self.source)
        return f"Matrix({self.shape[0]} x {self.shape[1]}, {n_entries} entries)"

    def list_entries(self) -> dict[tuple[int, int], float]:
        """List the entries that are not zero: (output, input) -> weight."""
        outputs, inputs, weights = self.get_arrays()
        pairs = zip(outputs.tolist(), inputs.tolist(), strict=True)
        return dict(zip(pairs, weights.tolist(), strict=True))

    def get_arrays(self) -> tuple[Index, Index, Array]:
        """Return the output, the input and the weight of each entry."""
        if self.dense is None:
            return self._repeat_targets(), self.source, self.weight
        outputs, inputs = np.nonzero(self.dense)
        return outputs, inputs, self.dense[outputs, inputs]

    def forward(self, columns: Array) -> Array:
        """Multiply columns (inputs, B) by the matrix; return (outputs, B)."""
        if self.dense is not None:
            return self.dense @ columns
        result = np.zeros((self.shape[0], columns.shape[1]))
        if len(self.source):
            result[self.target] = np.add.reduceat(columns[self.source] * self.weight[:, None], self.start)
        return result

    def backward(self, columns: Array) -> Array:
        """Multiply columns (outputs, B) by the transpose; return (inputs, B)."""
        if self.dense is not None:
            return self.dense.T @ columns
        result = np.zeros((self.shape[1], columns.shape[1]))
        np.add.at(result, self.source, columns[self._repeat_targets()] * self.weight[:, None])
        return result

    def _repeat_targets(self) -> Index:
        """(entries,) The output of each entry of a sparse matrix."""
        return np.repeat(self.target, np.diff(np.append(self.start, len(self.source))))


@dataclass(frozen=True, eq=False)
class Layer:
    """The matrices of one observed term, or a product of matrices without observed terms.

    variable: the index of the term among the observed terms, -1 for a product.
    sources: (layer, nodes) for each branch before this layer: input i is the product of the outputs
        `nodes[i]` of these layers. Without branches there is one input, 1.
    matrices: outcome -> matrix; impossible outcomes are missing.
    total: the sum of the matrices, or the product.
    """

    variable: int
    sources: Sequence[tuple[int, Index]]
    matrices: Mapping[int, Matrix]
    total: Matrix

    @cached_property
    def smallest(self) -> float:
        """The smallest weight of the matrices."""
        return min([matrix.smallest for matrix in self.matrices.values()] or [self.total.smallest])

    @classmethod
    def from_entries(
        cls,
        variable: int,
        sources: Sequence[tuple[int, Index]],
        shape: tuple[int, int],
        by_outcome: Mapping[int, Mapping[tuple[int, int], float]],
    ) -> Layer:
        """Build the layer of an observed term from outcome -> (output, input) -> weight."""
        total: dict[tuple[int, int], float] = {}
        for entries in by_outcome.values():
            for key, weight in entries.items():
                total[key] = total.get(key, 0.0) + weight
        matrices = {o: Matrix.from_entries(shape, entries) for o, entries in sorted(by_outcome.items())}
        return cls(variable, sources, matrices, Matrix.from_entries(shape, total))


def multiply_others(
    own: _Factor, factors: Sequence[_Factor], multiply: Callable[[_Factor, _Factor], _Factor]
) -> list[_Factor]:
    """Multiply a number by all factors but one, for each of the factors."""
    if len(factors) == 1:
        return [own]
    after = [factors[-1]]
    for factor in reversed(factors[1:-1]):
        after.append(multiply(factor, after[-1]))
    before, products = own, []
    for factor, rest in zip(factors, reversed(after), strict=False):
        products.append(multiply(before, rest))
        before = multiply(before, factor)
    return [*products, before]
