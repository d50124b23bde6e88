"""Names, sorts and declarations for statements that come from a language without declarations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.signature import mangle_name
from lcorpp.reasoning.language.sorts import BOOLEAN, SortDefinition, SortSet
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    Expression,
    Literal,
    Number,
    Probability,
    Statement,
    Term,
    Variable,
)
from lcorpp.reasoning.language.traversal import list_literals, map_literals

_RESERVED = {
    "attributes", "boolean", "do", "false", "mod", "not", "obs", "pr", "random", "sorts", "statements", "true"
}  # fmt: skip
"""Names that P-log reserves."""

Position = tuple[str | int, str | int]
"""A predicate and the index of an argument (-1: its value), or the number of a statement and a variable."""


class SharedSorts:
    """Positions that share a sort, as a variable links them, and the constants at these positions.

    texts: all constants.
    """

    def __init__(self, statements: Sequence[Statement]) -> None:
        self._parents: dict[Position, Position] = {}
        constants: list[tuple[Position, Expression]] = []
        for number, statement in enumerate(statements):
            for position, expression in _iter_positions(statement):
                if isinstance(expression, Variable):
                    self._parents[self.find(position)] = self.find((number, expression.name))
                elif isinstance(expression, Number) or (
                    isinstance(expression, Term) and not expression.arguments
                ):
                    constants.append((position, expression))
                else:
                    raise SourceIssue(expression.at, f"the compound term {expression} is not translated")
        self.texts = {str(expression) for _, expression in constants}
        self._members: dict[Position, dict[str, Expression]] = {}
        for position, expression in constants:
            self.members(position).setdefault(str(expression), expression)

    def find(self, position: Position) -> Position:
        """Return the representative of the positions that share their sort with this one."""
        while (parent := self._parents.setdefault(position, position)) != position:
            self._parents[position] = position = self._parents.setdefault(parent, parent)
        return position

    def members(self, position: Position) -> dict[str, Expression]:
        """Return the constants of the sort of a position, by their texts."""
        return self._members.setdefault(self.find(position), {})


def _iter_positions(statement: Statement) -> Iterator[tuple[Position, Expression]]:
    """Iterate over the positions in a statement with the expressions there."""
    for literal in list_literals(statement):
        for index, argument in enumerate(literal.term.arguments):
            yield (literal.term.name, index), argument
        if literal.value is not literal.term:  # a term without value
            yield (literal.term.name, -1), literal.value
    if isinstance(statement, Probability):
        yield (statement.term.name, -1), statement.value


def declare(statements: Sequence[Statement], sorts: SharedSorts) -> tuple[Statement, ...]:
    """Return the statements with declarations before them.

    Attributes are named `p/n` (p with n arguments) in the statements, then p, or `p_n` if p is taken.
    """
    terms: dict[str, Term] = {}  # name -> the first term that has it
    for literal in chain.from_iterable(map(list_literals, statements)):
        terms.setdefault(literal.term.name, literal.term)
    taken = {*_RESERVED, *sorts.texts}

    def take(name: str, count: int) -> str:
        if name in taken:
            name = mangle_name(name, count)
        while name in taken:
            name += "x"
        taken.add(name)
        return name

    by_count = sorted(terms, key=lambda name: len(terms[name].arguments))  # as `Signature.resolve_overload`
    names = {name: take(name.partition("/")[0], len(terms[name].arguments)) for name in by_count}
    defined: dict[Position, SortDefinition] = {}

    def sort_of(name: str, index: int) -> str:
        root, members = sorts.find((name, index)), sorts.members((name, index))
        if index < 0 and members.keys() <= {"true", "false"}:
            return BOOLEAN
        if root not in defined:
            at = terms[name].at
            elements = tuple(members.values()) or (
                Term("none", at=at),
            )  # of a predicate that is always false
            own = take(f"{names[name]}_{index + 1 or 'value'}", 0)
            defined[root] = SortDefinition(own, SortSet(elements, at=at), at=at)
        return defined[root].name

    def rename(literal: Literal) -> Literal:
        return replace(literal, term=replace(literal.term, name=names[literal.term.name]))

    attributes = [
        AttributeDeclaration(
            names[name],
            tuple(sort_of(name, i) for i in range(len(term.arguments))),
            sort_of(name, -1),
            at=term.at,
        )
        for name, term in terms.items()
    ]
    return (*defined.values(), *attributes, *(map_literals(statement, rename) for statement in statements))
