"""The passes over a circuit for numbers of any size: each has its own exponent, so that none underflows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np

from lcorpp.reasoning.circuit.evidence import EncodedEvidence
from lcorpp.reasoning.circuit.matrices import Index, Layer, multiply_others
from lcorpp.values import Array

_ZERO_EXPONENT = -(1 << 40)
"""The exponent of 0: smaller than any other."""


class _Numbers(NamedTuple):
    """Numbers ``fraction * 2**exponent``; the fraction is 0 or in [1/2, 1)."""

    fraction: Array
    exponent: Index

    def take(self, places: Index) -> _Numbers:
        return _Numbers(self.fraction[places], self.exponent[places])

    def multiply(self, other: _Numbers) -> _Numbers:
        return _normalize(self.fraction * other.fraction, self.exponent + other.exponent)

    def sum_by(self, keys: Index, size: int) -> _Numbers:
        """Sum the rows with the same key; return (size, B) numbers."""
        largest = np.full((size, self.exponent.shape[1]), _ZERO_EXPONENT)
        np.maximum.at(largest, keys, self.exponent)
        below = np.maximum(self.exponent - largest[keys], -2000)
        total = np.zeros(largest.shape)
        np.add.at(total, keys, np.ldexp(self.fraction, below))
        return _normalize(total, largest)


def _normalize(numbers: Array, exponents: Index) -> _Numbers:
    fraction, exponent = np.frexp(numbers)
    return _Numbers(fraction, np.where(fraction == 0, _ZERO_EXPONENT, exponents + exponent))


def _convert(numbers: Array) -> _Numbers:
    return _normalize(numbers, np.zeros(numbers.shape, dtype=np.intp))


def differentiate_extended(
    layers: Sequence[Layer], evidence: EncodedEvidence, queries: Mapping[int, int]
) -> dict[int, Array]:
    """Compute the same as `passes.differentiate`, for evidence of any probability."""
    n_columns = len(evidence.codes)
    one = _convert(np.ones((1, n_columns)))
    inputs: list[_Numbers] = []
    outputs: list[_Numbers] = []
    for layer in layers:
        branches = [outputs[source].take(nodes) for source, nodes in layer.sources]
        inputs.append(reduce(_Numbers.multiply, branches) if branches else one)
        targets, sources, _, entries = _list_entries(layer, evidence)
        outputs.append(entries.multiply(inputs[-1].take(sources)).sum_by(targets, layer.total.shape[0]))
    derivatives = {len(layers) - 1: one}
    weights: dict[int, Array] = {}
    for number in range(len(layers) - 1, -1, -1):
        layer = layers[number]
        targets, sources, outcomes, entries = _list_entries(layer, evidence)
        products = entries.multiply(derivatives.pop(number).take(targets))
        if layer.variable in queries:
            joint = products.multiply(inputs[number].take(sources)).sum_by(outcomes, queries[layer.variable])
            below = np.maximum(joint.exponent - joint.exponent.max(axis=0), -2000)
            weights[layer.variable] = np.ldexp(joint.fraction, below).T
        own = products.sum_by(sources, layer.total.shape[1])
        factors = [outputs[source].take(nodes) for source, nodes in layer.sources]
        parts = multiply_others(own, factors, _Numbers.multiply) if factors else []
        for (source, nodes), part in zip(layer.sources, parts, strict=True):
            derivatives[source] = part.sum_by(nodes, layers[source].total.shape[0])
    return weights


def _list_entries(layer: Layer, evidence: EncodedEvidence) -> tuple[Index, Index, Index, _Numbers]:
    """List the entries of the matrices of a layer: output, input, outcome, and (entries, B) weights."""
    n_columns = len(evidence.codes)
    if layer.variable < 0:
        targets, sources, weights = layer.total.get_arrays()
        columns = np.repeat(weights[:, None], n_columns, axis=1)
        return targets, sources, np.zeros(len(targets), dtype=np.intp), _convert(columns)
    parts = [matrix.get_arrays() for matrix in layer.matrices.values()]
    none = np.zeros(0, dtype=np.intp)
    targets = np.concatenate([none, *[part[0] for part in parts]])
    sources = np.concatenate([none, *[part[1] for part in parts]])
    weights = np.concatenate([np.zeros(0), *[part[2] for part in parts]])
    outcomes = np.repeat(np.array(list(layer.matrices), dtype=np.intp), [len(part[0]) for part in parts])
    given = evidence.weights.get(layer.variable)
    if given is None:
        own = evidence.codes[:, layer.variable]
        selected = ((own < 0) | (own == outcomes[:, None])).astype(np.float64)
    else:
        selected = given.T[outcomes]
    return targets, sources, outcomes, _convert(selected).multiply(_convert(weights[:, None]))
