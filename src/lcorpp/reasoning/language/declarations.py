"""Parse declarations of attributes and sorts, and sort expressions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TypeGuard, TypeVar

from lcorpp.reasoning.language.arithmetic import canonical_text
from lcorpp.reasoning.language.expressions import (
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

_Tree = TypeVar("_Tree", SortExpression, ComparisonLiteral | Connective)

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
    name = _parse_sort_name(cursor)
    if not cursor.accept("=="):
        cursor.expect("=")
    return _parse_definition(cursor, name, at)


def _parse_definition(cursor: Cursor, name: str, at: Place) -> SortDefinition:
    expression = _parse_sort_expression(cursor)
    cursor.expect(".")
    return _define_sort(name, expression, at)


def _define_sort(name: str, expression: SortExpression, at: Place) -> SortDefinition:
    elements = expression.elements if isinstance(expression, SortSet) else (expression,)
    return SortDefinition(name, elements, at=at)


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
    if cursor.accept("->"):
        target = _parse_attribute_sort(cursor, term, new_sorts)
        cursor.expect(".")
    else:
        cursor.expect(".")
        if len(sorts) > 1:
            raise SourceIssue(term.at, f"attribute {term} has arguments but no range; expected '-> sort'")
        target = sorts.pop()
    yield from new_sorts
    for term in terms:
        yield AttributeDeclaration(term.name, tuple(sorts), target, at=term.at)


def _parse_attribute_sort(cursor: Cursor, attribute: Term, new_sorts: list[SortDefinition]) -> str:
    if cursor.kind == NAME and cursor.second_kind not in ("(", ".."):
        return cursor.take()
    if not cursor.next_is(NAME, HASH_NAME, INTEGER, "{", "(", "-"):
        raise cursor.make_unexpected_error()
    at = cursor.at
    expression = _parse_sort_expression(cursor)
    if isinstance(expression, SortName):
        return expression.name
    cursor.uses_plog2 = True
    name = f"{attribute.name}_sort_{len(new_sorts) + 1}"
    new_sorts.append(_define_sort(name, expression, at))
    return name


# sort expressions


def _parse_sort_expression(cursor: Cursor) -> SortExpression:
    """Parse a sort expression. `*` binds more tightly than `+` and `-`."""
    return _parse_chain(cursor, ("+", "-"), _parse_intersection, SortOperation)


def _parse_intersection(cursor: Cursor) -> SortExpression:
    return _parse_chain(cursor, ("*",), _parse_simple_sort, SortOperation)


def _parse_chain(
    cursor: Cursor,
    operators: tuple[str, ...],
    parse_operand: Callable[[Cursor], _Tree],
    make_node: Callable[..., _Tree],
) -> _Tree:
    """Parse operands joined by operators that associate to the left."""
    left = parse_operand(cursor)
    count = 1
    while cursor.next_is(*operators):
        if count == _MAX_OPERANDS:
            raise SourceIssue(cursor.at, f"a sort made of more than {_MAX_OPERANDS} sorts in one expression")
        count += 1
        left = make_node(cursor.take(), left, parse_operand(cursor), at=left.at)
    return left


def _parse_simple_sort(cursor: Cursor) -> SortExpression:
    at = cursor.at
    if cursor.next_is(HASH_NAME):
        return SortName(_parse_sort_name(cursor), at=at)
    if cursor.accept("{"):
        elements = cursor.parse_list(_parse_element)
        cursor.expect("}")
        return SortSet(tuple(elements), at=at)
    if cursor.accept("("):
        cursor.enter_nesting()
        inside = _parse_sort_expression(cursor)
        cursor.leave_nesting(")")
        return inside
    if cursor.next_is(NAME) and cursor.second_kind == "(":
        return _parse_record_sort(cursor)
    if not cursor.next_is(NAME, INTEGER, "-"):
        raise cursor.make_unexpected_error()
    low = _parse_bound(cursor)
    cursor.expect("..")
    return IntervalTerm(low, _parse_bound(cursor), at=at)


def _parse_sort_name(cursor: Cursor) -> str:
    """Parse `#name` and return the name."""
    cursor.uses_plog2 = True
    return cursor.expect(HASH_NAME)[1:]


def _parse_element(cursor: Cursor) -> Expression | IntervalTerm:
    """Parse an element of a set: a value or an interval."""
    low = parse_value(cursor)
    if not cursor.accept(".."):
        return low
    high = parse_value(cursor)
    return IntervalTerm(_evaluate_bound(low), _evaluate_bound(high), at=low.at)


def _evaluate_bound(bound: Expression) -> int:
    if isinstance(bound, Term):
        raise SourceIssue(bound.at, f"expected an integer, not {bound}")
    return int(canonical_text(bound))


def _parse_bound(cursor: Cursor) -> int:
    """Parse an end of an interval outside of braces: a sum of integers and constants."""
    total = _evaluate_bound(require_value(parse_factor(cursor)))
    while cursor.next_is("+", "-") and cursor.second_kind in (INTEGER, NAME):
        if cursor.kinds[cursor.index + 2] in ("..", "("):
            break  # another sort follows
        sign = -1 if cursor.take() == "-" else 1
        total += sign * _evaluate_bound(require_value(parse_factor(cursor)))
    return total


def _parse_record_sort(cursor: Cursor) -> RecordSort:
    at = cursor.at
    cursor.uses_plog2 = True
    name = cursor.take()
    cursor.expect("(")
    cursor.enter_nesting()
    parts: list[SortExpression] = []
    variables: list[str | None] = []
    while not parts or cursor.accept(","):  # `sort` or `sort(Variable)`
        parts.append(_parse_sort_expression(cursor))
        variables.append(None)
        if cursor.accept("("):
            variables[-1] = cursor.expect(VARIABLE)
            cursor.expect(")")
    cursor.leave_nesting(")")
    condition = _parse_condition(cursor, variables) if cursor.accept(":") else None
    return RecordSort(name, tuple(parts), tuple(variables), condition, at=at)


def _parse_condition(cursor: Cursor, variables: list[str | None]) -> ComparisonLiteral | Connective:
    """Parse the condition of a record with these variables. `&` binds more tightly than `|`."""

    def parse_disjunction(cursor: Cursor) -> ComparisonLiteral | Connective:
        return _parse_chain(cursor, ("|",), parse_conjunction, Connective)

    def parse_conjunction(cursor: Cursor) -> ComparisonLiteral | Connective:
        return _parse_chain(cursor, ("&",), parse_comparison, Connective)

    def parse_comparison(cursor: Cursor) -> ComparisonLiteral | Connective:
        if cursor.accept("("):
            cursor.enter_nesting()
            inside = parse_disjunction(cursor)
            cursor.leave_nesting(")")
            return inside
        left = parse_side(cursor)
        if not cursor.next_is(*RELATIONS):
            raise cursor.make_unexpected_error(("<",))
        return ComparisonLiteral(left, RELATIONS[cursor.take()], parse_side(cursor), at=left.at)

    def parse_side(cursor: Cursor) -> Expression:
        """Parse a side of a comparison: an integer, a constant, or a variable of the record."""
        side = require_value(parse_factor(cursor))
        if not isinstance(side, Variable):
            canonical_text(side)  # raises for a variable inside
        elif side.name not in variables:
            raise SourceIssue(
                side.at, f"variable {side} is not an argument of the record; expected f(#sort({side}))"
            )
        return side

    return parse_disjunction(cursor)
