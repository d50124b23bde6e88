"""A ground program: terms with numbered values, and clauses over sets of values.

A literal is a term and the set of outcomes that make it true, as bits: bit i for value i of the attribute's
range, one more bit for having no value. So `a=v`, `a!=v`, `a<3` and `not a=v` are one kind of thing.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction

from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import Selection


class ClauseKind(Enum):
    """What a clause says when its body is true."""

    DERIVE = "the term has the value"
    SELECT = "the term is selected at random"
    RANGE = "the value is in the dynamic range of a selection"
    ASSIGN = "a pr-atom speaks of the value"
    FORBID = "there is no such world"

    __hash__ = object.__hash__  # that of Enum hashes the name, in Python


Literal = tuple[int, int, bool]
"""A term, the outcomes that make it true, and whether it stands under `not`."""


@dataclass(slots=True, eq=False)
class Clause:
    """A ground rule.

    term: the term it is about, -1 for FORBID.
    value: the value it is about (DERIVE, RANGE, ASSIGN).
    statement: the position of its statement in the program, -1 for what was added from outside.
    label: the arguments of its label as text.
    instance: the values of the statement's variables; it tells instances apart.
    number: of a pr-atom.
    """

    kind: ClauseKind
    term: int
    value: int
    body: tuple[Literal, ...]
    statement: int = -1
    label: str = ""
    instance: tuple[int | str, ...] = ()
    number: Fraction | None = None


@dataclass(slots=True, eq=False)
class GroundProgram:
    """A ground program.

    names: the terms, as text.
    values: the range of each term, as text; an outcome is an index into it, or its length for having no
    value.
    clauses: the ground rules.
    do: the value that an intervention gives to a term, as a fact (semantics of 2009) or where a selection
    of it
        applies (2018).
    """

    program: Program
    names: list[str] = field(default_factory=list)
    values: list[tuple[str, ...]] = field(default_factory=list)
    clauses: list[Clause] = field(default_factory=list)
    do: dict[int, int] = field(default_factory=dict)

    @property
    def do_is_fact(self) -> bool:
        """Whether an intervention sets its term in every world."""
        return self.program.semantics == "2009"

    def has_range(self, statement: int) -> bool:
        """Whether the selection at this position of the program has a dynamic range."""
        selection = self.program.statements[statement]
        return isinstance(selection, Selection) and selection.range is not None
