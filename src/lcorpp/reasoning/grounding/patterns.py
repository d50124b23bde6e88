"""Which variables stand in an expression, and which of them matching it with a value gives."""

from __future__ import annotations

from lcorpp.reasoning.language.arithmetic import variables
from lcorpp.reasoning.language.syntax import Arithmetic, Expression, Literal, Term, Variable


def names_of(expression: Expression) -> set[str]:
    """The variables of an expression."""
    return {variable.name for variable in variables(expression)}


def plain_names(literal: Literal) -> set[str]:
    """The variables that stand by themselves: matching a fact gives them."""
    return {part.name for part in (*literal.term.arguments, literal.value) if isinstance(part, Variable)}


def computed(literal: Literal) -> set[str]:
    """The variables under arithmetic or in records: matching a fact cannot give them."""
    parts = (*literal.term.arguments, literal.value)
    return {name for part in parts if not isinstance(part, Variable) for name in names_of(part)}


def nested(term: Term) -> set[str]:
    """The variables under arithmetic in a record: matching cannot give them."""
    found: set[str] = set()
    for part in term.arguments:
        if isinstance(part, Arithmetic):
            found |= names_of(part)
        elif isinstance(part, Term):
            found |= nested(part)
    return found


def matched(term: Term) -> set[str]:
    """The variables that matching a record gives."""
    found: set[str] = set()
    for part in term.arguments:
        if isinstance(part, Variable):
            found.add(part.name)
        elif isinstance(part, Term):
            found |= matched(part)
    return found
