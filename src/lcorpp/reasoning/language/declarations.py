"""Parse declarations of attributes and sorts, and sort expressions."""

from __future__ import annotations

from collections.abc import Iterator

from lcorpp.reasoning.language.arithmetic import evaluate_integer
from lcorpp.reasoning.language.expressions import (
    RELATIONS,
    parse_chain,
    parse_factor,
    parse_value,
    require_value,
)
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.lexer import HASH_NAME, INTEGER, NAME, VARIABLE, Cursor
from lcorpp.reasoning.language.sorts import (
    Condition,
    Interval,
    RecordSort,
    SortDefinition,
    SortExpression,
    SortSet,
    list_comparisons,
)
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    ComparisonLiteral,
    Expression,
    Operation,
    Statement,
    Term,
    Variable,
)


def parse_sort(cursor: Cursor, name: str, at: Place) -> SortDefinition:
    """Parse `= expression.` after the name of a sort."""
    if not cursor.accept("=="):
        cursor.expect("=")
    sort = _parse_sort_expression(cursor)
    cursor.expect(".")
    return SortDefinition(name, sort, at=at)


def parse_attributes(cursor: Cursor, term: Term) -> Iterator[Statement]:
    """Parse `name, name : sorts -> sort.` after the first name.

    Yields:
        A definition for each sort without a name, then the declarations.
    """
    terms = [term]
    while cursor.accept(","):
        at = cursor.at
        terms.append(Term(cursor.expect(NAME), at=at))
    cursor.expect(":")
    sorts = [_parse_attribute_sort(cursor)]
    while cursor.accept(",") or cursor.accept("*"):
        sorts.append(_parse_attribute_sort(cursor))
    if cursor.accept("->"):
        sorts.append(_parse_attribute_sort(cursor))
    elif len(sorts) > 1 and cursor.next_is("."):
        raise SourceIssue(term.at, f"attribute {term} has arguments but no range; expected '-> sort'")
    cursor.expect(".")
    names: list[str] = []
    for place, sort in enumerate(sorts, 1):
        if isinstance(sort, Term):
            names.append(sort.name[1:])
        else:
            cursor.uses_plog2 = True
            names.append(f"{term.name}_sort_{place}")
            yield SortDefinition(names[-1], sort, at=sort.at)
    for term in terms:
        yield AttributeDeclaration(term.name, tuple(names[:-1]), names[-1], at=term.at)


def _parse_attribute_sort(cursor: Cursor) -> SortExpression:
    at = cursor.at
    if cursor.kind == NAME and cursor.second_kind not in ("(", ".."):
        return Term(f"#{cursor.take()}", at=at)
    return _parse_sort_expression(cursor)


# sort expressions


def _parse_sort_expression(cursor: Cursor) -> SortExpression:
    """Parse a sort expression. `*` binds more tightly than `+` and `-`."""
    return parse_chain(cursor, {"+": 1, "-": 1, "*": 2}, _parse_simple_sort, Operation)


def _parse_simple_sort(cursor: Cursor) -> SortExpression:
    at = cursor.at
    if cursor.next_is(HASH_NAME):
        return Term(f"#{parse_sort_name(cursor)}", at=at)
    if cursor.accept("{"):
        elements = cursor.parse_list(_parse_element)
        cursor.expect("}")
        return SortSet(tuple(elements), at=at)
    if cursor.accept("("):
        return cursor.parse_nested(_parse_sort_expression, ")")
    if cursor.next_is(NAME) and cursor.second_kind == "(":
        return _parse_record_sort(cursor)
    if not cursor.next_is(NAME, INTEGER, "-"):
        raise cursor.make_unexpected_error()
    low = _parse_bound(cursor)
    cursor.expect("..")
    return SortSet((Interval(low, _parse_bound(cursor), at=at),), at=at)


def parse_sort_name(cursor: Cursor) -> str:
    """Parse `#name` and return the name."""
    cursor.uses_plog2 = True
    return cursor.expect(HASH_NAME)[1:]


def _parse_element(cursor: Cursor) -> Expression | Interval:
    """Parse an element of a set: a value or an interval."""
    low = parse_value(cursor)
    if not cursor.accept(".."):
        return low
    return Interval(evaluate_integer(low), evaluate_integer(parse_value(cursor)), at=low.at)


def _parse_bound(cursor: Cursor) -> int:
    """Parse an end of an interval outside of braces: a sum of integers and constants."""
    total = evaluate_integer(_parse_operand(cursor))
    while cursor.next_is("+", "-") and cursor.second_kind in (INTEGER, NAME):
        following = cursor.kinds[cursor.index + 2]
        if following == ".." or (cursor.second_kind, following) == (NAME, "("):
            break  # another sort follows
        sign = -1 if cursor.take() == "-" else 1
        total += sign * evaluate_integer(_parse_operand(cursor))
    return total


def _parse_operand(cursor: Cursor) -> Expression:
    return require_value(parse_factor(cursor))


def _parse_record_sort(cursor: Cursor) -> RecordSort:
    at = cursor.at
    cursor.uses_plog2 = True
    name = cursor.take()
    cursor.expect("(")
    pairs = cursor.parse_nested(lambda cursor: cursor.parse_list(_parse_part), ")")
    parts, variables = zip(*pairs, strict=True)
    condition = _parse_condition(cursor) if cursor.accept(":") else None
    for side in (side for literal in list_comparisons(condition) for side in (literal.left, literal.right)):
        if isinstance(side, Variable) and side.name not in variables:
            raise SourceIssue(
                side.at, f"variable {side} is not an argument of the record; expected f(#sort({side}))"
            )
    return RecordSort(name, parts, variables, condition, at=at)


def _parse_part(cursor: Cursor) -> tuple[SortExpression, str | None]:
    """Parse `sort` or `sort(Variable)`."""
    sort = _parse_sort_expression(cursor)
    if not cursor.accept("("):
        return sort, None
    variable = cursor.expect(VARIABLE)
    cursor.expect(")")
    return sort, variable


def _parse_condition(cursor: Cursor) -> Condition:
    """Parse the condition of a record. `&` binds more tightly than `|`."""
    return parse_chain(cursor, {"|": 1, "&": 2}, _parse_comparison, Operation)


def _parse_comparison(cursor: Cursor) -> Condition:
    if cursor.accept("("):
        return cursor.parse_nested(_parse_condition, ")")
    left = _parse_operand(cursor)
    if not cursor.next_is(*RELATIONS):
        raise cursor.make_unexpected_error(("<",))
    relation = RELATIONS[cursor.take()]
    return ComparisonLiteral(left, relation, _parse_operand(cursor), at=left.at)
