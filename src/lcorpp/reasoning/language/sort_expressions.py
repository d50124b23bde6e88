"""Reads sort expressions of plog 2.0: sets, intervals, records, names, and what `+ - *` make of them."""

from __future__ import annotations

from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.expressions import (
    RELATION_SYNONYMS,
    RELATIONS,
    parse_factor,
    parse_value,
    require_value,
)
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.lexer import HASH_NAME, INTEGER, NAME, VARIABLE, Cursor
from lcorpp.reasoning.language.syntax import (
    Comparison,
    Connective,
    Expression,
    Interval,
    RecordSort,
    SortExpression,
    SortName,
    SortOperation,
    SortSet,
    Term,
    Variable,
)

_MAX_OPERANDS = 100  # sorts that one chain of operations may have, as it becomes a tree of that depth


def parse_sort_expression(cursor: Cursor) -> SortExpression:
    """A sort expression; `*` binds more tightly than `+` and `-`."""
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
        found = _parse_elements(cursor)
        cursor.expect("}")
        return SortSet(found, at=at)
    if cursor.accept("("):
        cursor.enter()
        inside = parse_sort_expression(cursor)
        cursor.leave()
        cursor.expect(")")
        return inside
    if cursor.next_is(NAME) and cursor.second_kind == "(":
        return _parse_record_sort(cursor)
    if not cursor.next_is(NAME, INTEGER, "-"):
        raise cursor.unexpected()
    low = _parse_bound(cursor)
    cursor.expect("..")
    return Interval(low, _parse_bound(cursor), at=at)


def parse_sort_name(cursor: Cursor) -> str:
    """The name in `#name`."""
    cursor.uses_plog2 = True
    return cursor.expect(HASH_NAME)[1:]


def _parse_elements(cursor: Cursor) -> tuple[Expression | Interval, ...]:
    """The elements of a set: values and intervals."""
    found: list[Expression | Interval] = []
    while not found or cursor.accept(","):
        first = parse_value(cursor)
        found.append(_make_interval(first, parse_value(cursor)) if cursor.accept("..") else first)
    return tuple(found)


def _make_interval(low: Expression, high: Expression) -> Interval:
    return Interval(_require_integer(low), _require_integer(high), at=low.at)


def _require_integer(end: Expression) -> int:
    if isinstance(end, Term):
        raise SourceIssue(end.at, f"expected an integer, not {end}")
    return int(canonical_text(end))


def _parse_bound(cursor: Cursor) -> int:
    """An end of an interval outside of braces: an integer or a constant, or a sum or difference of such."""
    total = _require_integer(require_value(parse_factor(cursor)))
    while cursor.next_is("+", "-") and cursor.second_kind in (INTEGER, NAME):
        if cursor.kinds[cursor.index + 2] in ("..", "("):
            break  # what follows is another sort
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


def _parse_disjunction(cursor: Cursor, variables: list[str | None]) -> Comparison | Connective:
    return _parse_connectives(cursor, variables, "|")


def _parse_connectives(cursor: Cursor, variables: list[str | None], sign: str) -> Comparison | Connective:
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


def _parse_comparison(cursor: Cursor, variables: list[str | None]) -> Comparison | Connective:
    if cursor.accept("("):
        cursor.enter()
        inside = _parse_disjunction(cursor, variables)
        cursor.leave()
        cursor.expect(")")
        return inside
    left = _parse_side(cursor, variables)
    if not cursor.next_is(*RELATIONS):
        raise cursor.unexpected(("<",))
    sign = RELATION_SYNONYMS.get(cursor.word, cursor.word)
    cursor.take()
    return Comparison(left, sign, _parse_side(cursor, variables), at=left.at)


def _parse_side(cursor: Cursor, variables: list[str | None]) -> Expression:
    """A side of a comparison: an integer, a constant, or a variable of the record."""
    side = require_value(parse_factor(cursor))
    if isinstance(side, Variable) and side.name not in variables:
        raise SourceIssue(
            side.at, f"variable {side} stands for no argument of the record; expected f(#sort({side}))"
        )
    if not isinstance(side, Variable):
        canonical_text(side)
    return side
