"""Compilation, step 5: an upward and a downward pass over the layers of a circuit answer a query, or many.

They give the joint weight of the evidence and each value of any term: the derivatives with respect to the
weights of the values. Columns are scaled after each layer. If a number of a column is so
small that digits may be lost, the passes are repeated for it with numbers of extended range.

Source: Darwiche, "A differential approach to inference in Bayesian networks", J. ACM 50(3), 2003; likelihoods
in place of indicators, Pearl, Probabilistic Reasoning in Intelligent Systems, 1988, section 2.2.2.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from functools import reduce
from itertools import accumulate
from operator import mul
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from lcorpp.reasoning.circuit.evidence import Codes, EncodedEvidence
from lcorpp.reasoning.circuit.extended_range import ExtendedArithmetic, ExtendedNumbers
from lcorpp.reasoning.circuit.matrices import Groups, Index, Layer, Matrix
from lcorpp.values import Array

MAX_CHUNK_NUMBERS = 4_000_000
"""A pass over a batch keeps at most this many numbers in memory."""

MIN_NUMBER = 1e-100
"""Columns with a smaller positive number need extended range: products of three such numbers underflow."""

_MIN_DIVISOR = 5e-324
"""The smallest positive number, which divides columns of zeros."""

_Numbers = TypeVar("_Numbers", Array, ExtendedNumbers)


class _Arithmetic(Protocol[_Numbers]):
    """The operations of a pass on (n, B) numbers, see `ExtendedArithmetic`."""

    def convert(self, numbers: Array) -> _Numbers: ...
    def multiply(self, a: _Numbers, b: _Numbers) -> _Numbers: ...
    def sum(self, groups: Groups, numbers: _Numbers) -> _Numbers: ...
    def apply(self, matrix: Matrix, columns: _Numbers) -> _Numbers: ...
    def get_ratios(self, numbers: _Numbers) -> Array: ...
    def get_root(self, numbers: _Numbers) -> ExtendedNumbers: ...


def differentiate(
    layers: Sequence[Layer], evidence: EncodedEvidence, queries: Collection[int]
) -> dict[int, Array]:
    """Compute the joint weights of the evidence and each outcome of the queried terms.

    Args:
        layers: each after its sources; the last one has one output, the weight of the evidence.
        evidence: of the observed terms.
        queries: the indexes of queried terms.

    Returns:
        index -> (B, outcomes) weights; only the ratios within a row matter. A row is 0 only for impossible
        evidence.
    """
    shapes = {
        v: (len(evidence.codes), layer.outcomes.size) for layer in layers if (v := layer.variable) in queries
    }
    result = {variable: np.zeros(shape) for variable, shape in shapes.items()}
    for rows, arithmetic, part in _split(layers, evidence):
        for variable, numbers in _differentiate(arithmetic, layers, part, queries).items():
            result[variable][rows] = arithmetic.get_ratios(numbers).T
    return result


def evaluate(layers: Sequence[Layer], codes: Codes) -> Array:
    """(B,) Compute the joint weights of outcomes of observed terms, up to one factor for all rows.

    Args:
        codes: (B, observed terms) the outcome of each observed term, -1 for no evidence.
    """
    weights = ExtendedNumbers(np.zeros(len(codes)), np.zeros(len(codes), dtype=np.intp))
    for rows, arithmetic, part in _split(layers, EncodedEvidence(codes)):
        outputs, _, _ = _go_up(arithmetic, layers, part)
        root = arithmetic.get_root(outputs[-1])
        weights.fraction[rows], weights.exponent[rows] = root.fraction[0], root.exponent[0]
    return weights.scale(max(weights.exponent[weights.fraction > 0].tolist(), default=0))


def _split(
    layers: Sequence[Layer], evidence: EncodedEvidence
) -> Iterator[tuple[Index, _Arithmetic[Any], EncodedEvidence]]:
    """Yield chunks of the rows, and of those rows again whose numbers have become too small."""
    width = sum([layer.matrix.rows.size + 2 * len(layer.inputs.keys) for layer in layers])
    n_rows, size = len(evidence.codes), max(1, MAX_CHUNK_NUMBERS // width)
    for start in range(0, n_rows, size):
        rows = np.arange(start, min(start + size, n_rows))
        floats = _FloatArithmetic(len(rows))
        yield rows, floats, evidence.take(rows)
        extreme = rows[floats.find_extreme_columns()]
        step = max(1, size // 16)  # passes of extended range take more memory
        for first in range(0, len(extreme), step):
            part = extreme[first : first + step]
            yield part, ExtendedArithmetic(), evidence.take(part)


def _go_up(
    arithmetic: _Arithmetic[_Numbers], layers: Sequence[Layer], evidence: EncodedEvidence
) -> tuple[list[_Numbers], list[_Numbers], list[_Numbers | None]]:
    """Return the outputs of each layer, its weighted pairs, and their weights; None if all are 1."""
    one = arithmetic.convert(np.ones((1, len(evidence.codes))))
    outputs: list[_Numbers] = []
    pairs: list[_Numbers] = []
    weights: list[_Numbers | None] = []
    for layer in layers:
        factors = [_take(outputs[source], nodes) for source, nodes in layer.sources]
        columns = _take(reduce(arithmetic.multiply, factors) if factors else one, layer.inputs)
        given = evidence.weigh(layer.variable, layer.outcomes.keys)
        weight = None if given is None else arithmetic.convert(given)
        weights.append(weight)
        pairs.append(columns if weight is None else columns * weight)
        outputs.append(arithmetic.apply(layer.matrix, pairs[-1]))
    return outputs, pairs, weights


def _differentiate(
    arithmetic: _Arithmetic[_Numbers],
    layers: Sequence[Layer],
    evidence: EncodedEvidence,
    queries: Collection[int],
) -> dict[int, _Numbers]:
    """Return the joint weights (outcomes, B) of the queried terms."""
    outputs, pairs, weights = _go_up(arithmetic, layers, evidence)
    leads_to_query: list[bool] = []
    for layer in layers:
        leads_to_query.append(
            layer.variable in queries or any(leads_to_query[source] for source, _ in layer.sources)
        )
    derivatives = {len(layers) - 1: arithmetic.convert(np.ones((1, len(evidence.codes))))}
    joint: dict[int, _Numbers] = {}
    for number in range(len(layers) - 1, -1, -1):
        if not leads_to_query[number]:
            continue
        layer, weight = layers[number], weights[number]
        by_pair = arithmetic.apply(layer.matrix.transposed, derivatives.pop(number))
        if layer.variable in queries:
            joint[layer.variable] = arithmetic.sum(layer.outcomes, by_pair * pairs[number])
        if not any(leads_to_query[source] for source, _ in layer.sources):
            continue
        by_input = arithmetic.sum(layer.inputs, by_pair if weight is None else by_pair * weight)
        factors = [_take(outputs[source], nodes) for source, nodes in layer.sources]
        # the product of the other factors and `by_input`, for each factor
        before: list[_Numbers] = list(accumulate(factors[:-1], arithmetic.multiply, initial=by_input))
        after: list[_Numbers] = list(accumulate(factors[:0:-1], arithmetic.multiply))[::-1]
        products = [arithmetic.multiply(*pair) for pair in zip(before, after, strict=False)] + before[-1:]
        for (source, nodes), product in zip(layer.sources, products, strict=True):
            derivatives[source] = arithmetic.sum(nodes, product)
    return joint


def _take(numbers: _Numbers, groups: Groups) -> _Numbers:
    """Return the number of the group of each row."""
    return numbers if groups.is_identity else numbers[groups.keys]


class _FloatArithmetic:
    """The operations of a pass in floating point, with columns scaled to a maximum of 1."""

    def __init__(self, n_columns: int) -> None:
        self._is_extreme = np.zeros(n_columns, dtype=np.bool_)
        self._scales: list[Array] = []
        self._checked = [np.ones((1, n_columns))]

    def convert(self, numbers: Array) -> Array:
        """Check weights."""
        return self._check(numbers)

    def multiply(self, a: Array, b: Array) -> Array:
        """Multiply the numbers of two branches."""
        return self._check(a * b)

    def sum(self, groups: Groups, numbers: Array) -> Array:
        """(groups, B) Sum the rows (n, B) of each group."""
        if groups.is_identity:
            return numbers
        order, starts, targets = groups.layout
        sums = np.add.reduceat(numbers[order], starts) if len(starts) else numbers[:0]
        if len(starts) == groups.size:
            return sums
        result = np.zeros((groups.size, numbers.shape[1]))
        result[targets] = sums
        return result

    def apply(self, matrix: Matrix, columns: Array) -> Array:
        """(rows, B) Multiply columns (columns, B) by a matrix, and scale them."""
        if matrix.dense is not None:
            result = matrix.dense @ columns
        else:
            result = self.sum(matrix.rows, columns[matrix.columns.keys] * matrix.weights[:, None])
        largest = np.maximum(np.maximum.reduce(result, axis=0, initial=0.0), _MIN_DIVISOR)
        result /= largest
        self._scales.append(largest)
        if matrix.smallest < MIN_NUMBER:
            self._is_extreme[:] = True
        return self._check(result)

    def get_ratios(self, numbers: Array) -> Array:
        """Return numbers of which only the ratios within a column matter."""
        return numbers

    def get_root(self, numbers: Array) -> ExtendedNumbers:
        """Return the output of the last layer in absolute size."""
        return reduce(mul, map(ExtendedNumbers.normalise, self._scales), ExtendedNumbers.normalise(numbers))

    def find_extreme_columns(self) -> npt.NDArray[np.bool_]:
        """(B,) Find the columns in which digits may be lost."""
        numbers = np.concatenate(self._checked)
        self._is_extreme |= ((numbers > 0) & (numbers < MIN_NUMBER)).any(axis=0)
        return self._is_extreme

    def _check(self, numbers: Array) -> Array:
        self._checked.append(numbers)
        return numbers
