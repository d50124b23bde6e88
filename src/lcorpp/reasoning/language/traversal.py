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
    Body,
    BodyLiteral,
    Clause,
    CrRule,
    DynamicRange,
    Expression,
    Literal,
    Probability,
    Rule,
    Selection,
    Statement,
    Term,
)

_Node = TypeVar("_Node")

Rewrite = Callable[[Literal], Literal]


def as_clause(statement: Statement) -> Clause | None:
    """Return the statement, or that of a cr-rule, if it is a rule, a random selection or a pr-atom."""
    inner = statement.statement if isinstance(statement, CrRule) else statement
    return inner if isinstance(inner, Clause) else None


def as_selection(statement: Statement) -> Selection | None:
    """Return the random selection of a statement, perhaps within a cr-rule, or None."""
    clause = as_clause(statement)
    return clause if isinstance(clause, Selection) else None


def as_literal(term: Term) -> Literal:
    """Return a literal without a value of its own: an order, whose right side is not bound to the range."""
    return Literal(term, "<", term, at=term.at)


def get_head(clause: Clause) -> Literal | None:
    """Return the head of a rule, `term=value` of a pr-atom, or the term of a selection (`as_literal`)."""
    if isinstance(clause, Rule):
        return clause.head
    if isinstance(clause, Probability):
        return Literal(clause.term, "=", clause.value, at=clause.at)
    return as_literal(clause.term)


def get_body(clause: Clause) -> Body:
    """Return the body of a rule or selection, or the condition of a pr-atom."""
    return clause.condition if isinstance(clause, Probability) else clause.body


def iter_expressions(body: Iterable[BodyLiteral]) -> Iterator[Expression]:
    """Iterate over the expressions of a body, arguments of attributes included."""
    for literal in body:
        if isinstance(literal, Literal):
            yield from (*literal.term.arguments, literal.value)
        else:
            yield from (literal.left, literal.right)


def list_expressions(clause: Clause) -> list[Expression]:
    """List the expressions of a clause without those of a dynamic range."""
    head, label = get_head(clause), None if isinstance(clause, Rule) else clause.label
    expressions = [*iter_expressions([head] if head else []), *(label.arguments if label else ())]
    if isinstance(clause, Probability):
        expressions.append(clause.number)
    return [*expressions, *iter_expressions(get_body(clause))]


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

    `rewrite` gets a term without value as a literal (`as_literal`).
    """
    return _map_part(node, rewrite)  # type: ignore[no-any-return]  # of the type of the node


def _map_part(part: Any, rewrite: Rewrite) -> Any:
    if isinstance(part, Literal):
        return rewrite(part)
    if isinstance(part, Term):
        return rewrite(as_literal(part)).term
    if isinstance(part, tuple):
        items = [_map_part(item, rewrite) for item in part]
        return part if all(map(is_, items, part)) else tuple(items)
    changes = {}
    for name in _list_mapped_fields(part.__class__):
        old = getattr(part, name)
        new = _map_part(old, rewrite)
        if new is not old:
            changes[name] = new
    if isinstance(part, Fact) and changes:
        return Rule(**changes, at=part.at)
    return replace(part, **changes) if changes else part


@cache
def _list_mapped_fields(kind: type[Any]) -> list[str]:
    names = [field.name for field in fields(kind)] if issubclass(kind, Statement | DynamicRange) else []
    return [name for name in names if name not in ("at", "value", "number", "label")]
