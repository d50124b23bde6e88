"""The arithmetic circuit: one sparse matrix for each value of each observed term, all else multiplied out.

Let t1, ..., tn be the terms that evidence may name or a query may ask for, in the order in which they are
decided. The probability that they have the values v1, ..., vn is ending . M_n[vn] ... M_1[v1] . beginning.
To leave a term open is to take the sum of its matrices, which is the circuit with its evidence indicators
set to 1.

Source: Darwiche, "A differential approach to inference in Bayesian networks", J. ACM 50(3), 2003, for
circuits with indicators and for marginals as derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcorpp.reasoning.circuit.answer_table import Codes
from lcorpp.values import Array

Index = npt.NDArray[np.intp]

DENSE = 4096
"""Matrices with at most this many entries, zeros counted, are kept dense: it is faster."""


@dataclass(frozen=True, eq=False)
class Matrix:
    """A matrix of non-negative numbers that is applied to columns.

    shape: (outputs, inputs).
    dense: (outputs, inputs), or None.
    source, weight: (entries,) sorted by target.
    target, start: (rows,) the rows with entries, and where the entries of each begin.
    """

    shape: tuple[int, int]
    dense: Array | None
    source: Index
    weight: Array
    target: Index
    start: Index

    @classmethod
    def of(cls, shape: tuple[int, int], entries: Mapping[tuple[int, int], float]) -> Matrix:
        """From (target, source) -> weight."""
        none = np.zeros(0, dtype=np.intp)
        if shape[0] * shape[1] <= DENSE:
            dense = np.zeros(shape)
            for place, weight in entries.items():
                dense[place] = weight
            return cls(shape, dense, none, np.zeros(0), none, none)
        keys = sorted(entries)
        targets = np.array([key[0] for key in keys], dtype=np.intp)
        rows, begins = np.unique(targets, return_index=True)
        source = np.array([key[1] for key in keys], dtype=np.intp)
        return cls(
            shape, None, source, np.array([entries[key] for key in keys]), rows, begins.astype(np.intp)
        )

    def entries(self) -> dict[tuple[int, int], float]:
        """(target, source) -> weight, for those that are not zero."""
        if self.dense is not None:
            targets, sources = np.nonzero(self.dense)
            weights = self.dense[targets, sources]
        else:
            counts = np.diff(np.append(self.start, len(self.source)))
            targets, sources, weights = np.repeat(self.target, counts), self.source, self.weight
        pairs = zip(targets.tolist(), sources.tolist(), strict=True)
        return dict(zip(pairs, weights.tolist(), strict=True))

    def forward(self, columns: Array) -> Array:
        """(outputs, B) the product with (inputs, B)."""
        if self.dense is not None:
            return self.dense @ columns
        result = np.zeros((self.shape[0], columns.shape[1]))
        if len(self.source):
            result[self.target] = np.add.reduceat(columns[self.source] * self.weight[:, None], self.start)
        return result

    def backward(self, columns: Array) -> Array:
        """(inputs, B) the product of the transpose with (outputs, B)."""
        if self.dense is not None:
            return self.dense.T @ columns
        result = np.zeros((self.shape[1], columns.shape[1]))
        counts = np.diff(np.append(self.start, len(self.source)))
        np.add.at(result, self.source, columns[np.repeat(self.target, counts)] * self.weight[:, None])
        return result


@dataclass(frozen=True, eq=False)
class Layer:
    """The part of the circuit at one observed term.

    label: the position of the term among the observed ones, -1 where only a product is taken.
    matrices: outcome -> its matrix; outcomes that cannot be are missing.
    every: the sum of the matrices.
    """

    label: int
    matrices: Mapping[int, Matrix]
    every: Matrix

    @classmethod
    def never(cls, label: int, outcome: int) -> Layer:
        """The layer of a term that always has the same outcome, at the beginning."""
        one = Matrix.of((1, 1), {(0, 0): 1.0})
        return cls(label, {outcome: one}, one)


CHUNK = 4_000_000
"""How many numbers one pass over a batch may keep in memory."""


def forward_backward(
    layers: Sequence[Layer], ending: Array, codes: Codes, asked: Mapping[int, int]
) -> dict[int, Array]:
    """The joint weights of the evidence and each outcome of the terms asked for, chunk by chunk.

    Args:
        codes: (B, observed) the outcome of each observed term, -1 where it is left open.
        asked: position of the term -> how many outcomes it has.

    Returns:
        Position -> (B, outcomes) weights; only the ratios within a row mean something. A row of zeros says
        that the evidence is impossible.
    """
    width = sum(layer.every.shape[1] for layer in layers) + 1
    size = max(1, CHUNK // width)
    chunks = [
        _evaluate(layers, ending, codes[i : i + size], asked) for i in range(0, max(len(codes), 1), size)
    ]
    return {label: np.concatenate([chunk[label] for chunk in chunks]) for label in asked}


def _evaluate(
    layers: Sequence[Layer], ending: Array, codes: Codes, asked: Mapping[int, int]
) -> dict[int, Array]:
    """One pass up and one down."""
    up = [np.ones((1, len(codes)))]
    for layer in layers:
        up.append(_normal(_apply(layer, codes, up[-1], Matrix.forward)))
    found: dict[int, Array] = {}
    down = np.repeat(ending[:, None], len(codes), axis=1)
    wanted = set(asked)
    for number in range(len(layers) - 1, -1, -1):
        layer = layers[number]
        if layer.label in wanted:
            found[layer.label] = _joint(layer, codes, up[number], down, asked[layer.label])
            wanted.discard(layer.label)
        if not wanted:
            break
        down = _normal(_apply(layer, codes, down, Matrix.backward))
    return found


def _apply(layer: Layer, codes: Codes, columns: Array, product) -> Array:  # type: ignore[no-untyped-def]
    """The product with the matrices that the evidence chooses, column by column."""
    if layer.label < 0:
        return product(layer.every, columns)  # type: ignore[no-any-return]
    own = codes[:, layer.label]
    values = np.unique(own) if len(own) > 1 else own
    parts = []
    for value in values.tolist():
        matrix = layer.every if value < 0 else layer.matrices.get(value)
        here = columns if len(values) == 1 else columns[:, own == value]
        parts.append((value, product(matrix, here) if matrix else None))
    height = layer.every.shape[0 if product is Matrix.forward else 1]
    if len(parts) == 1 and parts[0][1] is not None:
        return parts[0][1]  # type: ignore[no-any-return]
    result = np.zeros((height, len(codes)))
    for value, part in parts:
        if part is not None:
            result[:, own == value] = part
    return result


def _joint(layer: Layer, codes: Codes, above: Array, below: Array, outcomes: int) -> Array:
    own = codes[:, layer.label]
    weights = np.zeros((len(codes), outcomes))
    for value, matrix in layer.matrices.items():
        weights[:, value] = (matrix.forward(above) * below).sum(axis=0)
    others = own[:, None] != np.arange(outcomes)
    weights[(own >= 0)[:, None] & others] = 0.0
    return weights


def _normal(columns: Array) -> Array:
    """Columns scaled to a sum of 1, so that no product vanishes; those of zeros stay."""
    total = columns.sum(axis=0)
    total[total == 0] = 1.0
    columns /= total
    return columns
