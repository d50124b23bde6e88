"""Parse expressions, literals and bodies.

Terms, values and literals share their first tokens: a literal is a sum with an optional relation.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple, TypeVar

from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.lexer import DECIMAL, INTEGER, MAX_DEPTH, NAME, VARIABLE, Cursor
from lcorpp.reasoning.language.syntax import (
    Arithmetic,
    Body,
    BodyLiteral,
    ComparisonLiteral,
    Expression,
    Literal,
    Number,
    Term,
    Variable,
)

_Compound = TypeVar("_Compound", Term, Arithmetic)

MAX_DIGITS = 300
"""Maximal number of digits of a number."""

RESERVED = frozenset({"not", "mod"})
"""Names reserved for operators."""

RELATIONS = {"=": "=", "==": "=", "!=": "!=", "<>": "!=", "<": "<", "<=": "<=", ">": ">", ">=": ">="}
"""Sign of a relation -> the relation that it denotes."""

_VALUE_ENDS = (",", ")", ".")

NEGATED_RELATIONS = {"=": "!=", "!=": "=", "<": ">=", ">=": "<", ">": "<=", "<=": ">"}


class MinusTerm(NamedTuple):
    """`-p`, which is valid only as a whole literal: `p=false`."""

    at: Place
    term: Term


def parse_value(cursor: Cursor) -> Expression:
    """Parse an expression that denotes a value."""
    if cursor.second_kind in _VALUE_ENDS:  # a single token, as nearly all arguments are
        return require_value(parse_factor(cursor))
    return require_value(parse_sum(cursor))


def require_value(expression: Expression | MinusTerm) -> Expression:
    """Return the expression; raise SourceIssue for `-p`."""
    if isinstance(expression, MinusTerm):
        raise SourceIssue(expression.at, f"'-{expression.term}' is a literal; expected a value")
    return expression


def parse_sum(cursor: Cursor, plus_minus_is_arrow: bool = False) -> Expression | MinusTerm:
    """Parse a sum, or `-p`.

    Args:
        plus_minus_is_arrow: whether `+-` is the arrow of a consistency-restoring rule (cr-rule); otherwise
            it adds a negative number.
    """
    left = _parse_product(cursor)
    while True:
        if cursor.next_is("+", "-"):
            left = _combine(cursor.take(), left, _parse_product(cursor))
        elif not plus_minus_is_arrow and cursor.kind == "+-":
            at = cursor.at
            cursor.take()
            left = _combine("+", left, _negate(at, parse_factor(cursor)))
        else:
            return left


def _parse_product(cursor: Cursor) -> Expression | MinusTerm:
    left = parse_factor(cursor)
    while True:
        if cursor.next_is("*", "/", "\\"):
            operator = cursor.take().replace("\\", "mod")
        elif cursor.accept_word("mod"):
            operator = "mod"
        else:
            return left
        left = _combine(operator, left, parse_factor(cursor))


@lru_cache(maxsize=1024)
def _parse_fraction(text: str) -> Fraction:
    return Fraction(int(text)) if text.isdigit() else Fraction(text)


def parse_factor(cursor: Cursor) -> Expression | MinusTerm:
    """Parse a number, a variable, a term or a parenthesised sum, with an optional minus."""
    at = cursor.at
    if cursor.kind == NAME and cursor.word not in RESERVED:
        return _parse_term(cursor, at)
    if cursor.accept("-"):
        cursor.enter_nesting()
        inner = parse_factor(cursor)
        cursor.leave_nesting()
        return MinusTerm(at, inner) if isinstance(inner, Term) else _negate(at, inner)
    if cursor.accept("("):
        cursor.enter_nesting()
        expression = parse_sum(cursor)
        cursor.leave_nesting(")")
        return expression
    if cursor.next_is(INTEGER, DECIMAL):
        if len(cursor.word) > MAX_DIGITS:
            raise SourceIssue(at, f"a number of {len(cursor.word)} digits; expected at most {MAX_DIGITS}")
        return Number(_parse_fraction(cursor.take()), at=at)
    if cursor.kind == VARIABLE:
        name = cursor.take()
        if name == "_":  # each `_` of a statement gets a name of its own
            cursor.anonymous_count += 1
            name = f"_Any{cursor.anonymous_count}"
        return Variable(name, at=at)
    raise cursor.make_unexpected_error((NAME, VARIABLE))


def _parse_term(cursor: Cursor, at: Place) -> Term | Number:
    """Parse a term; a name declared by `#const` becomes its value."""
    name = cursor.take()
    if not cursor.accept("("):
        constant = cursor.constants.get(name)
        return Term(name, at=at) if constant is None else replace(constant, at=at)
    cursor.enter_nesting()
    arguments = [parse_value(cursor)]
    while cursor.accept(","):
        arguments.append(parse_value(cursor))
    cursor.leave_nesting(")")
    return _check_depth(Term(name, tuple(arguments), at=at))


def _negate(at: Place, expression: Expression | MinusTerm) -> Expression:
    """Negate a number; `-X` becomes `0 - X`."""
    inner = require_value(expression)
    if isinstance(inner, Number):
        return Number(-inner.value, at=at)
    return _check_depth(Arithmetic("-", Number(Fraction(0), at=at), inner, at=at))


def _combine(operator: str, left: Expression | MinusTerm, right: Expression | MinusTerm) -> Expression:
    first = require_value(left)
    return _check_depth(Arithmetic(operator, first, require_value(right), at=first.at))


def _check_depth(node: _Compound) -> _Compound:
    if node.depth > MAX_DEPTH:
        raise SourceIssue(node.at, f"an expression nested deeper than {MAX_DEPTH}")
    return node


# literals


def parse_literal(cursor: Cursor, plus_minus_is_arrow: bool = False) -> BodyLiteral:
    """Parse `term`, `-term` or `left relation right`."""
    return parse_rest_of_literal(cursor, parse_sum(cursor, plus_minus_is_arrow), plus_minus_is_arrow)


def parse_rest_of_literal(
    cursor: Cursor, left: Expression | MinusTerm, plus_minus_is_arrow: bool = False
) -> BodyLiteral:
    """Parse the relation and the right side of a literal, if it has them."""
    if not cursor.next_is(*RELATIONS):
        if isinstance(left, MinusTerm):
            return Literal(left.term, "=", Term("false", at=left.at), at=left.at)
        if isinstance(left, Term):
            return Literal(left, "=", Term("true", at=left.at), at=left.at)
        raise SourceIssue(left.at, f"expected a literal, not {left}")
    relation = RELATIONS[cursor.take()]
    if isinstance(left, MinusTerm):
        raise SourceIssue(left.at, f"'-' before a literal with a value; write {left.term}!=...")
    right = require_value(parse_sum(cursor, plus_minus_is_arrow))
    if isinstance(left, Term):
        return Literal(left, relation, right, at=left.at)
    return ComparisonLiteral(left, relation, right, at=left.at)


def is_bare_term(literal: Literal) -> bool:
    """Whether the text of a literal is a term without value and sign, perhaps after `not`.

    The parser gives the implicit value `true` the place of the term, where no explicit value can begin.
    """
    return literal.value.at == literal.term.at


def parse_body_literal(cursor: Cursor) -> BodyLiteral:
    """Parse a literal with an optional `not`."""
    at = cursor.at
    if not cursor.accept_word("not"):
        return parse_literal(cursor)
    before = cursor.anonymous_count
    literal = parse_literal(cursor)
    if cursor.anonymous_count > before:
        raise SourceIssue(at, "'_' under 'not' is ambiguous; expected a named variable")
    if isinstance(literal, Literal):
        return Literal(literal.term, literal.relation, literal.value, True, at=at)
    # the opposite order is the negation, as the checker allows only integers in an order
    return ComparisonLiteral(literal.left, NEGATED_RELATIONS[literal.relation], literal.right, at=at)


def parse_body(cursor: Cursor) -> Body:
    """Parse literals separated by commas."""
    return tuple(cursor.parse_list(parse_body_literal))
