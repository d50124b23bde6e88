"""Table of precomputed answers for small evidence spaces: an answer is a look-up."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import prod

import numpy as np
import numpy.typing as npt

from lcorpp.errors import UndefinedError
from lcorpp.reasoning.answers import make_no_value_error
from lcorpp.reasoning.language.program import Program
from lcorpp.values import Array

Codes = npt.NDArray[np.intp]
"""Evidence as integers: the index of the value in the range of the input, -1 for not observed."""

MAX_TABLE_ROWS = 20_000
"""Circuits with more evidence combinations have no table."""


class AnswerTable:
    """The answers of each query to all evidence combinations.

    Args:
        sizes: the number of codes of each input, "not observed" included.
        compute_weights: returns the weights (B, outcomes) of each query for codes (B, inputs).

    is_complete: whether each evidence combination has an answer with probability 1 for a value.
    answers: query -> (combinations, values) if the table is complete; otherwise (combinations, values + 1)
        with the probability of no value last, and rows of NaN for impossible evidence.
    """

    def __init__(self, sizes: Sequence[int], compute_weights: Callable[[Codes], Mapping[str, Array]]) -> None:
        self._strides = [prod(sizes[i + 1 :]) for i in range(len(sizes))]
        grid = np.arange(prod(sizes))[:, None] // np.array(self._strides, dtype=np.intp)
        codes = grid % np.array(sizes, dtype=np.intp) - 1
        answers = {query: normalize_rows(weights) for query, weights in compute_weights(codes).items()}
        self.is_complete = all(not rows[:, -1].any() for rows in answers.values())  # any() is true for NaN
        if self.is_complete:
            answers = {query: np.ascontiguousarray(rows[:, :-1]) for query, rows in answers.items()}
        for rows in answers.values():
            rows.setflags(write=False)
        self.answers = answers
        self._row_caches: dict[tuple[int, ...], _RowCache] = {}

    @staticmethod
    def is_feasible(sizes: Sequence[int]) -> bool:
        """Whether there are few enough evidence combinations."""
        return prod(sizes) <= MAX_TABLE_ROWS

    def find_row(self, codes: Mapping[int, int]) -> int:
        """Return the row of one evidence combination, index of the input -> code."""
        return sum([(code + 1) * self._strides[column] for column, code in codes.items()])

    def find_rows(self, codes: Codes) -> Codes:
        """(B,) Return the rows of codes (B, inputs)."""
        rows = np.zeros(len(codes), dtype=np.intp)
        for column, stride in zip(codes.T, self._strides, strict=True):
            rows += (column + 1) * stride
        return rows

    def find_rows_of_values(
        self,
        inputs: tuple[int, ...],
        columns: Sequence[Sequence[str | None]],
        codes: Sequence[Mapping[str, int]],
    ) -> Codes:
        """(B,) Return the rows of columns of values.

        Args:
            inputs: the index of the input of each column.
            codes: value -> code, for each column.

        Raises:
            KeyError, TypeError: a value is unknown.
        """
        if inputs not in self._row_caches:
            strides = [self._strides[i] for i in inputs]
            self._row_caches[inputs] = _RowCache(list(zip(strides, codes, strict=True)))
        rows = self._row_caches[inputs]
        return np.fromiter(map(rows.__getitem__, zip(*columns, strict=True)), np.intp)


class _RowCache(dict[tuple[str | None, ...], int]):
    """Values -> row of the table, computed on first access."""

    def __init__(self, columns: Sequence[tuple[int, Mapping[str, int]]]) -> None:
        super().__init__()
        self._columns = columns

    def __missing__(self, values: tuple[str | None, ...]) -> int:
        row = 0
        for value, (stride, codes) in zip(values, self._columns, strict=True):
            row += 0 if value is None else (codes[value] + 1) * stride
        self[values] = row
        return row


def normalize_rows(weights: Array) -> Array:
    """Divide each row by its sum; rows of 0, those of impossible evidence, become NaN."""
    total = weights.sum(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        rows: Array = weights / total
    return rows


def check_rows(program: Program, query: str, rows: Array, undefined: str) -> Array:
    """Return the probabilities of the values of a batch; raise for rows without answer, see `Circuit`."""
    no_value = rows[:, -1]
    if no_value.any() or np.isnan(no_value).any():
        bad = np.flatnonzero(no_value > 0)
        if len(bad):
            raise make_no_value_error(program, query, no_value[bad[0]], f"row {bad[0]}: ")
        if undefined == "raise":
            row = int(np.flatnonzero(np.isnan(no_value))[0])
            raise UndefinedError(f"{program.file}: row {row}: no possible world has this evidence")
    return rows[:, :-1]
