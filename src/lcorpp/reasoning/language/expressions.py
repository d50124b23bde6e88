"""Reads expressions, literals and bodies: what stands inside of statements.

Terms, values and literals begin alike; what follows tells them apart.
"""

from __future__ import annotations

from fractions import Fraction

from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.lexer import DECIMAL, INTEGER, MAX_DEPTH, NAME, VARIABLE, Cursor
from lcorpp.reasoning.language.syntax import (
    Arithmetic,
    Body,
    Comparison,
    Expression,
    Literal,
    Number,
    Place,
    Term,
    Variable,
)

MAX_DIGITS = 300
"""How many digits a number may have."""

RESERVED = frozenset({"not", "mod"})
"""Words that are never the name of anything."""

NEGATED_RELATIONS = {"=": "!=", "!=": "=", "<": ">=", ">=": "<", ">": "<=", "<=": ">"}

RELATIONS = ("=", "==", "!=", "<>", "<", "<=", ">", ">=")
RELATION_SYNONYMS = {"==": "=", "<>": "!="}


class Minus:
    """`-p`: a false literal if it stands alone, nothing elsewhere."""

    def __init__(self, at: Place, term: Term) -> None:
        self.at, self.term = at, term


def value(cursor: Cursor) -> Expression:
    """An expression that stands for a value."""
    return as_value(operand(cursor))


def as_value(found: Expression | Minus) -> Expression:
    """The expression, which must not be a false literal."""
    if isinstance(found, Minus):
        raise SourceIssue(found.at, f"'-{found.term}' is a literal; expected a value")
    return found


def operand(cursor: Cursor, arrow: bool = False) -> Expression | Minus:
    """A sum, or `-p`.

    Args:
        arrow: whether `+-` may be the arrow of a cr-rule here; elsewhere it is a sum of something negative.
    """
    left = _product(cursor)
    while True:
        if cursor.accept("+"):
            left = _arithmetic("+", left, _product(cursor))
        elif cursor.accept("-"):
            left = _arithmetic("-", left, _product(cursor))
        elif not arrow and cursor.kind == "+-":
            at = cursor.at
            cursor.take()
            left = _arithmetic("+", left, _negative(at, factor(cursor)))
        else:
            return left


def _product(cursor: Cursor) -> Expression | Minus:
    left = factor(cursor)
    while True:
        if cursor.sees("*", "/", "\\"):
            sign = cursor.take().replace("\\", "mod")
        elif cursor.accept_word("mod"):
            sign = "mod"
        else:
            return left
        left = _arithmetic(sign, left, factor(cursor))


def factor(cursor: Cursor) -> Expression | Minus:
    """A number, a variable, a term, something in parentheses, or one of them after a minus."""
    at = cursor.at
    if cursor.accept("-"):
        cursor.enter()
        inner = factor(cursor)
        cursor.leave()
        return Minus(at, inner) if isinstance(inner, Term) else _negative(at, inner)
    if cursor.accept("("):
        cursor.enter()
        found = operand(cursor)
        cursor.leave()
        cursor.expect(")")
        return found
    if cursor.sees(INTEGER, DECIMAL):
        return _number(cursor, at)
    if cursor.kind == VARIABLE:
        return Variable(_variable_name(cursor), at=at)
    if cursor.kind == NAME and cursor.word not in RESERVED:
        return _term(cursor, at)
    raise cursor.unexpected((NAME, VARIABLE))


def _number(cursor: Cursor, at: Place) -> Number:
    if len(cursor.word) > MAX_DIGITS:
        raise SourceIssue(at, f"a number of {len(cursor.word)} digits; at most {MAX_DIGITS} are read")
    return Number(Fraction(cursor.take()), at=at)


def _variable_name(cursor: Cursor) -> str:
    """The name of a variable; `_` gets one that it shares with no other `_` of its statement."""
    name = cursor.take()
    if name == "_":
        cursor.anonymous += 1
        return f"_Any{cursor.anonymous}"
    return name


def _term(cursor: Cursor, at: Place) -> Expression:
    name = cursor.take()
    if not cursor.accept("("):
        given = cursor.constants.get(name)
        return Term(name, at=at) if given is None else _placed(given, at)
    cursor.enter()
    arguments = [value(cursor)]
    while cursor.accept(","):
        arguments.append(value(cursor))
    cursor.leave()
    cursor.expect(")")
    return _bounded(Term(name, tuple(arguments), at=at))


def _placed(constant: Expression, at: Place) -> Expression:
    if isinstance(constant, Number):
        return Number(constant.value, at=at)
    assert isinstance(constant, Term)
    return Term(constant.name, constant.arguments, at=at)


def _negative(at: Place, found: Expression | Minus) -> Expression:
    inner = as_value(found)
    if isinstance(inner, Number):
        return Number(-inner.value, at=at)
    return _bounded(Arithmetic("-", Number(Fraction(0), at=at), inner, at=at))


def _arithmetic(sign: str, left: Expression | Minus, right: Expression | Minus) -> Expression:
    first = as_value(left)
    return _bounded(Arithmetic(sign, first, as_value(right), at=first.at))


def _bounded(node: Term | Arithmetic) -> Term | Arithmetic:
    if node.depth > MAX_DEPTH:
        raise SourceIssue(node.at, f"an expression nested deeper than {MAX_DEPTH}")
    return node


# literals


def literal(cursor: Cursor, arrow: bool = False) -> Literal | Comparison:
    """`term`, `-term` or `left relation right`."""
    return literal_from(operand(cursor, arrow), cursor, arrow)


def literal_from(left: Expression | Minus, cursor: Cursor, arrow: bool = False) -> Literal | Comparison:
    """The literal whose left side has been read."""
    if not cursor.sees(*RELATIONS):
        return _bare(left)
    sign = cursor.take()
    if isinstance(left, Minus):
        raise SourceIssue(left.at, f"'-' before a literal with a value; write {left.term}!=...")
    right = as_value(operand(cursor, arrow))
    sign = RELATION_SYNONYMS.get(sign, sign)
    if isinstance(left, Term):
        return Literal(left, sign, right, at=left.at)
    return Comparison(left, sign, right, at=left.at)


def _bare(left: Expression | Minus) -> Literal:
    if isinstance(left, Minus):
        return Literal(left.term, "=", Term("false", at=left.at), at=left.at)
    if isinstance(left, Term):
        return Literal(left, "=", Term("true", at=left.at), at=left.at)
    raise SourceIssue(left.at, f"expected a literal, not {left}")


def is_bare(literal: Literal) -> bool:
    """Whether a literal was written without relation and value: its value stands where it begins."""
    return literal.value.at == literal.term.at or literal.value.at == literal.at


def body_literal(cursor: Cursor) -> Literal | Comparison:
    """A literal, perhaps under `not`."""
    at = cursor.at
    if not cursor.accept_word("not"):
        return literal(cursor)
    before = cursor.anonymous
    found = literal(cursor)
    if cursor.anonymous > before:
        raise SourceIssue(at, "'_' under 'not' can be read in two ways; write a variable in its place")
    if isinstance(found, Literal):
        return Literal(found.term, found.relation, found.value, True, at=at)
    return Comparison(found.left, NEGATED_RELATIONS[found.relation], found.right, at=at)


def body(cursor: Cursor) -> Body:
    """Literals with commas between them."""
    found = [body_literal(cursor)]
    while cursor.accept(","):
        found.append(body_literal(cursor))
    return tuple(found)
