"""Overloads: attributes with different numbers of arguments may share a name.

The attribute with the fewest arguments keeps the name; the others get an internal name that is shown as it is
written: `pair(a,b)` is a term of the attribute `pair/2` if the program declares `pair(a)`, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lcorpp.reasoning.language.syntax import AttributeDeclaration, Literal, Statement
from lcorpp.reasoning.language.traversal import map_literals


class Overload(str):
    """The internal name `name/count` of an attribute; it is shown as `name`."""

    __slots__ = ()

    def __str__(self) -> str:
        return self.partition("/")[0]

    def __repr__(self) -> str:
        return repr(str(self))

    def __format__(self, spec: str) -> str:
        return format(str(self), spec)


def resolve_overloads(statements: Sequence[Statement]) -> Sequence[Statement]:
    """Return the statements with internal names for the attributes that share the name of another."""
    counts: dict[str, set[int]] = {}
    for statement in statements:
        if isinstance(statement, AttributeDeclaration):
            counts.setdefault(statement.name, set()).add(len(statement.arguments))
    names = {
        (name, count): Overload(f"{name}/{count}")
        for name, own in counts.items()
        for count in own - {min(own)}
    }
    if not names:
        return statements

    def rename(literal: Literal) -> Literal:
        name = names.get((literal.term.name, len(literal.term.arguments)))
        return replace(literal, term=replace(literal.term, name=name)) if name else literal

    return [
        replace(s, name=names.get((s.name, len(s.arguments)), s.name))
        if isinstance(s, AttributeDeclaration)
        else map_literals(s, rename)
        for s in statements
    ]
