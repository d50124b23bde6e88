"""Passes through the circuit: new evidence chooses the matrices, the rest is products."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lcorpp.reasoning.circuit.answer_table import Codes
from lcorpp.reasoning.circuit.matrices import Layer, Matrix
from lcorpp.values import Array

CHUNK = 4_000_000
"""How many numbers one pass over a batch may keep in memory."""


def evaluate(
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
