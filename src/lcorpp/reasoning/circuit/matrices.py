"""Compilation, steps 4 and 5: the layered arithmetic circuit (a tree of sparse matrices) and its evaluation.

Let t1, ..., tn be the terms that evidence may name or a query may read; all other terms are summed out. The
circuit has a layer for each of them, with one matrix for each value. A layer multiplies a column of inputs by
the matrix of the observed value; without evidence by the sum of the matrices, which is the circuit with all
evidence indicators of the term set to 1. Its inputs are products of outputs of the layers before it: one
factor for each independent branch of the program. So for a chain the probability of t1=v1, ..., tn=vn is

    M_1[v1] . M_2[v2] ... M_n[vn] . [1]

An upward and a downward pass give the joint probability of the evidence and each value of any term: the
derivatives with respect to the indicators.

Source: Darwiche, "A differential approach to inference in Bayesian networks", J. ACM 50(3), 2003.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
import numpy.typing as npt

from lcorpp.reasoning.circuit.answer_table import Codes
from lcorpp.values import Array

Index = npt.NDArray[np.intp]

MAX_DENSE_ENTRIES = 4096
"""Matrices with at most this many entries, zeros included, are dense, which is faster."""

MAX_CHUNK_NUMBERS = 4_000_000
"""A pass over a batch keeps at most this many numbers in memory."""


@dataclass(frozen=True, eq=False)
class Matrix:
    """A non-negative matrix that multiplies columns; dense if it is small, otherwise sparse by rows.

    shape: (outputs, inputs).
    dense: (outputs, inputs), None if the matrix is sparse.
    source, weight: (entries,) the input and the weight of each entry, sorted by output.
    target, start: (rows,) the outputs with entries, and the index of the first entry of each.
    """

    shape: tuple[int, int]
    dense: Array | None
    source: Index
    weight: Array
    target: Index
    start: Index

    @classmethod
    def from_entries(cls, shape: tuple[int, int], entries: Mapping[tuple[int, int], float]) -> Matrix:
        """Build a matrix from (output, input) -> weight."""
        none = np.zeros(0, dtype=np.intp)
        if shape[0] * shape[1] <= MAX_DENSE_ENTRIES:
            dense = np.zeros(shape)
            for place, weight in entries.items():
                dense[place] = weight
            return cls(shape, dense, none, np.zeros(0), none, none)
        keys = sorted(entries)
        outputs = np.array([key[0] for key in keys], dtype=np.intp)
        target, start = np.unique(outputs, return_index=True)
        source = np.array([key[1] for key in keys], dtype=np.intp)
        weights = np.array([entries[key] for key in keys])
        return cls(shape, None, source, weights, target, start.astype(np.intp))

    def __repr__(self) -> str:
        n_entries = np.count_nonzero(self.dense) if self.dense is not None else len(self.source)
        return f"Matrix({self.shape[0]} x {self.shape[1]}, {n_entries} entries)"

    def list_entries(self) -> dict[tuple[int, int], float]:
        """List the entries that are not zero: (output, input) -> weight."""
        if self.dense is not None:
            outputs, inputs = np.nonzero(self.dense)
            weights = self.dense[outputs, inputs]
        else:
            outputs, inputs, weights = self._repeat_targets(), self.source, self.weight
        pairs = zip(outputs.tolist(), inputs.tolist(), strict=True)
        return dict(zip(pairs, weights.tolist(), strict=True))

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


def evaluate(layers: Sequence[Layer], codes: Codes) -> Array:
    """(B,) Compute the joint weights of outcomes of observed terms, up to one factor for all rows.

    Args:
        layers, codes: as in `differentiate`.
    """
    size = max(1, MAX_CHUNK_NUMBERS // sum(sum(layer.total.shape) for layer in layers))
    chunks = []
    for start in range(0, len(codes), size):
        chunk = codes[start : start + size]
        outputs: list[Array] = []
        for layer in layers:
            outputs.append(
                _apply(layer, chunk, _multiply_sources(layer, outputs, len(chunk)), Matrix.forward)
            )
        chunks.append(outputs[-1][0])
    return np.concatenate(chunks)


def differentiate(layers: Sequence[Layer], codes: Codes, queries: Mapping[int, int]) -> dict[int, Array]:
    """Compute the joint weights of the evidence and each outcome of the queried terms.

    Args:
        layers: each after its sources; the last one has one output, the weight of the evidence.
        codes: (B, observed terms) the outcome of each observed term, -1 for no evidence.
        queries: index of a queried term -> the number of its outcomes.

    Returns:
        index -> (B, outcomes) weights; only the ratios within a row matter. A row is 0 for impossible
        evidence.
    """
    width = sum(sum(layer.total.shape) for layer in layers)
    size = max(1, MAX_CHUNK_NUMBERS // width)
    chunks = [_run_passes(layers, codes[i : i + size], queries) for i in range(0, max(len(codes), 1), size)]
    return {variable: np.concatenate([chunk[variable] for chunk in chunks]) for variable in queries}


def _run_passes(layers: Sequence[Layer], codes: Codes, queries: Mapping[int, int]) -> dict[int, Array]:
    """Run an upward and a downward pass over one chunk of a batch."""
    inputs: list[Array] = []
    outputs: list[Array] = []
    for layer in layers:
        inputs.append(_multiply_sources(layer, outputs, len(codes)))
        outputs.append(_normalize_columns(_apply(layer, codes, inputs[-1], Matrix.forward)))
    weights: dict[int, Array] = {}
    derivatives: dict[int, Array] = {len(layers) - 1: np.ones((1, len(codes)))}
    missing = set(queries)
    for number in range(len(layers) - 1, -1, -1):
        layer, derivative = layers[number], derivatives.pop(number)
        if layer.variable in missing:
            n_outcomes = queries[layer.variable]
            weights[layer.variable] = _compute_joint(layer, codes, inputs[number], derivative, n_outcomes)
            missing.discard(layer.variable)
        if not missing:
            break
        if not layer.sources:
            continue
        own = _normalize_columns(_apply(layer, codes, derivative, Matrix.backward))
        for source, nodes in layer.sources:
            others = [outputs[other][places] for other, places in layer.sources if other != source]
            part = np.zeros_like(outputs[source])
            np.add.at(part, nodes, reduce(np.multiply, others, own))
            derivatives[source] = part
    return weights


def _multiply_sources(layer: Layer, outputs: Sequence[Array], n_columns: int) -> Array:
    """(inputs, B) Multiply the outputs of the branches before a layer."""
    if not layer.sources:
        return np.ones((1, n_columns))
    return reduce(np.multiply, [outputs[source][nodes] for source, nodes in layer.sources])


def _apply(layer: Layer, codes: Codes, columns: Array, multiply: Callable[[Matrix, Array], Array]) -> Array:
    """Multiply each column by the matrix that its evidence selects."""
    if layer.variable < 0:
        return multiply(layer.total, columns)
    own = codes[:, layer.variable]
    values = np.unique(own) if len(own) > 1 else own
    result = np.zeros((layer.total.shape[0 if multiply is Matrix.forward else 1], len(codes)))
    for value in values.tolist():
        matrix = layer.total if value < 0 else layer.matrices.get(value)
        if matrix and len(values) == 1:
            return multiply(matrix, columns)
        if matrix:
            result[:, own == value] = multiply(matrix, columns[:, own == value])
    return result


def _compute_joint(layer: Layer, codes: Codes, inputs: Array, derivative: Array, n_outcomes: int) -> Array:
    own = codes[:, layer.variable]
    weights = np.zeros((len(codes), n_outcomes))
    for value, matrix in layer.matrices.items():
        weights[:, value] = (matrix.forward(inputs) * derivative).sum(axis=0)
    others = own[:, None] != np.arange(n_outcomes)
    weights[(own >= 0)[:, None] & others] = 0.0
    return weights


def _normalize_columns(columns: Array) -> Array:
    """Scale columns in place to a sum of 1, so that long products do not underflow; columns of zeros stay."""
    total = columns.sum(axis=0)
    total[total == 0] = 1.0
    columns /= total
    return columns
