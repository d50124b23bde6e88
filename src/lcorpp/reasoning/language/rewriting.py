"""Statements with other attribute terms in the places of attribute terms."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from lcorpp.reasoning.language.syntax import (
    Body,
    Comparison,
    CrRule,
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

Change = Callable[[Literal], Literal]
"""What is done to each literal; its value tells more than its term alone."""


def map_literals(statement: Statement, change: Change) -> Statement:
    """The statement with each of its literals, heads and selected terms changed."""
    if isinstance(statement, Rule):
        head = change(statement.head) if statement.head else None
        return replace(statement, head=head, body=_body(statement.body, change))
    if isinstance(statement, CrRule):
        inner = map_literals(statement.statement, change)
        assert isinstance(inner, Rule | Selection)
        return replace(statement, statement=inner)
    if isinstance(statement, Selection):
        chosen = statement.range
        if chosen:
            chosen = replace(chosen, condition=_body(chosen.condition, change))
        return replace(
            statement, term=_term(statement.term, change), range=chosen, body=_body(statement.body, change)
        )
    if isinstance(statement, Probability):
        return replace(
            statement,
            term=_term(statement.term, change),
            condition=_body(statement.condition, change),
        )
    if isinstance(statement, Observation):
        return replace(statement, literal=change(statement.literal))
    if isinstance(statement, Intervention):
        return replace(statement, term=_term(statement.term, change))
    if isinstance(statement, Query):
        return changed_query(statement, change)
    return statement


def changed_query(query: Query, change: Change) -> Query:
    """The query with each of its literals and terms changed."""
    return replace(
        query,
        literals=tuple(map(change, query.literals)),
        subject=_term(query.subject, change) if query.subject else None,
        observations=tuple(replace(o, literal=change(o.literal)) for o in query.observations),
        interventions=tuple(replace(i, term=_term(i.term, change)) for i in query.interventions),
    )


def rename_query_terms(query: Query, rename: Callable[[Term], Term]) -> Query:
    """The query with each attribute term renamed."""
    return changed_query(query, lambda literal: replace(literal, term=rename(literal.term)))


def iter_literals(statement: Statement) -> Iterator[tuple[Literal, bool]]:
    """The literals of a statement, heads and selected terms among them, and whether each is a head."""
    found: list[tuple[Literal, bool]] = []
    head = statement.statement if isinstance(statement, CrRule) else statement
    first = (
        head.head
        if isinstance(head, Rule)
        else Literal(head.term, "=", head.term)
        if isinstance(head, Selection)
        else None
    )

    def note(literal: Literal) -> Literal:
        found.append((literal, first is not None and literal.term is first.term))
        return literal

    map_literals(statement, note)
    return iter(found)


def _term(term: Term, change: Change) -> Term:
    """A term that stands without a value, as a literal whose value is the term itself."""
    return change(Literal(term, "=", term, at=term.at)).term


def _body(body: Body, change: Change) -> Body:
    return tuple(part if isinstance(part, Comparison) else change(part) for part in body)
