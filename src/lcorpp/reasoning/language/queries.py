"""Reads observations, interventions and queries."""

from __future__ import annotations

from lcorpp.reasoning.language.expressions import (
    NEGATED_RELATIONS,
    body,
    body_literal,
    is_bare,
    literal,
    value,
)
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.lexer import END, NAME, Cursor
from lcorpp.reasoning.language.syntax import Body, Comparison, Intervention, Literal, Observation, Query, Term

Conditions = tuple[tuple[Observation, ...], tuple[Intervention, ...]]


def outcome(found: Literal | Comparison, where: str) -> Literal:
    """The literal that says what value a term gets."""
    if isinstance(found, Comparison) or found.relation != "=":
        raise SourceIssue(found.at, f"expected attribute=value in {where}, not {found}")
    return found


def _ordinary(found: Literal | Comparison, where: str) -> Literal:
    if isinstance(found, Comparison):
        raise SourceIssue(found.at, f"expected a literal of an attribute in {where}, not {found}")
    return found


def observation(cursor: Cursor) -> Observation:
    """`obs(literal)`, or in the way of plog 2.0 `obs(term, value)` and `obs(term, value, true or false)`."""
    at = cursor.at
    cursor.take()
    cursor.expect("(")
    found = _ordinary(body_literal(cursor), "obs()")
    if cursor.accept(","):
        if is_bare(found) and found.value == Term("true"):
            found = Literal(found.term, "=", value(cursor), found.negated, at=found.at)
            if cursor.accept(","):
                found = _polarised(cursor, found)
        else:
            found = _polarised(cursor, found)
    cursor.expect(")")
    return Observation(found, at=at)


def _polarised(cursor: Cursor, found: Literal) -> Literal:
    """The literal that was observed to be true, or its opposite; both need a value."""
    if cursor.accept_word("true"):
        return found
    if not cursor.accept_word("false"):
        raise cursor.unexpected()
    return Literal(found.term, NEGATED_RELATIONS[found.relation], found.value, found.negated, at=found.at)


def intervention(cursor: Cursor) -> Intervention:
    """`do(term=value)`, or `do(term, value)`."""
    at = cursor.at
    cursor.take()
    cursor.expect("(")
    found = outcome(literal(cursor), "do()")
    chosen = found.value
    if cursor.accept(","):
        if not is_bare(found) or found.value != Term("true"):
            raise SourceIssue(
                found.at, f"expected do(attribute=value) or do(attribute, value), not do({found}, ...)"
            )
        chosen = value(cursor)
        if cursor.kind == ",":
            raise SourceIssue(found.at, "do() of a named rule is not read; expected do(attribute, value)")
    cursor.expect(")")
    if cursor.kind == ":-":
        raise SourceIssue(cursor.at, "an intervention has no body; expected do(attribute=value).")
    return Intervention(found.term, chosen, at=at)


def query_statement(cursor: Cursor) -> Query:
    """`?question.`"""
    at = cursor.at
    found = question(cursor)
    if cursor.kind != END:  # the dot of a query that ends the text may be missing
        cursor.expect(".")
    return Query(found.literals, found.subject, found.observations, found.interventions, at=at)


def question(cursor: Cursor) -> Query:
    """`{literals} | conditions`, `literals | conditions` or `term | conditions`, `?` before it or not."""
    cursor.accept("?")
    braced = cursor.accept("{")
    literals = tuple(_ordinary(found, "a query") for found in (_formulas(cursor) if braced else body(cursor)))
    if braced:
        cursor.expect("}")
    observations, interventions = _conditions(cursor) if cursor.accept("|") else ((), ())
    first = literals[0]
    if (
        not braced
        and len(literals) == 1
        and not first.negated
        and is_bare(first)
        and first.value == Term("true")
    ):
        return Query((), first.term, observations, interventions, at=first.at)
    return Query(literals, None, observations, interventions, at=first.at)


def _formulas(cursor: Cursor) -> Body:
    """Formulas of plog 1.0 that all have to hold: literals, `(F and F)` and `!literal`."""
    found = list(_formula(cursor))
    while cursor.accept(","):
        found.extend(_formula(cursor))
    return tuple(found)


def _formula(cursor: Cursor) -> Body:
    at = cursor.at
    if cursor.accept("!"):
        cursor.enter()
        inner = _formula(cursor)
        cursor.leave()
        first = inner[0]
        if len(inner) > 1 or isinstance(first, Comparison) or first.negated:
            raise SourceIssue(at, "'!' is read before a single literal only")
        return (Literal(first.term, first.relation, first.value, True, at=at),)
    if cursor.kind != "(":
        return (body_literal(cursor),)
    cursor.take()
    cursor.enter()
    found = list(_formula(cursor))
    while cursor.accept_word("and"):
        found.extend(_formula(cursor))
    cursor.leave()
    if cursor.kind == NAME and cursor.word == "or":
        raise SourceIssue(cursor.at, "'or' is not read in a query; give an attribute one rule for each case")
    cursor.expect(")")
    return tuple(found)


def _conditions(cursor: Cursor) -> Conditions:
    observations: list[Observation] = []
    interventions: list[Intervention] = []
    while not (observations or interventions) or cursor.accept(","):
        if cursor.kind == NAME and cursor.word == "obs":
            observations.append(observation(cursor))
        elif cursor.kind == NAME and cursor.word == "do":
            interventions.append(intervention(cursor))
        else:
            raise cursor.unexpected(("obs", "do"))
    return tuple(observations), tuple(interventions)
