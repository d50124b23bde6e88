"""Traversal of statements: iterate over their literals and expressions, and rewrite their literals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from operator import is_
from typing import Any, TypeVar

from lcorpp.reasoning.language.arithmetic import Value, find_variables
from lcorpp.reasoning.language.syntax import (
    Body,
    BodyLiteral,
    CrRule,
    DynamicRange,
    Expression,
    Intervention,
    Literal,
    Number,
    Observation,
    Probability,
    Query,
    Rule,
    Selection,
    Statement,
    Term,
)

_MAPPED_FIELDS: dict[type, tuple[str, ...]] = {
    CrRule: ("statement",),
    Rule: ("head", "body"),
    Selection: ("range", "term", "body"),
    DynamicRange: ("condition",),
    Probability: ("term", "condition"),
    Observation: ("literal",),
    Intervention: ("term",),
    Query: ("literals", "subjects", "observations", "interventions"),
}
"""The fields that `map_literals` rewrites, in this order."""

_Node = TypeVar("_Node")

Rewrite = Callable[[Literal], Literal]
"""Maps a literal to its replacement. A term without value is passed as the literal `term=term`."""


def as_selection(statement: Statement) -> Selection | None:
    """Return the random selection of a statement, perhaps within a cr-rule, or None."""
    if isinstance(statement, CrRule):
        statement = statement.statement
    return statement if isinstance(statement, Selection) else None


def get_body(statement: Rule | Selection | Probability) -> Body:
    """Return the body of a rule or selection, or the condition of a pr-atom."""
    return statement.condition if isinstance(statement, Probability) else statement.body


def iter_expressions(body: Iterable[BodyLiteral]) -> Iterator[Expression]:
    """Iterate over the expressions of a body, arguments of attributes included."""
    for literal in body:
        if isinstance(literal, Literal):
            yield from (*literal.term.arguments, literal.value)
        else:
            yield from (literal.left, literal.right)


def list_expressions(statement: Rule | Selection | Probability) -> list[Expression]:
    """List the expressions of a statement without those of a dynamic range."""
    if isinstance(statement, Rule):
        expressions = list(iter_expressions((statement.head,) if statement.head else ()))
    else:
        expressions = [*statement.term.arguments, *(statement.label.arguments if statement.label else ())]
        if isinstance(statement, Probability):
            expressions.extend((statement.value, statement.number))
    return [*expressions, *iter_expressions(get_body(statement))]


def list_variables(statement: Rule | Selection | Probability) -> list[str]:
    """List the variables of a statement in the order of the values in its instances."""
    return sorted(find_variables(*list_expressions(statement)))


def list_fact_values(rule: Rule) -> tuple[Value, ...] | None:
    """List the arguments and the value of a fact of integers and names; None for other rules."""
    if rule.body or rule.head is None:
        return None
    values: list[Value] = []
    for expression in (*rule.head.term.arguments, rule.head.value):
        if isinstance(expression, Term) and not expression.arguments:
            values.append(expression.name)
        elif isinstance(expression, Number) and expression.value.denominator == 1:
            values.append(expression.value.numerator)
        else:
            return None
    return tuple(values)


def iter_literals(statement: Statement) -> Iterator[tuple[Literal, bool]]:
    """Iterate over the literals of a statement, heads and selected terms included.

    Yields:
        Each literal, and whether it is the head.
    """
    literals: list[tuple[Literal, bool]] = []
    inner = statement.statement if isinstance(statement, CrRule) else statement
    first = inner.head if isinstance(inner, Rule) else inner
    head = first.term if isinstance(first, Literal | Selection) else None

    def collect(literal: Literal) -> Literal:
        literals.append((literal, literal.term is head))
        return literal

    map_literals(statement, collect)
    return iter(literals)


def map_literals(node: _Node, rewrite: Rewrite) -> _Node:
    """Return a statement, or a part of one, with each literal, head and selected term rewritten."""
    return _map_part(node, rewrite)  # type: ignore[no-any-return]  # of the type of the node


def _map_part(part: Any, rewrite: Rewrite) -> Any:
    if isinstance(part, Literal):
        return rewrite(part)
    if isinstance(part, Term):
        return rewrite(Literal(part, "=", part, at=part.at)).term
    if isinstance(part, tuple):
        items = [_map_part(item, rewrite) for item in part]
        return part if all(map(is_, items, part)) else tuple(items)
    changes = {}
    for name in _MAPPED_FIELDS.get(type(part), ()):
        old = getattr(part, name)
        if not old:
            continue
        new = _map_part(old, rewrite)
        if new is not old:
            changes[name] = new
    return replace(part, **changes) if changes else part
