"""The arithmetic circuit: one sparse matrix for each value of each observed term, all else multiplied out.

Let t1, ..., tn be the terms that evidence may name or a query may ask for, in the order in which they are
decided. The probability that they have the values v1, ..., vn is ending . M_n[vn] ... M_1[v1] . beginning.
To leave a term open is to take the sum of its matrices, which is the circuit with its evidence indicators
set to 1.

Source: Darwiche, "A differential approach to inference in Bayesian networks", J. ACM 50(3), 2003, for
circuits with indicators and for marginals as derivatives.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lcorpp.reasoning.circuit.trellis import Trellis
from lcorpp.values import Array

Index = npt.NDArray[np.intp]

DENSE = 4096
"""Matrices with at most this many entries, zeros counted, are kept dense: it is faster."""

TINY = 1e-60
"""Weights below this are scaled up: only their ratios matter, and a long product would vanish."""


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


def layered(paths: Trellis, labels: Mapping[int, int]) -> tuple[list[Layer], Array]:
    """Multiply out everything between the observed terms.

    Args:
        labels: term -> its position among the observed ones.

    Returns:
        (layers, ending): the layers in order, applied to the column [1], and the row that ends the product.
    """
    weights, asked = paths.floats(), set(labels)
    layers: list[Layer] = []
    width = 1
    carried: list[dict[int, float]] = [{0: 1.0}] if paths.layers[0] else []  # state -> input -> weight
    spent = 0
    for position, (sources, targets, moves) in enumerate(paths.edges):
        terms = paths.plan.order[position]
        count = paths.layers[position + 1]
        own = [] if asked.isdisjoint(terms) else [i for i, term in enumerate(terms) if term in asked]
        spent += len(sources)
        if own:
            nodes = [
                tuple([paths.moves[m][0][i] for i in own[1:]]) for m in moves
            ]  # what the labels after the first one still have to tell apart
            entries: dict[tuple[int, tuple[int, tuple[int, ...]], int], float] = {}
            for source, target, move, rest in zip(sources, targets, moves, nodes, strict=True):
                weight, value = weights[move], paths.moves[move][0][own[0]]
                for start, carry in carried[source].items():
                    key = (value, (target, rest), start)
                    entries[key] = entries.get(key, 0.0) + carry * weight
            width = _labelled(layers, entries, [labels[terms[i]] for i in own], width, count)
            carried, spent = [{i: 1.0} for i in range(count)], 0
            continue
        carried = _carried_on(carried, width, count, zip(sources, targets, moves, strict=True), weights)
        if not position % 16:
            _scale(carried)
        if width > 1 and sum(map(len, carried)) > 4 * spent + 64:
            layers.append(_plain(carried, width))
            width = count
            carried, spent = [{i: 1.0} for i in range(count)], 0
    ending = np.zeros(width)
    for row in carried:
        for start, carry in row.items():
            ending[start] += carry
    return layers, ending


def _carried_on(
    carried: Sequence[Mapping[int, float]],
    width: int,
    count: int,
    edges: Iterable[tuple[int, int, int]],
    weights: Sequence[float],
) -> list[dict[int, float]]:
    """The weights from each input to each state, one step further."""
    if width == 1:
        plain = [row.get(0, 0.0) for row in carried]
        sums = [0.0] * count
        for source, target, move in edges:
            sums[target] += plain[source] * weights[move]
        return [{0: weight} for weight in sums]
    following: list[dict[int, float]] = [{} for _ in range(count)]
    for source, target, move in edges:
        weight, into = weights[move], following[target]
        for start, carry in carried[source].items():
            if start in into:
                into[start] += carry * weight
            else:
                into[start] = carry * weight
    return following


def _labelled(
    layers: list[Layer],
    entries: Mapping[tuple[int, tuple[int, tuple[int, ...]], int], float],
    labels: Sequence[int],
    width: int,
    count: int,
) -> int:
    """Append a layer for each label of one step; nodes between them remember the values still to be told."""
    for number, label in enumerate(labels):
        last = number == len(labels) - 1
        nodes: dict[tuple[int, tuple[int, ...]], int] = {}
        split: dict[int, dict[tuple[int, int], float]] = {}
        for (value, node, start), weight in entries.items():
            target = node[0] if last else nodes.setdefault(node, len(nodes))
            part = split.setdefault(value, {})
            part[target, start] = part.get((target, start), 0.0) + weight
        height = count if last else max(len(nodes), 1)
        layers.append(_layer(label, split, (height, width)))
        width = height
        entries = {(rest[0], (target, rest[1:]), i): 1.0 for (target, rest), i in nodes.items()}
    return width


def _layer(label: int, split: Mapping[int, Mapping[tuple[int, int], float]], shape: tuple[int, int]) -> Layer:
    every: dict[tuple[int, int], float] = {}
    for part in split.values():
        for key, weight in part.items():
            every[key] = every.get(key, 0.0) + weight
    return Layer(label, {v: Matrix.of(shape, split[v]) for v in sorted(split)}, Matrix.of(shape, every))


def _plain(carried: Sequence[Mapping[int, float]], width: int) -> Layer:
    entries = {(target, start): w for target, row in enumerate(carried) for start, w in row.items()}
    return Layer(-1, {}, Matrix.of((len(carried), width), entries))


def _scale(carried: list[dict[int, float]]) -> None:
    largest = max((weight for row in carried for weight in row.values()), default=0.0)
    if 0 < largest < TINY:
        for row in carried:
            for start in row:
                row[start] /= largest
