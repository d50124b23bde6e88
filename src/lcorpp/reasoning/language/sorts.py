"""Evaluation of sort expressions: sets, intervals, records, and set operations on sorts.

The total work for one program is bounded by `MAX_HANDLED_MEMBERS`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

from lcorpp.errors import expected_one_of
from lcorpp.reasoning.language.arithmetic import as_value, canonical_text, compare_values, is_integer
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.syntax import (
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
    Term,
    Variable,
)

MAX_SORT_SIZE = 100_000
"""Maximal number of members of a sort."""

MAX_HANDLED_MEMBERS = 500_000
"""Maximal number of members created or compared to evaluate the sorts of a program."""

_INTEGER = re.compile(r"\b[0-9]+\b")


@dataclass(frozen=True)
class Sort:
    """An evaluated sort.

    members: the members in order, as text.
    max_integer: the largest absolute value of the integers in its members.
    integers: whether all members are integers.
    """

    members: dict[str, None]
    max_integer: int
    integers: bool


BOOLEANS = Sort({"true": None, "false": None}, 0, False)


class SortTable:
    """The evaluated sorts of a program; a definition may refer to earlier sorts.

    known: name -> sort.
    """

    def __init__(self) -> None:
        self.known: dict[str, Sort] = {}
        self._handled = 0

    def define(self, definition: SortDefinition) -> None:
        """Evaluate one definition and add the sort.

        Raises:
            SourceIssue: the definition names an unknown sort, has a member twice, is empty or too large.
        """
        name, at = definition.name, definition.at
        if definition.has_sort_expression:
            expression = definition.elements[0]
            assert isinstance(expression, SortName | SortSet | RecordSort | SortOperation)
            sort = self._evaluate(expression)
        else:
            sort = self._evaluate_set(definition.elements, name)
        if not sort.members:
            raise SourceIssue(at, f"the sort {name} is empty")
        if len(sort.members) > MAX_SORT_SIZE:
            raise SourceIssue(at, f"the sort {name} is too large; at most {MAX_SORT_SIZE} members")
        self.known[name] = sort

    def _count_work(self, count: int, at: Place) -> None:
        self._handled += count
        if self._handled > MAX_HANDLED_MEMBERS:
            raise SourceIssue(
                at, f"evaluation of the sorts up to here takes more than {MAX_HANDLED_MEMBERS} members"
            )

    def _evaluate(self, expression: SortExpression) -> Sort:
        if isinstance(expression, SortName):
            if expression.name not in self.known:
                names = expected_one_of([f"#{name}" for name in self.known])
                raise SourceIssue(expression.at, f"unknown sort {str(expression)!r}; {names}")
            return self.known[expression.name]
        if isinstance(expression, IntervalTerm):
            return self._evaluate_interval(expression)
        if isinstance(expression, SortSet):
            return self._evaluate_set(expression.elements, "here")
        if isinstance(expression, RecordSort):
            return self._evaluate_records(expression)
        return self._evaluate_operation(expression)

    def _evaluate_set(self, elements: Iterable[Expression | SortExpression], name: str) -> Sort:
        members: dict[str, None] = {}
        max_integer, integers = 0, True
        for element in elements:
            if isinstance(element, IntervalTerm):
                part = self._evaluate_interval(element)
                new: Iterable[str] = part.members
                max_integer = max(max_integer, part.max_integer)
            else:
                assert not isinstance(element, SortName | SortSet | RecordSort | SortOperation)
                text = canonical_text(element)
                new = (text,)
                self._count_work(1, element.at)
                max_integer = max([max_integer, *map(int, _INTEGER.findall(text))])
                integers = integers and is_integer(text)
            for member in new:
                if member in members:
                    raise SourceIssue(element.at, f"{member} is twice in the sort {name}")
                members[member] = None
        return Sort(members, max_integer, integers)

    def _evaluate_interval(self, interval: IntervalTerm) -> Sort:
        low, high = interval.low, interval.high
        if high < low:
            raise SourceIssue(interval.at, f"the interval {interval} is empty")
        if high - low >= MAX_SORT_SIZE:
            raise SourceIssue(
                interval.at,
                f"the interval {interval} is too long; a sort has at most {MAX_SORT_SIZE} members",
            )
        self._count_work(high - low + 1, interval.at)
        return Sort(dict.fromkeys(map(str, range(low, high + 1))), max(abs(low), abs(high)), True)

    def _evaluate_records(self, record: RecordSort) -> Sort:
        parts = [self._evaluate(part) for part in record.parts]
        count = prod(len(part.members) for part in parts)
        if count > MAX_SORT_SIZE:
            raise SourceIssue(
                record.at,
                f"the records {record.name}(...) are {count}; a sort has at most {MAX_SORT_SIZE} members",
            )
        self._count_work(count * (1 + _count_comparisons(record.condition)), record.at)
        places = {variable: index for index, variable in enumerate(record.variables) if variable}
        if len(places) < sum(variable is not None for variable in record.variables):
            raise SourceIssue(record.at, "a variable names two arguments of the record")
        rows: Iterable[Sequence[str]] = product(*(part.members for part in parts))
        if (condition := record.condition) is not None:
            rows = (row for row in rows if _is_satisfied(condition, row, places))
        members = {f"{record.name}({','.join(row)})": None for row in rows}
        return Sort(members, max(part.max_integer for part in parts), False)

    def _evaluate_operation(self, operation: SortOperation) -> Sort:
        left, right = self._evaluate(operation.left), self._evaluate(operation.right)
        self._count_work(len(left.members) + len(right.members), operation.at)
        if operation.operator == "+":
            members = {**left.members, **right.members}
        elif operation.operator == "*":
            members = {member: None for member in left.members if member in right.members}
        else:
            members = {member: None for member in left.members if member not in right.members}
        return Sort(members, max(left.max_integer, right.max_integer), all(map(is_integer, members)))


def _count_comparisons(condition: ComparisonLiteral | Connective | None) -> int:
    """Return the cost of a condition: two members for each comparison."""
    if isinstance(condition, Connective):
        return _count_comparisons(condition.left) + _count_comparisons(condition.right)
    return 2 if condition else 0


def _is_satisfied(
    condition: ComparisonLiteral | Connective, row: Sequence[str], places: Mapping[str, int]
) -> bool:
    if isinstance(condition, Connective):
        parts = (_is_satisfied(part, row, places) for part in (condition.left, condition.right))
        return any(parts) if condition.operator == "|" else all(parts)
    left, right = (
        as_value(row[places[side.name]] if isinstance(side, Variable) else canonical_text(side))
        for side in (condition.left, condition.right)
    )
    return compare_values(left, condition.relation, right)


def iter_record_shapes(elements: Iterable[Expression | SortExpression]) -> Iterator[tuple[str, int]]:
    """Iterate over name and number of arguments of the records in sort expressions, without named sorts."""
    for element in elements:
        if isinstance(element, Term) and element.arguments:
            yield element.name, len(element.arguments)
        elif isinstance(element, RecordSort):
            yield element.name, len(element.parts)
            yield from iter_record_shapes(element.parts)
        elif isinstance(element, SortSet):
            yield from iter_record_shapes(element.elements)
        elif isinstance(element, SortOperation):
            yield from iter_record_shapes((element.left, element.right))
