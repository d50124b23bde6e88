"""The answers to all evidences, worked out at once where they are few: an answer then is a look-up."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import prod

import numpy as np
import numpy.typing as npt

from lcorpp.values import Array

Codes = npt.NDArray[np.intp]

TABLE = 20_000
"""Up to so many different evidences have all their answers worked out."""

LOST = 1e-250
"""Weights of evidence below this are not trusted: they may have lost their digits, or vanished."""


class AnswerTable:
    """For each query the answers to all evidences, in the order of their codes; made when first needed.

    Args:
        sizes: how many codes each input has; the first, -1, is for not observed.
        weigh: gives the weights of each query for codes (B, inputs).

    answers: query -> (evidences, values) if every evidence has an answer (`sound`), else (evidences,
        values + 1) with the share of having no value last, and rows of NaN for impossible evidence.
    """

    def __init__(self, sizes: Sequence[int], weigh: Callable[[Codes], Mapping[str, Array]]) -> None:
        self._sizes = sizes
        self.steps = [prod(sizes[i + 1 :]) for i in range(len(sizes))]
        grid = np.arange(prod(sizes))[:, None] // np.array(self.steps, dtype=np.intp)
        codes = grid % np.array(sizes, dtype=np.intp) - 1
        found = {query: normalised(weights) for query, weights in weigh(codes).items()}
        self.sound = all(not rows[:, -1].any() for rows in found.values())  # NaN is true
        if self.sound:
            found = {query: np.ascontiguousarray(rows[:, :-1]) for query, rows in found.items()}
        for rows in found.values():
            rows.setflags(write=False)
        self.answers = found
        self._rows: dict[tuple[int, ...], _Rows] = {}

    @staticmethod
    def fit(sizes: Sequence[int]) -> bool:
        """Whether there are few enough evidences."""
        return prod(sizes) <= TABLE

    def index(self, codes: Mapping[int, int]) -> int:
        """Where the answer to one evidence stands, input -> code."""
        return sum([(code + 1) * self.steps[column] for column, code in codes.items()])

    def indexes(self, codes: Codes) -> Codes:
        """(B,) where the answers to evidences (B, inputs) stand."""
        index = np.zeros(len(codes), dtype=np.intp)
        for column, step in zip(codes.T, self.steps, strict=True):
            index += (column + 1) * step
        return index

    def indexes_of(
        self,
        inputs: tuple[int, ...],
        columns: Sequence[Sequence[str | None]],
        known: Sequence[Mapping[str, int]],
    ) -> Codes:
        """(B,) the same for columns of values.

        Args:
            inputs: the input of each column.
            known: for each column, value -> code.

        Raises:
            KeyError, TypeError: a value is none of its input.
        """
        if inputs not in self._rows:
            places = [(self.steps[i], codes) for i, codes in zip(inputs, known, strict=True)]
            self._rows[inputs] = _Rows(places)
        return np.fromiter(map(self._rows[inputs].__getitem__, zip(*columns, strict=True)), np.intp)


class _Rows(dict[tuple[str | None, ...], int]):
    """Where the answer to some values stands in a table; found once for each combination."""

    def __init__(self, places: Sequence[tuple[int, Mapping[str, int]]]) -> None:
        super().__init__()
        self._places = places

    def __missing__(self, values: tuple[str | None, ...]) -> int:
        index = 0
        for value, (step, codes) in zip(values, self._places, strict=True):
            index += 0 if value is None else (codes[value] + 1) * step
        self[values] = index
        return index


def normalised(weights: Array) -> Array:
    """Rows of weights, each divided by its sum; NaN where there is nothing to divide."""
    total = weights.sum(axis=1, keepdims=True)
    total[total < LOST] = 0.0
    with np.errstate(invalid="ignore", divide="ignore"):
        rows: Array = weights / total
    rows[total[:, 0] == 0] = np.nan
    return rows
