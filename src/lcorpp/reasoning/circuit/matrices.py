"""Compilation, step 4: the layered arithmetic circuit, a tree of sparse matrices; `passes` evaluates it.

Let t1, ..., tn be the terms that evidence may name or a query may read; all other terms are summed out. The
circuit has a layer for each of them, and where independent branches meet. The inputs of a layer are products
of outputs of the layers before it: one factor for each branch. A layer weighs pairs of an input and an
outcome of its term by the evidence about the outcome (1 or 0, or its likelihood; 1 without evidence), and
multiplies this column by a matrix. So for a chain the probability of t1=v1, ..., tn=vn is

    M_1 (e_v1 * M_2 (e_v2 * ... M_n (e_vn * 1)))

where ``e_v *`` keeps the pairs of outcome v.

Source: Darwiche, "A differential approach to inference in Bayesian networks", J. ACM 50(3), 2003.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import MAX_EMAX, MIN_EMIN, Context
from functools import cached_property

import numpy as np
import numpy.typing as npt

from lcorpp.values import Array

Index = npt.NDArray[np.intp]

MAX_DENSE_ENTRIES = 4096
"""Matrices with at most this many entries, zeros included, are dense, which is faster."""

MIN_WEIGHT = 1e-150
"""Matrices with smaller weights have decimal numbers: products of two such numbers underflow."""

WIDE = Context(prec=18, Emin=MIN_EMIN, Emax=MAX_EMAX)
"""The context of decimal numbers, which do not underflow."""


class Groups:
    """A map from the rows of an array to groups; an arithmetic sums the rows of each group.

    keys: (rows,) the group of each row.
    size: the number of groups.
    """

    def __init__(self, keys: npt.ArrayLike, size: int) -> None:
        self.keys, self.size = np.asarray(keys, dtype=np.intp), size

    @cached_property
    def is_identity(self) -> bool:
        """Whether row i is group i, for all groups."""
        return len(self.keys) == self.size and bool((self.keys == np.arange(self.size)).all())

    @cached_property
    def layout(self) -> tuple[Index | slice, Index, Index]:
        """The rows sorted by group, the first row of each group that has rows, and these groups."""
        keys, order = self.keys, None
        if (keys[1:] < keys[:-1]).any():
            order = np.argsort(keys, kind="stable")
            keys = keys[order]
        is_first = np.ones(len(keys), dtype=np.bool_)
        np.not_equal(keys[1:], keys[:-1], out=is_first[1:])
        starts = is_first.nonzero()[0]
        return slice(None) if order is None else order, starts, keys[starts]


class Matrix:
    """A non-negative sparse matrix.

    rows, columns: the row and the column of each entry, sorted by row.
    weights: (entries,) positive; decimal numbers if floating point would lose digits.
    """

    def __init__(self, rows: Groups, columns: Groups, weights: Array) -> None:
        self.rows, self.columns, self.weights = rows, columns, weights

    def __repr__(self) -> str:
        return f"Matrix({self.rows.size} x {self.columns.size}, {len(self.weights)} entries)"

    @cached_property
    def transposed(self) -> Matrix:
        """The transposed matrix."""
        return Matrix(self.columns, self.rows, self.weights)

    @cached_property
    def smallest(self) -> float:
        """The smallest weight, 0 for decimal numbers."""
        return 0.0 if self.weights.dtype == object else float(self.weights.min(initial=1.0))

    @cached_property
    def dense(self) -> Array | None:
        """The matrix as an array if it is small, and in floating point."""
        if self.rows.size * self.columns.size > MAX_DENSE_ENTRIES or self.weights.dtype == object:
            return None
        dense = np.zeros((self.rows.size, self.columns.size))
        dense[self.rows.keys, self.columns.keys] = self.weights
        return dense


@dataclass(frozen=True, eq=False)
class Layer:
    """The sum over an observed term, or over terms that are not observed.

    variable: the index of the term among the observed terms, -1 for others.
    sources: (layer, nodes) for each branch before this layer: input i is the product of the outputs
        `nodes.keys[i]` of these layers. Without branches there is one input, 1.
    inputs, outcomes: the input and the outcome of each pair; pairs without entries are missing.
    matrix: (outputs, pairs).
    """

    variable: int
    sources: Sequence[tuple[int, Groups]]
    inputs: Groups
    outcomes: Groups
    matrix: Matrix

    @classmethod
    def from_entries(
        cls,
        variable: int,
        sources: Sequence[tuple[int, Groups]],
        shape: tuple[int, int, int],
        entries: Mapping[tuple[int, int, int], float],
    ) -> Layer:
        """Build a layer from (output, outcome, input) -> weight, in any type of numbers.

        Args:
            shape: the number of outputs, outcomes and inputs.
        """
        keys = sorted([key for key, weight in entries.items() if weight])
        weights = [entries[key] for key in keys]
        pairs = sorted({(i, outcome) for _, outcome, i in keys})
        column_of = {pair: column for column, pair in enumerate(pairs)}
        return cls(
            variable,
            sources,
            Groups([i for i, _ in pairs], shape[2]),
            Groups([outcome for _, outcome in pairs], shape[1]),
            Matrix(
                Groups([output for output, _, _ in keys], shape[0]),
                Groups([column_of[i, outcome] for _, outcome, i in keys], len(pairs)),
                np.array(weights, np.float64 if min(weights, default=1) >= MIN_WEIGHT else object),
            ),
        )
