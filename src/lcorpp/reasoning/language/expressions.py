"""Parse expressions, literals and bodies.

Terms, values and literals share their first tokens: a literal is a sum with an optional relation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from typing import TypeVar

from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.lexer import (
    DECIMAL,
    INTEGER,
    MAX_DEPTH,
    NAME,
    VARIABLE,
    Cursor,
    make_depth_error,
)
from lcorpp.reasoning.language.syntax import (
    Arithmetic,
    Body,
    BodyLiteral,
    ComparisonLiteral,
    Expression,
    Literal,
    Number,
    Operation,
    SyntaxNode,
    Term,
    Variable,
)

_Node = TypeVar("_Node", bound=SyntaxNode)

MAX_DIGITS = 300
"""Maximal number of digits of a number."""

RELATIONS = {"=": "=", "==": "=", "!=": "!=", "<>": "!=", "<": "<", "<=": "<=", ">": ">", ">=": ">="}
"""Sign of a relation -> the relation that it denotes."""

_VALUE_ENDS = (",", ")", ".")

NEGATED_RELATIONS = {"=": "!=", "!=": "=", "<": ">=", ">=": "<", ">": "<=", "<=": ">"}


def parse_value(cursor: Cursor) -> Expression:
    """Parse an expression that denotes a value."""
    if cursor.second_kind in _VALUE_ENDS:  # a single token, as nearly all arguments are
        return require_value(parse_factor(cursor))
    return require_value(parse_sum(cursor))


def require_value(expression: Expression | Literal) -> Expression:
    """Return the expression; raise SourceIssue for the literal `-p`."""
    if isinstance(expression, Literal):
        raise SourceIssue(expression.at, f"'-{expression.term}' is a literal; expected a value")
    return expression


def parse_chain(
    cursor: Cursor,
    strengths: Mapping[str, int],
    parse_operand: Callable[[Cursor], _Node],
    make_node: Callable[..., _Node],
    least: int = 1,
) -> _Node:
    """Parse operands joined by operators that associate to the left.

    Args:
        strengths: how tightly each operator binds, at least 1.
        least: operators that bind less tightly end the chain.
    """
    left = parse_operand(cursor)
    while cursor.next_is(*strengths) and (strength := strengths[cursor.kind]) >= least:
        operator = cursor.take()
        right = parse_chain(cursor, strengths, parse_operand, make_node, strength + 1)
        left = _check_depth(make_node(operator, left, right, at=left.at))
    return left


_ARITHMETIC = {"+": 1, "-": 1, "*": 2, "/": 2, "\\": 2, "mod": 2}

_SUM = {**_ARITHMETIC, "+-": 1}


def parse_sum(cursor: Cursor, plus_minus_is_arrow: bool = False) -> Expression | Literal:
    """Parse a sum, or the literal `-p`.

    Args:
        plus_minus_is_arrow: whether `+-` is the arrow of a consistency-restoring rule (cr-rule); otherwise
            it adds a negative number.
    """
    strengths = _ARITHMETIC if plus_minus_is_arrow else _SUM
    return parse_chain(cursor, strengths, parse_factor, _make_arithmetic)


_parse_fraction = lru_cache(maxsize=1024)(Fraction)


def parse_factor(cursor: Cursor) -> Expression | Literal:
    """Parse a number, a variable, a term or a parenthesised sum, with an optional minus."""
    at = cursor.at
    if cursor.kind == NAME:
        return _parse_term(cursor, at)
    if cursor.accept("-"):
        inner = cursor.parse_nested(parse_factor)
        if isinstance(inner, Term):
            return Literal(inner, "=", Term("false", at=at), at=at)
        return _negate(at, require_value(inner))
    if cursor.accept("("):
        return cursor.parse_nested(parse_sum, ")")
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
    arguments = cursor.parse_nested(lambda cursor: cursor.parse_list(parse_value), ")")
    return _check_depth(Term(name, tuple(arguments), at=at))


def _negate(at: Place, expression: Expression) -> Expression:
    """Negate a number; `-X` becomes `0 - X`."""
    if isinstance(expression, Number):
        return Number(-expression.value, at=at)
    return _check_depth(Arithmetic("-", Number(Fraction(0), at=at), expression, at=at))


def _make_arithmetic(
    operator: str, left: Expression | Literal, right: Expression | Literal, *, at: Place
) -> Expression:
    right = require_value(right)
    if operator == "+-":
        operator, right = "+", _negate(right.at, right)
    return Arithmetic(operator.replace("\\", "mod"), require_value(left), right, at=at)


def _check_depth(node: _Node) -> _Node:
    """Return the node; raise SourceIssue if it is nested so deeply that recursive functions are unsafe."""
    if _measure_depth(node) > MAX_DEPTH:
        raise make_depth_error(node.at)
    return node


def _measure_depth(node: SyntaxNode) -> int:
    if isinstance(node, Term):
        return 1 + max(map(_measure_depth, node.arguments), default=0)
    if isinstance(node, Operation):
        return 1 + max(_measure_depth(node.left), _measure_depth(node.right))
    return 0


# literals


def parse_literal(cursor: Cursor, plus_minus_is_arrow: bool = False) -> BodyLiteral:
    """Parse `term`, `-term` or `left relation right`."""
    return parse_rest_of_literal(cursor, parse_sum(cursor, plus_minus_is_arrow), plus_minus_is_arrow)


def parse_rest_of_literal(
    cursor: Cursor, left: Expression | Literal, plus_minus_is_arrow: bool = False
) -> BodyLiteral:
    """Parse the relation and the right side of a literal, if it has them."""
    if not cursor.next_is(*RELATIONS):
        if isinstance(left, Term):
            return Literal(left, "=", Term("true", at=left.at), at=left.at)
        if isinstance(left, Literal):
            return left
        hint = f"; a value needs its attribute, as in a={left}" if isinstance(left, Number) else ""
        raise SourceIssue(left.at, f"expected a literal, not {left}{hint}")
    relation = RELATIONS[cursor.take()]
    if isinstance(left, Literal):
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
    if not cursor.accept("not"):
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
