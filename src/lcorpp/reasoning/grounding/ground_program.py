"""Ground programs: terms with finite ranges, and clauses whose literals are sets of outcomes.

A term has one outcome in each world: one of its values, or no value (attributes are partial). A literal is a
term and the set of outcomes that satisfy it, as a bit mask: bit i for value i, the next bit for no value. So
`a=v`, `a!=v`, `a<3` and `not a=v` have the same form. With the values (red, green, blue):

    a=green      0b0010
    a!=green     0b0101   (a has a value, another one)
    not a=green  0b1101   (or a has no value)
"""

from __future__ import annotations

from collections.abc import Iterable, Set
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from typing import Any

from lcorpp.reasoning.language.program import Program


class ClauseKind(Enum):
    """The consequence of a clause whose body is true."""

    DERIVE = "the term has the value"
    SELECT = "the term is selected at random"
    RANGE = "the value is in the dynamic range of a selection"
    ASSIGN = "a pr-atom assigns a probability to the value"
    FORBID = "the world is impossible"

    __hash__ = object.__hash__  # Enum hashes the member's name in Python code, which is slow


DERIVE, SELECT, RANGE, ASSIGN, FORBID = ClauseKind  # access to the members of an Enum is slow, too

Atom = tuple[int, int]
"""A term and one of its values."""

GroundLiteral = tuple[int, int, bool]
"""A term, the mask of the outcomes that satisfy the literal, and whether the literal is under `not`."""


def make_full_mask(n_values: int) -> int:
    """Make the mask of all outcomes of a term: its values and, as last bit, no value."""
    return (1 << n_values + 1) - 1


@dataclass(slots=True, eq=False)
class Clause:
    """A ground rule, constraint, random selection, member of a dynamic range or pr-atom.

    term: the term in the head, -1 for FORBID.
    value: the value in the head (DERIVE, RANGE, ASSIGN), an index into the range of the term.
    body: the literals, all of which must be true.
    statement: the index of the statement in the program, -1 if the clause comes from a query or a filter.
    label: the arguments of the rule's label; a single one is not wrapped in a tuple.
    instance: the values of the statement's variables, likewise; they distinguish instances of a selection.
    number: the probability that a pr-atom assigns.
    """

    kind: ClauseKind
    term: int
    value: int
    body: tuple[GroundLiteral, ...]
    statement: int = -1
    label: Any = ()
    instance: Any = ()
    number: Fraction | None = None


@dataclass(slots=True, eq=False)
class GroundProgram:
    """A ground program.

    source: the program that was ground.
    names: the terms as text; the index of a term is its number.
    values: the range of each term as text; an outcome is an index into it, or its length for no value. The
        values of a joint are tuples.
    clauses: the ground clauses.
    do: term -> value of an intervention. Semantics of 2009: the value is a fact. Semantics of 2018: the value
        is fixed in the worlds in which a selection of the term applies.
    """

    source: Program
    names: list[str] = field(default_factory=list)
    values: list[tuple[Any, ...]] = field(default_factory=list)
    clauses: list[Clause] = field(default_factory=list)
    do: dict[int, int] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"GroundProgram({self.source.file}: {len(self.names)} terms, {len(self.clauses)} clauses)"

    def define(
        self, name: str, values: tuple[Any, ...], cases: Iterable[tuple[int, tuple[GroundLiteral, ...]]]
    ) -> None:
        """Add a term that has a value, given by its index, if a body is true: (index, body) for each case."""
        self.clauses.extend(
            [Clause(ClauseKind.DERIVE, len(self.names), value, body) for value, body in cases]
        )
        self.names.append(name)
        self.values.append(values)

    @property
    def do_is_fact(self) -> bool:
        """Whether an intervention sets its term in every world (semantics of 2009)."""
        return self.source.semantics == "2009"

    def number_terms(self, wanted: Set[str]) -> tuple[GroundProgram, dict[str, int]]:
        """Return the program and the numbers of some terms; it gets those that none of its rules names."""
        numbers = {name: term for term, name in enumerate(self.names) if name in wanted}
        missing = sorted(wanted - numbers.keys())
        if not missing:
            return self, numbers
        numbers.update((name, len(self.names) + i) for i, name in enumerate(missing))
        ranges = [self.source.signature.find_attribute(name).values for name in missing]
        return replace(self, names=[*self.names, *missing], values=[*self.values, *ranges]), numbers
