"""Compilation, step 5: an upward and a downward pass over the layers of a circuit answer a query, or many.

They give the joint weight of the evidence and each value of any term: the derivatives with respect to the
weights of the values. Columns are scaled after each layer. If a number of a column is so small that digits
may be lost, the same passes are repeated for it with decimal numbers, which do not underflow.

Source: Darwiche, "A differential approach to inference in Bayesian networks", J. ACM 50(3), 2003; likelihoods
in place of indicators, Pearl, Probabilistic Reasoning in Intelligent Systems, 1988, section 2.2.2.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from decimal import Decimal, localcontext
from functools import reduce
from itertools import accumulate
from typing import Any

import numpy as np

from lcorpp.reasoning.circuit.matrices import WIDE, Groups, Index, Layer, Matrix
from lcorpp.reasoning.evidence import EncodedEvidence
from lcorpp.values import Array

MAX_CHUNK_NUMBERS = 4_000_000
"""A pass over a batch keeps at most this many numbers in memory."""

MIN_NUMBER = 1e-100
"""Columns with a smaller positive number need decimal numbers: products of three such numbers underflow."""


_MIN_DIVISOR = 5e-324
"""The smallest positive number, which divides columns of zeros."""

_make_decimals: Any = np.frompyfunc(Decimal, 1, 1)


def differentiate(
    layers: Sequence[Layer],
    evidence: EncodedEvidence,
    queries: Collection[int],
    logarithms: Array | None = None,
) -> dict[int, Array]:
    """Compute the joint weights of the evidence and each outcome of the queried terms.

    Args:
        layers: each after its sources; the last one has one output, the weight of the evidence.
        evidence: of the observed terms.
        queries: the indexes of queried terms.
        logarithms: (B,) is filled with the logarithms of the weights of the evidence.

    Returns:
        index -> (B, outcomes) weights; only the ratios within a row matter. A row is 0 only for impossible
        evidence.
    """
    n_rows = len(evidence.codes)
    shapes = {v: (n_rows, layer.outcomes.size) for layer in layers if (v := layer.variable) in queries}
    joint = {variable: np.zeros(shape) for variable, shape in shapes.items()}

    def fill(rows: Index, is_wide: bool) -> Index:
        run = _Pass(layers, evidence.take(rows), is_wide)
        for variable, numbers in run.go_down(queries).items():
            if is_wide:
                largest = numbers.max(axis=0)
                numbers = numbers / np.where(largest == 0, 1, largest)
            joint[variable][rows] = numbers.T
        if logarithms is not None:
            logarithms[rows] = run.compute_logarithms()
        return rows[:0] if is_wide else rows[run.find_extreme_columns()]

    rows = np.arange(n_rows)
    width = sum([layer.matrix.rows.size + 2 * len(layer.inputs.keys) for layer in layers])
    size = max(1, MAX_CHUNK_NUMBERS // width)
    if all(layer.matrix.smallest >= MIN_NUMBER for layer in layers):
        parts = [fill(rows[i : i + size], False) for i in range(0, n_rows, size)]
        rows = np.concatenate([rows[:0], *parts])
    size = max(1, size // 16)  # decimal numbers take more memory
    for i in range(0, len(rows), size):
        with localcontext(WIDE):
            fill(rows[i : i + size], True)
    return joint


class _Pass:
    """An upward pass over layers with a batch of evidence, with numbers (n, B), floating-point or decimal.

    Of each layer it keeps the outputs, the weighted pairs, and their weights; None if all are 1.
    """

    def __init__(self, layers: Sequence[Layer], evidence: EncodedEvidence, is_wide: bool) -> None:
        self._layers, self._is_wide = layers, is_wide
        self._one = self._convert(np.ones((1, len(evidence.codes))))
        self._scales: list[Array] = []
        self._checked = [self._one]
        self._outputs: list[Array] = []
        self._pairs: list[Array] = []
        self._weights: list[Array | None] = []
        for layer in layers:
            factors = self._list_factors(layer)
            columns = _take(reduce(self._multiply, factors) if factors else self._one, layer.inputs)
            weight = evidence.weigh(layer.variable, layer.outcomes.keys)
            if weight is not None:
                if weight.dtype != bool:  # likelihoods
                    weight = self._check(self._convert(weight))
                columns = columns * weight
            self._weights.append(weight)
            self._pairs.append(columns)
            self._outputs.append(self._apply(layer.matrix, columns))
        self._root = [*self._scales, self._outputs[-1][0]]

    def go_down(self, queries: Collection[int]) -> dict[int, Array]:
        """Return the joint weights (outcomes, B) of the queried terms; only ratios within a column matter."""
        leads_to_query: list[bool] = []
        for layer in self._layers:
            leads_to_query.append(
                layer.variable in queries or any(leads_to_query[source] for source, _ in layer.sources)
            )
        derivatives = {len(self._layers) - 1: self._one}
        joint: dict[int, Array] = {}
        for number in range(len(self._layers) - 1, -1, -1):
            if not leads_to_query[number]:
                continue
            layer, weight = self._layers[number], self._weights[number]
            by_pair = self._apply(layer.matrix.transposed, derivatives.pop(number))
            if layer.variable in queries:
                joint[layer.variable] = self._sum(layer.outcomes, by_pair * self._pairs[number])
            if not any(leads_to_query[source] for source, _ in layer.sources):
                continue
            by_input = self._sum(layer.inputs, by_pair if weight is None else by_pair * weight)
            factors = self._list_factors(layer)
            # the product of the other factors and `by_input`, for each factor
            before = list(accumulate(factors[:-1], self._multiply, initial=by_input))
            after = list(accumulate(factors[:0:-1], self._multiply))[::-1]
            products = [*map(self._multiply, before, after), before[-1]]
            for (source, nodes), product in zip(layer.sources, products, strict=True):
                derivatives[source] = self._sum(nodes, product)
        return joint

    def compute_logarithms(self) -> Array:
        """(B,) Compute the logarithms of the weights of the evidence."""
        if self._is_wide:
            return np.array([float(number.ln()) for number in self._root[0]])
        with np.errstate(divide="ignore"):
            logarithms: Array = np.log(self._root).sum(axis=0)
        return logarithms

    def find_extreme_columns(self) -> Any:
        """(B,) Find the columns in which floating point may lose digits."""
        numbers = np.concatenate(self._checked)
        return np.any((numbers > 0) & (numbers < MIN_NUMBER), axis=0)

    def _convert(self, numbers: Array) -> Array:
        if not self._is_wide:
            return numbers
        distinct, places = np.unique(numbers, return_inverse=True)
        decimals: Array = _make_decimals(distinct)[places.reshape(numbers.shape)]
        return decimals

    def _list_factors(self, layer: Layer) -> list[Array]:
        return [_take(self._outputs[source], nodes) for source, nodes in layer.sources]

    def _multiply(self, a: Array, b: Array) -> Array:
        """Multiply the numbers of two branches."""
        return self._check(a * b)

    def _sum(self, groups: Groups, numbers: Array) -> Array:
        """(groups, B) Sum the rows (n, B) of each group."""
        if groups.is_identity:
            return numbers
        order, starts, targets = groups.layout
        sums: Array = np.add.reduceat(numbers[order], starts) if len(starts) else numbers[:0]
        if len(starts) == groups.size:
            return sums
        result = self._convert(np.zeros((groups.size, numbers.shape[1])))
        result[targets] = sums
        return result

    def _apply(self, matrix: Matrix, columns: Array) -> Array:
        """(rows, B) Multiply columns (columns, B) by a matrix, and scale them to a maximum of 1."""
        if matrix.dense is not None and not self._is_wide:
            result = matrix.dense @ columns
        else:
            weights = self._convert(matrix.weights)
            result = self._sum(matrix.rows, columns[matrix.columns.keys] * weights[:, None])
        if not self._is_wide:
            largest = np.maximum(np.maximum.reduce(result, axis=0, initial=0.0), _MIN_DIVISOR)
            result /= largest
            self._scales.append(largest)
        return self._check(result)

    def _check(self, numbers: Array) -> Array:
        self._checked.append(numbers)
        return numbers


def _take(numbers: Array, groups: Groups) -> Array:
    """Return the number of the group of each row."""
    return numbers if groups.is_identity else numbers[groups.keys]
