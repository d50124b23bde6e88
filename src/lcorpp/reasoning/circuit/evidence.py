"""Check evidence for a circuit and encode it as integers."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from lcorpp.errors import ProgramError, check_type, expected_one_of
from lcorpp.reasoning.circuit.answer_table import Codes
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import make_unknown_value_error, name_value, resolve_term
from lcorpp.values import Array, Label, Likelihood

_Column = TypeVar("_Column")

Column = Label | Sequence[Label | None]
"""The evidence of a batch about one input: of each row, or one value or likelihood for all rows."""


@dataclass(frozen=True, eq=False)
class EncodedEvidence:
    """A batch of evidence.

    codes: (B, terms) the outcome of each observed term, -1 for no evidence.
    weights: index of a term -> (B, outcomes) likelihood of each outcome, in place of the codes.
    """

    codes: Codes
    weights: Mapping[int, Array] = field(default_factory=dict)

    def take(self, rows: Codes) -> EncodedEvidence:
        """Return some of the rows."""
        return EncodedEvidence(self.codes[rows], {i: own[rows] for i, own in self.weights.items()})


class EvidenceEncoder:
    """The inputs of a circuit: the terms that evidence may name. Wrong evidence raises `ProgramError`.

    names: the terms, in the order of the columns of encoded evidence.
    values: term -> range.
    codes: term -> value -> code.
    sizes: the number of codes of each input; the first code, -1, is for not observed.
    columns: term -> column.
    """

    def __init__(self, program: Program, names: Sequence[str]) -> None:
        self._program, self.names = program, tuple(names)
        self.values = {name: program.attributes[name.partition("(")[0]].values for name in self.names}
        self.codes = {n: {v: i for i, v in enumerate(self.values[n])} for n in self.names}
        self.sizes = [len(self.values[name]) + 1 for name in self.names]
        self.columns = {name: i for i, name in enumerate(self.names)}

    def canonicalize(self, evidence: Mapping[str, _Column]) -> dict[str, _Column]:
        """Replace the names by those of the inputs: ``f( 1, 2 )`` by ``f(1,2)``; no name may occur twice."""
        canonical: dict[str, _Column] = {}
        for name, value in evidence.items():
            try:
                own = name if name in self.columns else canonical_text(resolve_term(self._program, name))
            except ProgramError:
                own = name
            self.check_names((own,))
            if own in canonical:
                raise ProgramError(f"the evidence names {own} twice")
            canonical[own] = value
        return canonical

    def check_names(self, evidence: Iterable[object]) -> None:
        """Check that all names are inputs."""
        for name in evidence:
            if name not in self.codes:
                raise ProgramError(f"{name!r} is not an input of the circuit; {expected_one_of(self.names)}")

    def resolve(self, evidence: Mapping[str, object]) -> dict[str, str]:
        """Return evidence with the names of values; check that all names are inputs, with values in range."""
        check_type(evidence, Mapping, "evidence", ProgramError)
        self.check_names(evidence)
        return {name: self.values[name][self.encode_value(name, value)] for name, value in evidence.items()}

    def name_values(self, evidence: Mapping[str, _Column]) -> dict[str, _Column]:
        """Replace integers and truth values that denote values of their inputs by names; see `name_value`."""
        named = {name: name_value(value) for name, value in evidence.items()}
        return {
            name: own if isinstance(own := named[name], str) and own in self.codes[name] else value  # type: ignore[misc]
            for name, value in evidence.items()
        }

    def encode_value(self, name: str, value: object, where: str = "") -> int:
        """Return the code of a value of an input; `where` is the beginning of the message of an error."""
        named = name_value(value)
        code = self.codes[name].get(named) if isinstance(named, str) else None
        if code is None:
            raise make_unknown_value_error(value, name, self.values[name], where)
        return code

    def encode(self, evidence: Mapping[str, Column]) -> EncodedEvidence:
        """Encode a batch of evidence, input -> column; a batch without sequences has one row."""
        check_type(evidence, Mapping, "evidence", ProgramError)
        self.check_names(evidence)
        evidence = self.name_values(evidence)
        one = (str, Likelihood)
        for name, column in evidence.items():
            if isinstance(column, Mapping | Set):
                raise ProgramError(
                    f"the column of {name} is {reprlib.repr(column)}; expected a sequence of values"
                )
            if not (hasattr(column, "__len__") or isinstance(column, one)):
                self.encode_value(name, column)
        sizes = {len(column) for column in evidence.values() if not isinstance(column, one)} or {1}
        if len(sizes) != 1:
            raise ProgramError(f"the columns of a batch have one length, not {sorted(sizes)}")
        size = sizes.pop()
        codes = np.full((size, len(self.names)), -1, dtype=np.intp)
        weights: dict[int, Array] = {}
        for name, column in evidence.items():
            values: list[Any] = [column] * size if isinstance(column, one) else list(column)
            code_of: dict[str | None, int] = {None: -1} | self.codes[name]
            try:
                encoded = np.fromiter(map(code_of.__getitem__, values), np.intp, size)
            except (KeyError, TypeError):  # likelihoods, integers, truth values or unknown values
                places = (
                    [f"row {row}: " for row in range(size)] if not isinstance(column, one) else [""] * size
                )
                if any(isinstance(value, Likelihood) for value in values):
                    rows = [self._weigh(name, *own) for own in zip(values, places, strict=True)]
                    weights[self.columns[name]] = np.array(rows).reshape(size, self.sizes[self.columns[name]])
                    continue
                encoded = np.array(
                    [
                        -1 if value is None else self.encode_value(name, value, where)
                        for value, where in zip(values, places, strict=True)
                    ]
                )
            codes[:, self.columns[name]] = encoded
        return EncodedEvidence(codes, weights)

    def encode_values(self, evidence: Mapping[str, Column]) -> Codes:
        """(B, inputs) Encode a batch of evidence without likelihoods, see `Circuit.encode`."""
        encoded = self.encode(evidence)
        if encoded.weights:
            names = ", ".join([self.names[i] for i in encoded.weights])
            raise ProgramError(f"the likelihoods of {names} have no codes")
        return encoded.codes

    def make_row(self, codes: Mapping[int, int]) -> EncodedEvidence:
        """Encode one evidence, column -> code."""
        row = np.full((1, len(self.names)), -1, dtype=np.intp)
        row[0, list(codes)] = list(codes.values())
        return EncodedEvidence(row)

    def decode(self, row: Codes) -> dict[str, str]:
        """Return the evidence of one row of codes, term -> value."""
        return {n: self.values[n][i] for n, i in zip(self.names, row.tolist(), strict=True) if i >= 0}

    def _weigh(self, name: str, value: object, where: str) -> list[float]:
        """Return the weights of the outcomes of an input; the last one is for having no value."""
        values = self.values[name]
        if value is None:
            return [1.0] * (len(values) + 1)
        if not isinstance(value, Likelihood):
            code = self.encode_value(name, value, where)
            return [float(i == code) for i in range(len(values) + 1)]
        if value.values == values:
            return [*value.weights.tolist(), 0.0]
        if set(value.values) != set(values):
            raise ProgramError(
                f"{where}a likelihood of {', '.join(value.values)} for {name}; {expected_one_of(values)}"
            )
        weight_of = dict(value)
        return [*[weight_of[v] for v in values], 0.0]

    def check_codes(self, codes: Codes) -> Codes:
        """Check the shape, type and range of codes (B, inputs); return them with the index type."""
        if codes.ndim != 2 or codes.shape[1] != len(self.names) or codes.dtype.kind not in "iu":
            raise ProgramError(
                f"expected integer codes of shape (B, {len(self.names)}), not {codes.dtype} {codes.shape}"
            )
        sizes = np.array(self.sizes, dtype=np.intp)
        wrong = (codes < -1) | (codes >= sizes - 1)
        if wrong.any():
            row, column = (int(i) for i in np.argwhere(wrong)[0])
            raise ProgramError(
                f"row {row}: code {codes[row, column]} of {self.names[column]};"
                f" expected -1 to {self.sizes[column] - 2}"
            )
        return codes.astype(np.intp, copy=False)  # small integer types would overflow
