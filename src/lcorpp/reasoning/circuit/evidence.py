"""Check evidence for a circuit and encode it as integers."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable, Mapping, Sequence, Set
from typing import TypeVar

import numpy as np

from lcorpp.errors import ProgramError, check_type, expected_one_of
from lcorpp.reasoning.circuit.answer_table import Codes
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import make_unknown_value_error, name_value, resolve_term

_Column = TypeVar("_Column")


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

    def encode(self, evidence: Mapping[str, str | Sequence[str]]) -> Codes:
        """(B, inputs) Encode a batch of evidence, see `Circuit.encode`."""
        check_type(evidence, Mapping, "evidence", ProgramError)
        self.check_names(evidence)
        evidence = self.name_values(evidence)
        for name, column in evidence.items():
            if isinstance(column, Mapping | Set):
                raise ProgramError(
                    f"the column of {name} is {reprlib.repr(column)}; expected a sequence of values"
                )
            if not hasattr(column, "__len__"):
                self.encode_value(name, column)
        sizes = {len(column) for column in evidence.values() if not isinstance(column, str)}
        if len(sizes) != 1:
            raise ProgramError(f"the columns of a batch have one length, not {sorted(sizes) or 'none'}")
        size = sizes.pop()
        codes = np.full((size, len(self.names)), -1, dtype=np.intp)
        for name, column in evidence.items():
            values: list[str | None] = [column] * size if isinstance(column, str) else list(column)
            code_of: dict[str | None, int] = {None: -1} | self.codes[name]
            try:
                encoded = np.fromiter(map(code_of.__getitem__, values), np.intp, size)
            except (KeyError, TypeError):  # integers, truth values or unknown values
                encoded = np.array(
                    [
                        -1 if value is None else self.encode_value(name, value, f"row {row}: ")
                        for row, value in enumerate(values)
                    ]
                )
            codes[:, self.columns[name]] = encoded
        return codes

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
