"""Compilation, step 5: an upward and a downward pass over the layers of a circuit answer a query, or many.

They give the joint weight of the evidence and each value of any term: the derivatives with respect to the
indicators of the values. Columns are scaled to a sum of 1 after each layer. If a number of a column is so
small that digits may be lost, `extended_range` repeats the passes for it.

Source: Darwiche, "A differential approach to inference in Bayesian networks", J. ACM 50(3), 2003; likelihoods
in place of indicators, Pearl, Probabilistic Reasoning in Intelligent Systems, 1988, section 2.2.2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import reduce

import numpy as np
import numpy.typing as npt

from lcorpp.reasoning.circuit.answer_table import Codes
from lcorpp.reasoning.circuit.evidence import EncodedEvidence
from lcorpp.reasoning.circuit.extended_range import differentiate_extended
from lcorpp.reasoning.circuit.matrices import Layer, Matrix, multiply_others
from lcorpp.values import Array

MAX_CHUNK_NUMBERS = 4_000_000
"""A pass over a batch keeps at most this many numbers in memory."""

MIN_NUMBER = 1e-100
"""Columns with a smaller positive number need extended range: long products of such numbers underflow."""

MAX_UNCHECKED = 50_000
"""The numbers of a pass are checked in blocks of about this size, which fit into the cache."""

_MIN_BITS = np.float64(MIN_NUMBER).view(np.uint64) - np.uint64(1)


def differentiate(
    layers: Sequence[Layer], evidence: EncodedEvidence, queries: Mapping[int, int]
) -> dict[int, Array]:
    """Compute the joint weights of the evidence and each outcome of the queried terms.

    Args:
        layers: each after its sources; the last one has one output, the weight of the evidence.
        evidence: of the observed terms.
        queries: index of a queried term -> the number of its outcomes.

    Returns:
        index -> (B, outcomes) weights; only the ratios within a row matter. A row is 0 only for impossible
        evidence.
    """
    n_rows = len(evidence.codes)
    width = sum(sum(layer.total.shape) for layer in layers)
    size = max(1, MAX_CHUNK_NUMBERS // width)
    result = {variable: np.zeros((n_rows, n_outcomes)) for variable, n_outcomes in queries.items()}
    for start in range(0, n_rows, size):
        rows = np.arange(start, min(start + size, n_rows))
        weights, is_extreme = _Passes(layers, evidence.take(rows) if n_rows > size else evidence).run(queries)
        for variable, own in weights.items():
            result[variable][rows] = own
        extreme = rows[is_extreme]
        step = max(1, size // 16)  # passes of extended range take more memory
        for first in range(0, len(extreme), step):
            part = extreme[first : first + step]
            for variable, own in differentiate_extended(layers, evidence.take(part), queries).items():
                result[variable][part] = own
    return result


def evaluate(layers: Sequence[Layer], codes: Codes) -> Array:
    """(B,) Compute the joint weights of outcomes of observed terms, up to one factor for all rows.

    Args:
        codes: (B, observed terms) the outcome of each observed term, -1 for no evidence.
    """
    size = max(1, MAX_CHUNK_NUMBERS // sum(sum(layer.total.shape) for layer in layers))
    chunks = []
    for start in range(0, len(codes), size):
        evidence = EncodedEvidence(codes[start : start + size])
        outputs: list[Array] = []
        for layer in layers:
            factors = [outputs[source][nodes] for source, nodes in layer.sources]
            inputs = reduce(np.multiply, factors) if factors else np.ones((1, len(evidence.codes)))
            outputs.append(_select(layer, evidence, inputs, Matrix.forward))
        chunks.append(outputs[-1][0])
    return np.concatenate(chunks)


class _Passes:
    """The passes over one chunk of a batch.

    is_extreme: (B,) whether digits of a column may be lost.
    """

    def __init__(self, layers: Sequence[Layer], evidence: EncodedEvidence) -> None:
        self._layers, self._evidence = layers, evidence
        self._n_columns = len(evidence.codes)
        self._is_extreme = np.zeros(self._n_columns, dtype=np.bool_)
        self._unchecked: list[Array] = []
        self._n_unchecked = 0

    def run(self, queries: Mapping[int, int]) -> tuple[dict[int, Array], npt.NDArray[np.bool_]]:
        """Return the weights of the outcomes of queried terms, and which columns need extended range."""
        inputs: list[Array] = []
        outputs: list[Array] = []
        layers, evidence = self._layers, self._evidence
        for layer in layers:
            inputs.append(self._multiply([outputs[source][nodes] for source, nodes in layer.sources]))
            outputs.append(self._apply(layer, inputs[-1], Matrix.forward))
        weights: dict[int, Array] = {}
        derivatives: dict[int, Array] = {len(layers) - 1: np.ones((1, self._n_columns))}
        missing = set(queries)
        for number in range(len(layers) - 1, -1, -1):
            layer, derivative = layers[number], derivatives.pop(number)
            if layer.variable in missing:
                n_outcomes = queries[layer.variable]
                weights[layer.variable] = _compute_joint(
                    layer, evidence, inputs[number], derivative, n_outcomes
                )
                missing.discard(layer.variable)
            if not missing:
                break
            if not layer.sources:
                continue
            own = self._apply(layer, derivative, Matrix.backward)
            factors = [outputs[source][nodes] for source, nodes in layer.sources]
            products = multiply_others(own, factors, lambda a, b: self._multiply((a, b)))
            for (source, nodes), product in zip(layer.sources, products, strict=True):
                derivatives[source] = np.zeros_like(outputs[source])
                np.add.at(derivatives[source], nodes, product)
        for likelihoods in evidence.weights.values():
            self._is_extreme |= ((likelihoods > 0) & (likelihoods < MIN_NUMBER)).any(axis=1)
        if self._unchecked:
            self._find_extremes()
        return weights, self._is_extreme

    def _multiply(self, factors: Sequence[Array]) -> Array:
        """(inputs, B) Multiply the columns of the branches before a layer; 1 if there are none."""
        if not factors:
            return np.ones((1, self._n_columns))
        product = reduce(np.multiply, factors)
        if len(factors) > 1:
            self._check(product)
        if len(factors) > 3 and not product.all():
            self._is_extreme |= ((product == 0) & reduce(np.logical_and, factors)).any(axis=0)
        return product

    def _apply(self, layer: Layer, columns: Array, multiply: Callable[[Matrix, Array], Array]) -> Array:
        """Multiply each column by the matrix that its evidence selects, and scale it to a sum of 1."""
        result = _select(layer, self._evidence, columns, multiply)
        total = result.sum(axis=0)
        total[total == 0] = 1.0
        result /= total
        self._check(result)
        if layer.smallest < MIN_NUMBER:
            self._is_extreme[:] = True
        return result

    def _check(self, numbers: Array) -> None:
        """Check (n, B) numbers, many of these arrays together."""
        self._unchecked.append(numbers)
        self._n_unchecked += numbers.size
        if self._n_unchecked > MAX_UNCHECKED:
            self._find_extremes()

    def _find_extremes(self) -> None:
        # floats of one sign have the order of their bits; less 1, zeros become the largest integers
        bits = np.concatenate(self._unchecked).view(np.uint64)
        bits -= np.uint64(1)
        if bits.size and bits.min() < _MIN_BITS:
            self._is_extreme |= (bits < _MIN_BITS).any(axis=0)
        self._unchecked, self._n_unchecked = [], 0


def _select(
    layer: Layer, evidence: EncodedEvidence, columns: Array, multiply: Callable[[Matrix, Array], Array]
) -> Array:
    """Multiply each column by the matrix that its evidence selects."""
    if layer.variable < 0:
        return multiply(layer.total, columns)
    own, weights = evidence.codes[:, layer.variable], evidence.weights.get(layer.variable)
    shape = layer.total.shape[0 if multiply is Matrix.forward else 1], len(own)
    if weights is not None:
        parts = [multiply(matrix, columns) * weights[:, o] for o, matrix in layer.matrices.items()]
        return reduce(np.add, parts, np.zeros(shape))
    values = np.unique(own) if len(own) > 1 else own
    result = np.zeros(shape)
    for value in values.tolist():
        matrix = layer.total if value < 0 else layer.matrices.get(value)
        if matrix and len(values) == 1:
            return multiply(matrix, columns)
        if matrix:
            result[:, own == value] = multiply(matrix, columns[:, own == value])
    return result


def _compute_joint(
    layer: Layer, evidence: EncodedEvidence, inputs: Array, derivative: Array, n_outcomes: int
) -> Array:
    """(B, outcomes) Compute the joint weights of the evidence and the outcomes of the term of a layer."""
    own, given = evidence.codes[:, layer.variable], evidence.weights.get(layer.variable)
    weights = np.zeros((len(own), n_outcomes))
    for value, matrix in layer.matrices.items():
        weights[:, value] = (matrix.forward(inputs) * derivative).sum(axis=0)
    if given is not None:
        return weights * given
    others = own[:, None] != np.arange(n_outcomes)
    weights[(own >= 0)[:, None] & others] = 0.0
    return weights
