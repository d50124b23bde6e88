"""Traversal of statements: iterate over their literals and expressions, and rewrite their literals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from lcorpp.reasoning.language.arithmetic import find_variables
from lcorpp.reasoning.language.syntax import (
    Body,
    BodyLiteral,
    ComparisonLiteral,
    CrRule,
    Expression,
    Intervention,
    Literal,
    Observation,
    Probability,
    Query,
    Rule,
    Selection,
    Statement,
    Term,
)

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


def iter_literals(statement: Statement) -> Iterator[tuple[Literal, bool]]:
    """Iterate over the literals of a statement, heads and selected terms included.

    Yields:
        Each literal, and whether it is the head.
    """
    literals: list[tuple[Literal, bool]] = []
    inner = statement.statement if isinstance(statement, CrRule) else statement
    head: Term | None = None
    if isinstance(inner, Selection):
        head = inner.term
    elif isinstance(inner, Rule) and inner.head:
        head = inner.head.term

    def collect(literal: Literal) -> Literal:
        literals.append((literal, literal.term is head))
        return literal

    map_literals(statement, collect)
    return iter(literals)


def map_literals(statement: Statement, rewrite: Rewrite) -> Statement:
    """Return the statement with each literal, head and selected term rewritten."""
    if isinstance(statement, Rule):
        head = rewrite(statement.head) if statement.head else None
        return replace(statement, head=head, body=_map_body(statement.body, rewrite))
    if isinstance(statement, CrRule):
        inner = map_literals(statement.statement, rewrite)
        assert isinstance(inner, Rule | Selection)
        return replace(statement, statement=inner)
    if isinstance(statement, Selection):
        dynamic = statement.range
        if dynamic:
            dynamic = replace(dynamic, condition=_map_body(dynamic.condition, rewrite))
        return replace(
            statement,
            term=_map_term(statement.term, rewrite),
            range=dynamic,
            body=_map_body(statement.body, rewrite),
        )
    if isinstance(statement, Probability):
        return replace(
            statement,
            term=_map_term(statement.term, rewrite),
            condition=_map_body(statement.condition, rewrite),
        )
    if isinstance(statement, Observation):
        return replace(statement, literal=rewrite(statement.literal))
    if isinstance(statement, Intervention):
        return replace(statement, term=_map_term(statement.term, rewrite))
    if isinstance(statement, Query):
        return _map_query(statement, rewrite)
    return statement


def rename_query_terms(query: Query, rename: Callable[[Term], Term]) -> Query:
    """Return the query with each attribute term renamed."""
    return _map_query(query, lambda literal: replace(literal, term=rename(literal.term)))


def _map_query(query: Query, rewrite: Rewrite) -> Query:
    return replace(
        query,
        literals=tuple(map(rewrite, query.literals)),
        subject=_map_term(query.subject, rewrite) if query.subject else None,
        observations=tuple(replace(o, literal=rewrite(o.literal)) for o in query.observations),
        interventions=tuple(replace(i, term=_map_term(i.term, rewrite)) for i in query.interventions),
    )


def _map_term(term: Term, rewrite: Rewrite) -> Term:
    return rewrite(Literal(term, "=", term, at=term.at)).term


def _map_body(body: Body, rewrite: Rewrite) -> Body:
    return tuple(part if isinstance(part, ComparisonLiteral) else rewrite(part) for part in body)
