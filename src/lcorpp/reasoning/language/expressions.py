"""Parse expressions, literals and bodies.

Terms, values and literals share their first tokens: a literal is a sum with an optional relation.
"""

from __future__ import annotations

from fractions import Fraction

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

MAX_DIGITS = 300
"""Maximal number of digits of a number."""

RESERVED = frozenset({"not", "mod"})
"""Names reserved for operators."""

NEGATED_RELATIONS = {"=": "!=", "!=": "=", "<": ">=", ">=": "<", ">": "<=", "<=": ">"}

RELATIONS = ("=", "==", "!=", "<>", "<", "<=", ">", ">=")
RELATION_SYNONYMS = {"==": "=", "<>": "!="}


class MinusTerm:
    """`-p`, which is valid only as a whole literal: `p=false`."""

    def __init__(self, at: Place, term: Term) -> None:
        self.at, self.term = at, term


def parse_value(cursor: Cursor) -> Expression:
    """Parse an expression that denotes a value."""
    return require_value(parse_sum(cursor))


def require_value(expression: Expression | MinusTerm) -> Expression:
    """Return the expression; raise SourceIssue for `-p`."""
    if isinstance(expression, MinusTerm):
        raise SourceIssue(expression.at, f"'-{expression.term}' is a literal; expected a value")
    return expression


def parse_sum(cursor: Cursor, arrow: bool = False) -> Expression | MinusTerm:
    """Parse a sum, or `-p`.

    Args:
        arrow: whether `+-` is the arrow of a consistency-restoring rule (cr-rule); otherwise `+-` adds a
            negative number.
    """
    left = _parse_product(cursor)
    while True:
        if cursor.accept("+"):
            left = _combine("+", left, _parse_product(cursor))
        elif cursor.accept("-"):
            left = _combine("-", left, _parse_product(cursor))
        elif not arrow and cursor.kind == "+-":
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


def parse_factor(cursor: Cursor) -> Expression | MinusTerm:
    """Parse a number, a variable, a term or a parenthesised sum, with an optional minus."""
    at = cursor.at
    if cursor.accept("-"):
        cursor.enter()
        inner = parse_factor(cursor)
        cursor.leave()
        return MinusTerm(at, inner) if isinstance(inner, Term) else _negate(at, inner)
    if cursor.accept("("):
        cursor.enter()
        expression = parse_sum(cursor)
        cursor.leave()
        cursor.expect(")")
        return expression
    if cursor.next_is(INTEGER, DECIMAL):
        return _parse_number(cursor, at)
    if cursor.kind == VARIABLE:
        return Variable(_parse_variable_name(cursor), at=at)
    if cursor.kind == NAME and cursor.word not in RESERVED:
        return _parse_term(cursor, at)
    raise cursor.make_unexpected_error((NAME, VARIABLE))


def _parse_number(cursor: Cursor, at: Place) -> Number:
    if len(cursor.word) > MAX_DIGITS:
        raise SourceIssue(at, f"a number of {len(cursor.word)} digits; expected at most {MAX_DIGITS}")
    return Number(Fraction(cursor.take()), at=at)


def _parse_variable_name(cursor: Cursor) -> str:
    """Parse the name of a variable. Each `_` of a statement gets a name of its own."""
    name = cursor.take()
    if name == "_":
        cursor.anonymous_count += 1
        return f"_Any{cursor.anonymous_count}"
    return name


def _parse_term(cursor: Cursor, at: Place) -> Expression:
    name = cursor.take()
    if not cursor.accept("("):
        constant = cursor.constants.get(name)
        return Term(name, at=at) if constant is None else _copy_constant(constant, at)
    cursor.enter()
    arguments = [parse_value(cursor)]
    while cursor.accept(","):
        arguments.append(parse_value(cursor))
    cursor.leave()
    cursor.expect(")")
    return _check_depth(Term(name, tuple(arguments), at=at))


def _copy_constant(constant: Expression, at: Place) -> Expression:
    if isinstance(constant, Number):
        return Number(constant.value, at=at)
    assert isinstance(constant, Term)
    return Term(constant.name, constant.arguments, at=at)


def _negate(at: Place, expression: Expression | MinusTerm) -> Expression:
    inner = require_value(expression)
    if isinstance(inner, Number):
        return Number(-inner.value, at=at)
    return _check_depth(Arithmetic("-", Number(Fraction(0), at=at), inner, at=at))


def _combine(operator: str, left: Expression | MinusTerm, right: Expression | MinusTerm) -> Expression:
    first = require_value(left)
    return _check_depth(Arithmetic(operator, first, require_value(right), at=first.at))


def _check_depth(node: Term | Arithmetic) -> Term | Arithmetic:
    if node.depth > MAX_DEPTH:
        raise SourceIssue(node.at, f"an expression nested deeper than {MAX_DEPTH}")
    return node


# literals


def parse_literal(cursor: Cursor, arrow: bool = False) -> BodyLiteral:
    """Parse `term`, `-term` or `left relation right`."""
    return parse_relation(cursor, parse_sum(cursor, arrow), arrow)


def parse_relation(cursor: Cursor, left: Expression | MinusTerm, arrow: bool = False) -> BodyLiteral:
    """Parse the rest of a literal after its left side."""
    if not cursor.next_is(*RELATIONS):
        return _complete_literal(left)
    relation = cursor.take()
    if isinstance(left, MinusTerm):
        raise SourceIssue(left.at, f"'-' before a literal with a value; write {left.term}!=...")
    right = require_value(parse_sum(cursor, arrow))
    relation = RELATION_SYNONYMS.get(relation, relation)
    if isinstance(left, Term):
        return Literal(left, relation, right, at=left.at)
    return ComparisonLiteral(left, relation, right, at=left.at)


def _complete_literal(left: Expression | MinusTerm) -> Literal:
    if isinstance(left, MinusTerm):
        return Literal(left.term, "=", Term("false", at=left.at), at=left.at)
    if isinstance(left, Term):
        return Literal(left, "=", Term("true", at=left.at), at=left.at)
    raise SourceIssue(left.at, f"expected a literal, not {left}")


def has_implicit_value(literal: Literal) -> bool:
    """Whether the text of a literal has no value.

    The parser gives an implicit value the place of the literal, where no explicit value can begin.
    """
    return literal.value.at == literal.term.at or literal.value.at == literal.at


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
    return ComparisonLiteral(literal.left, NEGATED_RELATIONS[literal.relation], literal.right, at=at)


def parse_body(cursor: Cursor) -> Body:
    """Parse literals separated by commas."""
    literals = [parse_body_literal(cursor)]
    while cursor.accept(","):
        literals.append(parse_body_literal(cursor))
    return tuple(literals)
