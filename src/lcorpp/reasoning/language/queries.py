"""Parse observations, interventions and queries."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import chain, islice, product

from lcorpp.reasoning.language.expressions import (
    NEGATED_RELATIONS,
    is_bare_term,
    parse_body_literal,
    parse_literal,
    parse_value,
)
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.lexer import Cursor
from lcorpp.reasoning.language.syntax import (
    Arithmetic,
    BodyLiteral,
    ComparisonLiteral,
    Expression,
    Formula,
    Intervention,
    Literal,
    Observation,
    Query,
    Term,
    Variable,
)

MAX_CASES = 1000
"""A formula has at most this many conjunctions once it is multiplied out."""


def require_assignment(literal: BodyLiteral, where: str) -> Literal:
    """Return the literal; raise SourceIssue unless it has the form `attribute=value`."""
    if isinstance(literal, ComparisonLiteral) or literal.relation != "=":
        raise SourceIssue(literal.at, f"expected attribute=value in {where}, not {literal}")
    return literal


def parse_evidence(cursor: Cursor) -> Observation | Intervention:
    """Parse `obs(...)` or `do(...)`."""
    at = cursor.at
    if cursor.accept("obs"):
        return _parse_observation(cursor, at)
    if cursor.accept("do"):
        return _parse_intervention(cursor, at)
    raise cursor.make_unexpected_error()


def _parse_observation(cursor: Cursor, at: Place) -> Observation:
    """Parse `(formula)`, `(literal, literal, ...)`, or `(term, value)`, `(term, value, true)` of plog 2.0."""
    cursor.expect("(")
    formula = _parse_formula(cursor, ("and",))
    literal = formula[0][0]
    if formula == ((literal,),) and cursor.accept(","):
        has_polarity = True
        if is_bare_term(literal):
            literal = replace(literal, value=parse_value(cursor))
            has_polarity = cursor.accept(",")
        if has_polarity and cursor.accept("false"):
            literal = replace(literal, relation=NEGATED_RELATIONS[literal.relation])
            formula = ((literal,),)
        elif has_polarity and not cursor.accept("true"):
            more = _parse_case(cursor, ("and", ","))
            formula = _multiply_out(cursor, product(((literal,),), more))
        else:
            formula = ((literal,),)
    cursor.expect(")")
    return Observation(formula, at=at)


def _parse_intervention(cursor: Cursor, at: Place) -> Intervention:
    """Parse `(term=value)` or `(term, value)`."""
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


def parse_question(cursor: Cursor) -> Query:
    """Parse `asked | conditions`, see `Query`, with an optional `?`."""
    cursor.accept("?")
    start, at = cursor.index, cursor.at
    formula: Formula = ()
    subjects: tuple[Term, ...] = ()
    expression = None
    if cursor.word == "E" and cursor.second_kind == "[":
        cursor.take()
        cursor.take()
        expression, subjects = _replace_terms(parse_value(cursor))
        cursor.expect("]")
        if not subjects:
            raise SourceIssue(at, "expected an attribute in E[...]")
    elif cursor.accept("{"):
        formula = _parse_formula(cursor)
        cursor.expect("}")
    else:
        formula = _parse_formula(cursor)
        has_and = "and" in cursor.texts[start : cursor.index]
        if len(formula) == 1 and not has_and and all(is_bare_term(x) and not x.negated for x in formula[0]):
            subjects = tuple([literal.term for literal in formula[0]])
            formula = ()
    given = cursor.parse_list(parse_evidence) if cursor.accept("|") else []
    observations = tuple([part for part in given if isinstance(part, Observation)])
    interventions = tuple([part for part in given if isinstance(part, Intervention)])
    return Query(formula, subjects, expression, observations, interventions, at=at)


def _replace_terms(expression: Expression) -> tuple[Expression, tuple[Term, ...]]:
    """Replace the terms of an expression by variables of their names; return it with the terms."""
    if isinstance(expression, Term):
        return Variable(str(expression), at=expression.at), (expression,)
    if isinstance(expression, Variable):
        raise SourceIssue(expression.at, f"variable {expression} is not allowed here; expected a value")
    if not isinstance(expression, Arithmetic):
        return expression, ()
    (left, before), (right, after) = map(_replace_terms, (expression.left, expression.right))
    return replace(expression, left=left, right=right), tuple(dict.fromkeys((*before, *after)))


# formulas


def _parse_formula(cursor: Cursor, and_signs: Sequence[str] = ("and", ",")) -> Formula:
    """Parse cases joined by `or`; `and` and the comma bind tighter, parentheses tightest."""
    formula = _parse_case(cursor, and_signs)
    while cursor.accept("or"):
        formula = _check_cases(cursor, formula + _parse_case(cursor, and_signs))
    return formula


def _parse_case(cursor: Cursor, and_signs: Sequence[str]) -> Formula:
    formula = _parse_unit(cursor)
    while cursor.word in and_signs:
        cursor.take()
        formula = _multiply_out(cursor, product(formula, _parse_unit(cursor)))
    cursor.next_is(*and_signs)  # listed in messages as expected
    return formula


def _parse_unit(cursor: Cursor) -> Formula:
    """Parse a literal, `(formula)`, or the negation of a formula, `!(formula)` or `not (formula)`."""
    if cursor.accept("!") or (cursor.second_kind == "(" and cursor.accept("not")):
        inner = cursor.parse_nested(_parse_unit)
        negated = [[(replace(x, negated=not x.negated),) for x in case] for case in inner]
        return _multiply_out(cursor, product(*negated))
    if cursor.accept("("):
        return cursor.parse_nested(_parse_formula, ")")
    literal = parse_body_literal(cursor)
    if isinstance(literal, ComparisonLiteral):
        raise SourceIssue(literal.at, f"expected a literal of an attribute, not {literal}")
    return ((literal,),)


def _multiply_out(cursor: Cursor, cases: Iterable[Iterable[tuple[Literal, ...]]]) -> Formula:
    """Return the disjunction of conjunctions of conjunctions."""
    some = islice(cases, MAX_CASES + 1)
    return _check_cases(cursor, tuple([tuple(chain.from_iterable(case)) for case in some]))


def _check_cases(cursor: Cursor, formula: Formula) -> Formula:
    if len(formula) > MAX_CASES:
        raise SourceIssue(cursor.at, f"a formula of more than {MAX_CASES} cases")
    return formula
