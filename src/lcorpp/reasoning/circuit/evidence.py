"""What evidence for a circuit may say, and its numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TypeVar

import numpy as np

from lcorpp.errors import ProgramError, expected_one_of
from lcorpp.reasoning.circuit.answer_table import Codes
from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.resolve import resolve_term

_Column = TypeVar("_Column")


class EvidenceEncoder:
    """The terms that evidence may name.

    names: they, in their order.
    values: the range of each.
    sizes: how many codes each has; the first, -1, is for not observed.
    columns: the position of each.
    """

    def __init__(self, program: Program, names: Sequence[str]) -> None:
        self._program, self.names = program, tuple(names)
        self.values = {name: program.attributes[name.partition("(")[0]].values for name in self.names}
        self._numbers = {n: {v: i for i, v in enumerate(self.values[n])} for n in self.names}
        self.sizes = [len(self.values[name]) + 1 for name in self.names]
        self.columns = {name: i for i, name in enumerate(self.names)}

    def numbers(self, name: str) -> Mapping[str, int]:
        """The code of each value of an input."""
        return self._numbers[name]

    def canonical(self, evidence: Mapping[str, _Column]) -> dict[str, _Column]:
        """Evidence under the names of the inputs, which may be written in other ways: ``f( 1, 2 )``."""
        found: dict[str, _Column] = {}
        for name, value in evidence.items():
            try:
                own = name if name in self.columns else canonical_text(resolve_term(self._program, name))
            except ProgramError:
                own = name
            self.check_names((own,))
            if own in found:
                raise ProgramError(f"the evidence names {own} twice")
            found[own] = value
        return found

    def check_names(self, evidence: Iterable[object]) -> None:
        """Check that all are inputs.

        Raises:
            ProgramError: one is not.
        """
        for name in evidence:
            if name not in self._numbers:
                raise ProgramError(f"{name!r} is not an input of the circuit; {expected_one_of(self.names)}")

    def check(self, evidence: Mapping[str, object]) -> None:
        """Check that evidence has inputs and values of them.

        Raises:
            ProgramError: it has not.
        """
        self.check_names(evidence)
        for name, value in evidence.items():
            self.code(name, value)

    def code(self, name: str, value: object, where: str = "") -> int:
        """The position of a value in the range of an input.

        Raises:
            ProgramError: it is none of its values; the message begins with `where`.
        """
        found = self._numbers[name].get(value) if isinstance(value, str) else None
        if found is None:
            raise ProgramError(
                f"{where}{value!r} is not a value of {name}; {expected_one_of(self.values[name])}"
            )
        return found

    def codes(self, evidence: Mapping[str, str | Sequence[str]]) -> Codes:
        """(B, inputs) the codes of a batch of evidence.

        Args:
            evidence: input -> B values, None for not observed; or one value for all.

        Raises:
            ProgramError: an input or value is unknown, or the columns have different lengths.
        """
        self.check_names(evidence)
        for name, column in evidence.items():
            if not hasattr(column, "__len__"):
                self.code(name, column)
        sizes = {len(column) for column in evidence.values() if not isinstance(column, str)}
        if len(sizes) != 1:
            raise ProgramError(f"the columns of a batch have one length, not {sorted(sizes) or 'none'}")
        size = sizes.pop()
        codes = np.full((size, len(self.names)), -1, dtype=np.intp)
        for name, column in evidence.items():
            values: list[str | None] = [column] * size if isinstance(column, str) else list(column)
            table: dict[str | None, int] = {None: -1}
            table.update(self._numbers[name])
            try:
                found = np.fromiter(map(table.__getitem__, values), np.intp, size)
            except (KeyError, TypeError):
                for row, value in enumerate(values):
                    if value is not None:
                        self.code(name, value, f"row {row}: ")
                raise
            codes[:, self.columns[name]] = found
        return codes

    def checked(self, codes: Codes) -> Codes:
        """The codes (B, inputs) that a user gave.

        Raises:
            ProgramError: the array has another shape or type, or a code is out of range.
        """
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
        return codes.astype(np.intp, copy=False)  # small integers would overflow
