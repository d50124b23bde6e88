"""Parse declarations of attributes and sorts, and sort expressions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeGuard

from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.expressions import (
    RELATION_SYNONYMS,
    RELATIONS,
    MinusTerm,
    parse_factor,
    parse_value,
    require_value,
)
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.lexer import HASH_NAME, INTEGER, NAME, VARIABLE, Cursor
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    ComparisonLiteral,
    Connective,
    Expression,
    IntervalTerm,
    RecordSort,
    SortDefinition,
    SortExpression,
    SortName,
    SortOperation,
    SortSet,
    Statement,
    Term,
    Variable,
)

_MAX_OPERANDS = 100
"""Maximal length of a chain of operators, which becomes a tree of that depth."""


def parse_plain_sort(cursor: Cursor, name: Expression | MinusTerm) -> SortDefinition:
    """Parse `name = {elements}.` after the name."""
    term = _require_name(name, "a sort")
    cursor.expect("=")
    return _parse_definition(cursor, term.name, term.at)


def parse_hash_sort(cursor: Cursor) -> SortDefinition:
    """Parse `#name = expression.`"""
    at = cursor.at
    name = parse_sort_name(cursor)
    if not cursor.accept("=="):
        cursor.expect("=")
    return _parse_definition(cursor, name, at)


def _parse_definition(cursor: Cursor, name: str, at: Place) -> SortDefinition:
    expression = parse_sort_expression(cursor)
    cursor.expect(".")
    return _define_sort(name, expression, at)


def _define_sort(name: str, expression: SortExpression, at: Place) -> SortDefinition:
    return SortDefinition(
        name, expression.elements if isinstance(expression, SortSet) else (expression,), at=at
    )


def is_bare_name(expression: Expression | MinusTerm) -> TypeGuard[Term]:
    """Whether an expression is a name without arguments."""
    return isinstance(expression, Term) and not expression.arguments


def _require_name(expression: Expression | MinusTerm, what: str) -> Term:
    if is_bare_name(expression):
        return expression
    raise SourceIssue(expression.at, f"expected the name of {what}")


def parse_attributes(cursor: Cursor, name: Expression | MinusTerm) -> Iterator[Statement]:
    """Parse `name, name : sorts -> sort.` after the first name.

    Yields:
        A definition for each sort without a name, then the declarations.
    """
    term = _require_name(name, "an attribute")
    terms = [term]
    while cursor.accept(","):
        at = cursor.at
        terms.append(Term(cursor.expect(NAME), at=at))
    cursor.expect(":")
    new_sorts: list[SortDefinition] = []
    sorts = [_parse_attribute_sort(cursor, term, new_sorts)]
    while cursor.accept(",") or cursor.accept("*"):
        sorts.append(_parse_attribute_sort(cursor, term, new_sorts))
    target = _parse_attribute_sort(cursor, term, new_sorts) if cursor.accept("->") else None
    cursor.expect(".")
    if target is None and len(sorts) > 1:
        raise SourceIssue(term.at, f"attribute {term} has arguments but no range; expected '-> sort'")
    arguments, target = (tuple(sorts), target) if target is not None else ((), sorts[0])
    yield from new_sorts
    for term in terms:
        yield AttributeDeclaration(term.name, arguments, target, at=term.at)


def _parse_attribute_sort(cursor: Cursor, attribute: Term, new_sorts: list[SortDefinition]) -> str:
    if cursor.kind == NAME and cursor.second_kind not in ("(", ".."):
        return cursor.take()
    if not cursor.next_is(NAME, HASH_NAME, INTEGER, "{", "(", "-"):
        raise cursor.make_unexpected_error()
    at = cursor.at
    expression = parse_sort_expression(cursor)
    if isinstance(expression, SortName):
        return expression.name
    cursor.uses_plog2 = True
    name = f"{attribute.name}_sort_{len(new_sorts) + 1}"
    new_sorts.append(_define_sort(name, expression, at))
    return name


# sort expressions


def parse_sort_expression(cursor: Cursor) -> SortExpression:
    """Parse a sort expression. `*` binds more tightly than `+` and `-`."""
    left = _parse_intersection(cursor)
    count = 1
    while cursor.next_is("+", "-"):
        count = _count_operand(cursor, count)
        sign = cursor.take()
        left = SortOperation(sign, left, _parse_intersection(cursor), at=left.at)
    return left


def _parse_intersection(cursor: Cursor) -> SortExpression:
    left = _parse_simple_sort(cursor)
    count = 1
    while cursor.next_is("*"):
        count = _count_operand(cursor, count)
        cursor.take()
        left = SortOperation("*", left, _parse_simple_sort(cursor), at=left.at)
    return left


def _count_operand(cursor: Cursor, count: int) -> int:
    if count == _MAX_OPERANDS:
        raise SourceIssue(cursor.at, f"a sort made of more than {_MAX_OPERANDS} sorts in one expression")
    return count + 1


def _parse_simple_sort(cursor: Cursor) -> SortExpression:
    at = cursor.at
    if cursor.next_is(HASH_NAME):
        return SortName(parse_sort_name(cursor), at=at)
    if cursor.accept("{"):
        elements = _parse_elements(cursor)
        cursor.expect("}")
        return SortSet(elements, at=at)
    if cursor.accept("("):
        cursor.enter()
        inside = parse_sort_expression(cursor)
        cursor.leave()
        cursor.expect(")")
        return inside
    if cursor.next_is(NAME) and cursor.second_kind == "(":
        return _parse_record_sort(cursor)
    if not cursor.next_is(NAME, INTEGER, "-"):
        raise cursor.make_unexpected_error()
    low = _parse_bound(cursor)
    cursor.expect("..")
    return IntervalTerm(low, _parse_bound(cursor), at=at)


def parse_sort_name(cursor: Cursor) -> str:
    """Parse `#name` and return the name."""
    cursor.uses_plog2 = True
    return cursor.expect(HASH_NAME)[1:]


def _parse_elements(cursor: Cursor) -> tuple[Expression | IntervalTerm, ...]:
    """Parse the elements of a set: values and intervals."""
    elements: list[Expression | IntervalTerm] = []
    while not elements or cursor.accept(","):
        first = parse_value(cursor)
        elements.append(_make_interval(first, parse_value(cursor)) if cursor.accept("..") else first)
    return tuple(elements)


def _make_interval(low: Expression, high: Expression) -> IntervalTerm:
    return IntervalTerm(_require_integer(low), _require_integer(high), at=low.at)


def _require_integer(end: Expression) -> int:
    if isinstance(end, Term):
        raise SourceIssue(end.at, f"expected an integer, not {end}")
    return int(canonical_text(end))


def _parse_bound(cursor: Cursor) -> int:
    """Parse an end of an interval outside of braces: a sum of integers and constants."""
    total = _require_integer(require_value(parse_factor(cursor)))
    while cursor.next_is("+", "-") and cursor.second_kind in (INTEGER, NAME):
        if cursor.kinds[cursor.index + 2] in ("..", "("):
            break  # another sort follows
        sign = -1 if cursor.take() == "-" else 1
        total += sign * _require_integer(require_value(parse_factor(cursor)))
    return total


def _parse_record_sort(cursor: Cursor) -> RecordSort:
    at = cursor.at
    cursor.uses_plog2 = True
    name = cursor.take()
    cursor.expect("(")
    cursor.enter()
    parts: list[SortExpression] = []
    variables: list[str | None] = []
    while not parts or cursor.accept(","):
        parts.append(parse_sort_expression(cursor))
        variables.append(_parse_part_variable(cursor))
    cursor.leave()
    cursor.expect(")")
    condition = _parse_disjunction(cursor, variables) if cursor.accept(":") else None
    return RecordSort(name, tuple(parts), tuple(variables), condition, at=at)


def _parse_part_variable(cursor: Cursor) -> str | None:
    if not cursor.accept("("):
        return None
    name = cursor.expect(VARIABLE)
    cursor.expect(")")
    return name


def _parse_disjunction(cursor: Cursor, variables: list[str | None]) -> ComparisonLiteral | Connective:
    return _parse_connectives(cursor, variables, "|")


def _parse_connectives(
    cursor: Cursor, variables: list[str | None], sign: str
) -> ComparisonLiteral | Connective:
    left = _parse_connectives(cursor, variables, "&") if sign == "|" else _parse_comparison(cursor, variables)
    count = 1
    while cursor.next_is(sign):
        count = _count_operand(cursor, count)
        cursor.take()
        right = (
            _parse_connectives(cursor, variables, "&")
            if sign == "|"
            else _parse_comparison(cursor, variables)
        )
        left = Connective(sign, left, right, at=left.at)
    return left


def _parse_comparison(cursor: Cursor, variables: list[str | None]) -> ComparisonLiteral | Connective:
    if cursor.accept("("):
        cursor.enter()
        inside = _parse_disjunction(cursor, variables)
        cursor.leave()
        cursor.expect(")")
        return inside
    left = _parse_side(cursor, variables)
    if not cursor.next_is(*RELATIONS):
        raise cursor.make_unexpected_error(("<",))
    sign = RELATION_SYNONYMS.get(cursor.word, cursor.word)
    cursor.take()
    return ComparisonLiteral(left, sign, _parse_side(cursor, variables), at=left.at)


def _parse_side(cursor: Cursor, variables: list[str | None]) -> Expression:
    """Parse a side of a comparison: an integer, a constant, or a variable of the record."""
    side = require_value(parse_factor(cursor))
    if isinstance(side, Variable) and side.name not in variables:
        raise SourceIssue(
            side.at, f"variable {side} is not an argument of the record; expected f(#sort({side}))"
        )
    if not isinstance(side, Variable):
        canonical_text(side)
    return side
