"""Traversal of statements: list their literals, expressions and variables, and rewrite their literals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, replace
from functools import cache
from operator import is_
from typing import Any, TypeVar

from lcorpp.reasoning.language.arithmetic import find_variables
from lcorpp.reasoning.language.facts import Fact
from lcorpp.reasoning.language.syntax import (
    BodyLiteral,
    Clause,
    DynamicRange,
    Expression,
    Literal,
    Probability,
    Rule,
    Statement,
    Term,
)

_Node = TypeVar("_Node")

Rewrite = Callable[[Literal], Literal]


def iter_expressions(body: Iterable[BodyLiteral]) -> Iterator[Expression]:
    """Iterate over the expressions of a body, arguments of attributes included."""
    for literal in body:
        if isinstance(literal, Literal):
            yield from (*literal.term.arguments, literal.value)
        else:
            yield from (literal.left, literal.right)


def list_expressions(clause: Clause) -> list[Expression]:
    """List the expressions of a clause without those of a dynamic range."""
    expressions = list(iter_expressions([clause.head] if clause.head else []))
    if clause.label and not isinstance(clause, Rule):
        expressions.extend(clause.label.arguments)
    if isinstance(clause, Probability):
        expressions.append(clause.number)
    return [*expressions, *iter_expressions(clause.body)]


def list_variables(clause: Clause) -> list[str]:
    """List the variables of a clause in the order of the values in its instances."""
    return sorted(find_variables(*list_expressions(clause)))


def list_literals(statement: Statement) -> list[Literal]:
    """List the literals of a statement, heads and selected terms included."""
    literals: list[Literal] = []

    def collect(literal: Literal) -> Literal:
        literals.append(literal)
        return literal

    map_literals(statement, collect)
    return literals


def map_literals(node: _Node, rewrite: Rewrite) -> _Node:
    """Return a statement, or a part of one, with each literal and each term without value rewritten.

    `rewrite` gets a term without value as a literal (`Term.as_literal`).
    """
    return _map_part(node, rewrite)  # type: ignore[no-any-return]  # of the type of the node


def _map_part(part: Any, rewrite: Rewrite) -> Any:
    if isinstance(part, Literal):
        return rewrite(part)
    if isinstance(part, Term):
        return rewrite(part.as_literal()).term
    if isinstance(part, tuple):
        items = [_map_part(item, rewrite) for item in part]
        return part if all(map(is_, items, part)) else tuple(items)
    parts = {name: getattr(part, name) for name in _list_mapped_fields(part.__class__)}
    mapped = {name: _map_part(old, rewrite) for name, old in parts.items()}
    if all(map(is_, parts.values(), mapped.values())):
        return part
    return Rule(**mapped, at=part.at) if isinstance(part, Fact) else replace(part, **mapped)


@cache
def _list_mapped_fields(kind: type[Any]) -> list[str]:
    names = [field.name for field in fields(kind)] if issubclass(kind, Statement | DynamicRange) else []
    return [name for name in names if name not in ("at", "value", "number", "label", "is_cr_rule")]
