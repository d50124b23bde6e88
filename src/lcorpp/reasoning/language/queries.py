"""Parse observations, interventions and queries."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain

from lcorpp.reasoning.language.expressions import (
    NEGATED_RELATIONS,
    is_bare_term,
    parse_body,
    parse_body_literal,
    parse_literal,
    parse_value,
)
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.lexer import END, NAME, Cursor
from lcorpp.reasoning.language.syntax import (
    Body,
    BodyLiteral,
    ComparisonLiteral,
    Intervention,
    Literal,
    Observation,
    Query,
)


def require_assignment(literal: BodyLiteral, where: str) -> Literal:
    """Return the literal; raise SourceIssue unless it has the form `attribute=value`."""
    if isinstance(literal, ComparisonLiteral) or literal.relation != "=":
        raise SourceIssue(literal.at, f"expected attribute=value in {where}, not {literal}")
    return literal


def _require_literal(literal: BodyLiteral, where: str) -> Literal:
    if isinstance(literal, ComparisonLiteral):
        raise SourceIssue(literal.at, f"expected a literal of an attribute in {where}, not {literal}")
    return literal


def parse_observation(cursor: Cursor) -> Observation:
    """Parse `obs(literal)`, or `obs(term, value)` and `obs(term, value, true or false)` of plog 2.0."""
    at = cursor.at
    cursor.take()
    cursor.expect("(")
    literal = _require_literal(parse_body_literal(cursor), "obs()")
    if cursor.accept(","):
        has_polarity = True
        if is_bare_term(literal):
            literal = replace(literal, value=parse_value(cursor))
            has_polarity = cursor.accept(",")
        if has_polarity and not cursor.accept_word("true"):
            if not cursor.accept_word("false"):
                raise cursor.make_unexpected_error()
            literal = replace(literal, relation=NEGATED_RELATIONS[literal.relation])
    cursor.expect(")")
    return Observation(literal, at=at)


def parse_intervention(cursor: Cursor) -> Intervention:
    """Parse `do(term=value)` or `do(term, value)`."""
    at = cursor.at
    cursor.take()
    cursor.expect("(")
    literal = require_assignment(parse_literal(cursor), "do()")
    value = literal.value
    if cursor.accept(","):
        if not is_bare_term(literal):
            raise SourceIssue(
                literal.at, f"expected do(attribute=value) or do(attribute, value), not do({literal}, ...)"
            )
        value = parse_value(cursor)
        if cursor.kind == ",":
            raise SourceIssue(
                literal.at, "do() of a named rule is not supported; expected do(attribute, value)"
            )
    cursor.expect(")")
    if cursor.kind == ":-":
        raise SourceIssue(cursor.at, "an intervention has no body; expected do(attribute=value).")
    return Intervention(literal.term, value, at=at)


def parse_query_statement(cursor: Cursor) -> Query:
    """Parse `?question.` The full stop is optional at the end of the text."""
    at = cursor.at
    query = parse_question(cursor)
    if cursor.kind != END:
        cursor.expect(".")
    return replace(query, at=at)


def parse_question(cursor: Cursor) -> Query:
    """Parse `{literals} | conditions`, `literals | conditions` or `terms | conditions`, with optional `?`."""
    cursor.accept("?")
    braced = cursor.accept("{")
    parts = _parse_formulas(cursor) if braced else parse_body(cursor)
    literals = tuple([_require_literal(part, "a query") for part in parts])
    if braced:
        cursor.expect("}")
    observations: list[Observation] = []
    interventions: list[Intervention] = []
    more = cursor.accept("|")
    while more:
        if cursor.kind == NAME and cursor.word == "obs":
            observations.append(parse_observation(cursor))
        elif cursor.kind == NAME and cursor.word == "do":
            interventions.append(parse_intervention(cursor))
        else:
            raise cursor.make_unexpected_error(("obs", "do"))
        more = cursor.accept(",")
    asks_values = not braced and all(is_bare_term(literal) and not literal.negated for literal in literals)
    subjects = tuple([literal.term for literal in literals]) if asks_values else ()
    return Query(
        () if subjects else literals, subjects, tuple(observations), tuple(interventions), at=literals[0].at
    )


def _parse_formulas(cursor: Cursor) -> Body:
    """Parse a conjunction of formulas of plog 1.0: literals, `(F and F)` and `!literal`."""
    return tuple(chain.from_iterable(cursor.parse_list(_parse_formula)))


def _parse_formula(cursor: Cursor) -> Body:
    at = cursor.at
    if cursor.accept("!"):
        first, *others = cursor.parse_nested(_parse_formula)
        if others or isinstance(first, ComparisonLiteral) or first.negated:
            raise SourceIssue(at, "'!' is only supported before a single literal")
        return (replace(first, negated=True, at=at),)
    if cursor.kind != "(":
        return (parse_body_literal(cursor),)
    cursor.take()
    return cursor.parse_nested(_parse_conjunction, ")")


def _parse_conjunction(cursor: Cursor) -> Body:
    formulas = list(_parse_formula(cursor))
    while cursor.accept_word("and"):
        formulas.extend(_parse_formula(cursor))
    if cursor.kind == NAME and cursor.word == "or":
        raise SourceIssue(
            cursor.at, "'or' is not supported in a query; define an attribute with one rule for each case"
        )
    return tuple(formulas)
