"""Reads sort expressions of plog 2.0: sets, intervals, records, names, and what `+ - *` make of them."""

from __future__ import annotations

from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.expressions import RELATION_SYNONYMS, RELATIONS, as_value, factor, value
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

_LONGEST = 100  # sorts that one chain of operations may have, as it becomes a tree of that depth


def sort_expression(cursor: Cursor) -> SortExpression:
    """A sort expression; `*` binds more tightly than `+` and `-`."""
    left = _intersection(cursor)
    count = 1
    while cursor.sees("+", "-"):
        count = _counted(cursor, count)
        sign = cursor.take()
        left = SortOperation(sign, left, _intersection(cursor), at=left.at)
    return left


def _intersection(cursor: Cursor) -> SortExpression:
    left = _simple(cursor)
    count = 1
    while cursor.sees("*"):
        count = _counted(cursor, count)
        cursor.take()
        left = SortOperation("*", left, _simple(cursor), at=left.at)
    return left


def _counted(cursor: Cursor, count: int) -> int:
    if count == _LONGEST:
        raise SourceIssue(cursor.at, f"a sort made of more than {_LONGEST} sorts in one expression")
    return count + 1


def _simple(cursor: Cursor) -> SortExpression:
    at = cursor.at
    if cursor.sees(HASH_NAME):
        return SortName(sort_name(cursor), at=at)
    if cursor.accept("{"):
        found = elements(cursor)
        cursor.expect("}")
        return SortSet(found, at=at)
    if cursor.accept("("):
        cursor.enter()
        inside = sort_expression(cursor)
        cursor.leave()
        cursor.expect(")")
        return inside
    if cursor.sees(NAME) and cursor.following == "(":
        return _records(cursor)
    if not cursor.sees(NAME, INTEGER, "-"):
        raise cursor.unexpected()
    low = _bound(cursor)
    cursor.expect("..")
    return Interval(low, _bound(cursor), at=at)


def sort_name(cursor: Cursor) -> str:
    """The name in `#name`."""
    cursor.dialect_2 = True
    return cursor.expect(HASH_NAME)[1:]


def elements(cursor: Cursor) -> tuple[Expression | Interval, ...]:
    """The elements of a set: values and intervals."""
    found: list[Expression | Interval] = []
    while not found or cursor.accept(","):
        first = value(cursor)
        found.append(_interval(first, value(cursor)) if cursor.accept("..") else first)
    return tuple(found)


def _interval(low: Expression, high: Expression) -> Interval:
    return Interval(_whole(low), _whole(high), at=low.at)


def _whole(end: Expression) -> int:
    if isinstance(end, Term):
        raise SourceIssue(end.at, f"expected an integer, not {end}")
    return int(canonical_text(end))


def _bound(cursor: Cursor) -> int:
    """An end of an interval outside of braces: an integer or a constant, or a sum or difference of such."""
    total = _whole(as_value(factor(cursor)))
    while cursor.sees("+", "-") and cursor.following in (INTEGER, NAME):
        if cursor.kinds[cursor.index + 2] in ("..", "("):
            break  # what follows is another sort
        sign = -1 if cursor.take() == "-" else 1
        total += sign * _whole(as_value(factor(cursor)))
    return total


def _records(cursor: Cursor) -> RecordSort:
    at = cursor.at
    cursor.dialect_2 = True
    name = cursor.take()
    cursor.expect("(")
    cursor.enter()
    parts: list[SortExpression] = []
    variables: list[str | None] = []
    while not parts or cursor.accept(","):
        parts.append(sort_expression(cursor))
        variables.append(_part_variable(cursor))
    cursor.leave()
    cursor.expect(")")
    condition = _either(cursor, variables) if cursor.accept(":") else None
    return RecordSort(name, tuple(parts), tuple(variables), condition, at=at)


def _part_variable(cursor: Cursor) -> str | None:
    if not cursor.accept("("):
        return None
    name = cursor.expect(VARIABLE)
    cursor.expect(")")
    return name


def _either(cursor: Cursor, variables: list[str | None]) -> Comparison | Connective:
    return _chain(cursor, variables, "|")


def _chain(cursor: Cursor, variables: list[str | None], sign: str) -> Comparison | Connective:
    left = _chain(cursor, variables, "&") if sign == "|" else _condition(cursor, variables)
    count = 1
    while cursor.sees(sign):
        count = _counted(cursor, count)
        cursor.take()
        right = _chain(cursor, variables, "&") if sign == "|" else _condition(cursor, variables)
        left = Connective(sign, left, right, at=left.at)
    return left


def _condition(cursor: Cursor, variables: list[str | None]) -> Comparison | Connective:
    if cursor.accept("("):
        cursor.enter()
        inside = _either(cursor, variables)
        cursor.leave()
        cursor.expect(")")
        return inside
    left = _side(cursor, variables)
    if not cursor.sees(*RELATIONS):
        raise cursor.unexpected(("<",))
    sign = RELATION_SYNONYMS.get(cursor.word, cursor.word)
    cursor.take()
    return Comparison(left, sign, _side(cursor, variables), at=left.at)


def _side(cursor: Cursor, variables: list[str | None]) -> Expression:
    """A side of a comparison: an integer, a constant, or a variable of the record."""
    side = as_value(factor(cursor))
    if isinstance(side, Variable) and side.name not in variables:
        raise SourceIssue(
            side.at, f"variable {side} stands for no argument of the record; expected f(#sort({side}))"
        )
    if not isinstance(side, Variable):
        canonical_text(side)
    return side
