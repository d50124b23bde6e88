"""Check evidence and encode it as integers."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ProgramError, check_type, expected_one_of
from lcorpp.notebook import join_some
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import make_unknown_value_error, name_value, resolve_term
from lcorpp.values import Array, Label, Likelihood

Codes = npt.NDArray[np.intp]
"""Evidence as integers: the index of the value in the range of the input, -1 for not observed."""

_Column = TypeVar("_Column")

Column = Label | Sequence[Label | None]
"""The evidence of a batch about one input: of each row, or one value or likelihood for all rows."""


@dataclass(frozen=True, eq=False)
class EncodedEvidence:
    """A batch of evidence.

    codes: (B, terms) the outcome of each observed term, -1 for no evidence; or, if `weights` has the term, a
        row of it.
    weights: index of a term -> (n, outcomes) the weights of the outcomes for each of n labels: likelihoods,
        values and no evidence.
    """

    codes: Codes
    weights: Mapping[int, Array] = field(default_factory=dict)

    def take(self, rows: Codes) -> EncodedEvidence:
        """Return some of the rows."""
        return EncodedEvidence(self.codes[rows], self.weights)

    def number_rows(self) -> tuple[Codes, Codes]:
        """Number the distinct rows; return the index of one row of each number, and the number of each row.

        If many rows may be distinct, each has its own number.
        """
        n_rows, size = len(self.codes), 1
        keys = np.zeros(n_rows, dtype=np.intp)
        for column in self.codes.T if n_rows > 1 else ():
            lowest = column.min()
            n_codes = int(column.max() - lowest) + 1
            size *= n_codes
            if size > 4 * n_rows:
                break
            keys = keys * n_codes + (column - lowest)
        if n_rows < 2 or size > 4 * n_rows:
            return np.arange(n_rows), np.arange(n_rows)
        rows, numbers = np.full(size, -1), np.zeros(size, dtype=np.intp)
        rows[keys] = np.arange(n_rows)
        distinct = np.flatnonzero(rows >= 0)
        numbers[distinct] = np.arange(len(distinct))
        return rows[distinct], numbers[keys]

    def weigh(self, variable: int, outcomes: Codes) -> Any:
        """(n, B) Return the weights of n outcomes of a term; None if no row has evidence about it.

        Without likelihoods the weights are truth values.
        """
        if not 0 <= variable < self.codes.shape[1]:
            return None
        codes = self.codes[:, variable]
        if variable in self.weights:
            weights: Array = self.weights[variable].T[outcomes][:, codes]
            return weights
        lowest, highest = self._bounds
        if highest[variable] < 0:
            return None
        is_outcome = codes == outcomes[:, None]
        return is_outcome | (codes < 0) if lowest[variable] < 0 else is_outcome

    @cached_property
    def _bounds(self) -> tuple[list[int], list[int]]:
        """The smallest and the largest code of each term."""
        lowest, highest = self.codes.min(axis=0, initial=0), self.codes.max(axis=0, initial=-1)
        return lowest.tolist(), highest.tolist()


class EvidenceEncoder:
    """The inputs of a circuit: the terms that evidence may name. Wrong evidence raises `ProgramError`.

    names: the terms, in the order of the columns of encoded evidence.
    values: term -> range.
    codes: term -> value -> code.
    columns: term -> column.
    """

    def __init__(self, program: Program, names: Sequence[str]) -> None:
        self._program, self.names = program, tuple(names)
        self.values = {name: program.signature.find_attribute(name).values for name in self.names}
        self.codes = {n: {v: i for i, v in enumerate(self.values[n])} for n in self.names}
        self.columns = {name: i for i, name in enumerate(self.names)}

    def canonicalize(self, evidence: Mapping[str, _Column]) -> dict[str, _Column]:
        """Return evidence with the names of inputs and values.

        Names may be spelled differently, as ``f( 1, 2 )`` for ``f(1,2)``; values may be integers and truth
        values, see `name_value`.
        """
        check_type(evidence, Mapping, "evidence", ProgramError)
        canonical: dict[str, Any] = {}
        for name, value in evidence.items():
            own = name
            if name not in self.codes:
                with suppress(ProgramError):
                    own = canonical_text(resolve_term(self._program, name))
            if own not in self.codes:
                raise ProgramError(f"{own!r} is not an input; {expected_one_of(self.names)}")
            if own in canonical:
                raise ProgramError(f"the evidence names {own} twice")
            named = name_value(value)
            canonical[own] = named if isinstance(named, str) and named in self.codes[own] else value
        return canonical

    def encode_value(self, name: str, value: object, where: str = "") -> int:
        """Return the code of a value of an input; `where` is the beginning of the message of an error."""
        named = name_value(value)
        code = self.codes[name].get(named) if isinstance(named, str) else None
        if code is None:
            raise make_unknown_value_error(value, name, self.values[name], where)
        return code

    def resolve(self, evidence: Mapping[str, object]) -> dict[str, str]:
        """Return evidence with the names of inputs and values; check that all values are in range."""
        evidence = self.canonicalize(evidence)
        return {name: self.values[name][self.encode_value(name, value)] for name, value in evidence.items()}

    def encode(self, evidence: Mapping[str, Column]) -> tuple[EncodedEvidence, bool]:
        """Encode canonical evidence; return it, and whether it is a batch, with a sequence for some input."""
        columns: dict[str, Sequence[Any]] = {}
        for name, column in evidence.items():
            if isinstance(column, str | Likelihood):
                continue
            if isinstance(column, Mapping | Set):
                raise ProgramError(
                    f"the column of {name} is {reprlib.repr(column)}; expected a sequence of values"
                )
            if not hasattr(column, "__len__"):
                raise make_unknown_value_error(column, name, self.values[name])
            columns[name] = column.tolist() if isinstance(column, np.ndarray) else column
        sizes = {len(column) for column in columns.values()} or {1}
        if len(sizes) != 1:
            raise ProgramError(f"the columns of a batch have one length, not {sorted(sizes)}")
        codes = np.full((sizes.pop(), len(self.names)), -1, dtype=np.intp)
        weights: dict[int, Array] = {}
        for name, value in evidence.items():
            number = self.columns[name]
            if name in columns:
                codes[:, number] = self._encode_column(number, columns[name], "row {}: ", weights)
            elif isinstance(value, str):
                codes[:, number] = self.encode_value(name, value)
            else:
                codes[:, number] = self._encode_column(number, [value], "", weights)
        return EncodedEvidence(codes, weights), bool(columns)

    def _encode_column(
        self, number: int, values: Sequence[Any], where: str, weights: dict[int, Array]
    ) -> Codes:
        """Return the codes of a column, and add its weights if it has likelihoods; see `EncodedEvidence`."""
        name = self.names[number]
        code_of = {None: -1} | self.codes[name]
        try:
            return np.fromiter(map(code_of.__getitem__, values), np.intp, len(values))
        except (KeyError, TypeError):  # likelihoods, integers, truth values or unknown values
            pass
        labels: list[int | Likelihood] = []
        for row, value in enumerate(values):
            if isinstance(value, Likelihood):
                labels.append(value)
            else:
                labels.append(-1 if value is None else self.encode_value(name, value, where.format(row)))
        numbers = {label: i for i, label in enumerate(dict.fromkeys(labels))}
        if not any(isinstance(label, Likelihood) for label in numbers):
            return np.array(labels)
        weights[number] = np.array(
            [self.list_weights(name, label, where.format(labels.index(label))) for label in numbers]
        )
        return np.array([numbers[label] for label in labels])

    def list_weights(self, name: str, label: int | Likelihood, where: str = "") -> list[float]:
        """List the weights of the outcomes of an input; the last outcome is having no value."""
        values = self.values[name]
        if not isinstance(label, Likelihood):
            return [float(label in (i, -1)) for i in range(len(values) + 1)]
        weight_of = dict(label)
        if weight_of.keys() != set(values):
            raise ProgramError(
                f"{where}a likelihood of {join_some(label.values)} for {name};"
                f" expected a number for each of {join_some(values)}"
            )
        return [*[weight_of[value] for value in values], 0.0]

    def check_codes(self, codes: Codes) -> EncodedEvidence:
        """Check the shape, type and range of codes (B, inputs)."""
        if codes.ndim != 2 or codes.shape[1] != len(self.names) or codes.dtype.kind not in "iu":
            raise ProgramError(
                f"expected integer codes of shape (B, {len(self.names)}), not {codes.dtype} {codes.shape}"
            )
        sizes = np.array([len(self.values[name]) for name in self.names], dtype=np.intp)
        wrong = (codes < -1) | (codes >= sizes)
        if wrong.any():
            row, column = (int(i) for i in np.argwhere(wrong)[0])
            raise ProgramError(
                f"row {row}: code {codes[row, column]} of {self.names[column]};"
                f" expected -1 to {sizes[column] - 1}"
            )
        return EncodedEvidence(codes.astype(np.intp, copy=False))  # small integer types would overflow
