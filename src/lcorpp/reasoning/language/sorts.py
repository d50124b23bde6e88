"""The members of sorts: sets, intervals, records, and union, difference and intersection of sorts.

Whatever the text says, no more than half a million members are handled for one program.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

from lcorpp.errors import expected_one_of
from lcorpp.reasoning.language.arithmetic import canonical_text, compare, is_integer
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.syntax import (
    Comparison,
    Connective,
    Expression,
    Interval,
    Place,
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
"""How many members a sort may have."""

MAX_HANDLED_MEMBERS = 500_000
"""How many members are handled to make the sorts of a program, as often as each is taken up or compared."""

_INTEGER = re.compile(r"\b[0-9]+\b")


@dataclass(frozen=True)
class Sort:
    """A sort that has been worked out.

    members: in order, as text.
    largest: no integer in a member has a larger absolute value.
    integers: whether all members are integers.
    """

    members: dict[str, None]
    largest: int
    integers: bool


BOOLEANS = Sort({"true": None, "false": None}, 0, False)


class Sorts:
    """The sorts of a program, worked out one after the other; each may use those before it."""

    def __init__(self) -> None:
        self.known: dict[str, Sort] = {}
        self._handled = 0

    def define(self, definition: SortDefinition) -> None:
        """Work out one definition.

        Raises:
            SourceIssue: it names an unknown sort, has a member twice, is empty or too large.
        """
        name, at = definition.name, definition.at
        if definition.is_algebra:
            expression = definition.elements[0]
            assert isinstance(expression, SortName | SortSet | RecordSort | SortOperation)
            made = self._made(expression)
        else:
            made = self._set(definition.elements, name)
        if not made.members:
            raise SourceIssue(at, f"the sort {name} is empty")
        if len(made.members) > MAX_SORT_SIZE:
            raise SourceIssue(at, f"the sort {name} is too large; at most {MAX_SORT_SIZE} members")
        self.known[name] = made

    def _handle(self, count: int, at: Place) -> None:
        self._handled += count
        if self._handled > MAX_HANDLED_MEMBERS:
            raise SourceIssue(
                at, f"the sorts up to here take more than {MAX_HANDLED_MEMBERS} members to make"
            )

    def _made(self, expression: SortExpression) -> Sort:
        if isinstance(expression, SortName):
            if expression.name not in self.known:
                names = expected_one_of([f"#{name}" for name in self.known])
                raise SourceIssue(expression.at, f"unknown sort {str(expression)!r}; {names}")
            return self.known[expression.name]
        if isinstance(expression, Interval):
            return self._interval(expression)
        if isinstance(expression, SortSet):
            return self._set(expression.elements, "here")
        if isinstance(expression, RecordSort):
            return self._records(expression)
        return self._operation(expression)

    def _set(self, elements: Iterable[Expression | SortExpression], name: str) -> Sort:
        members: dict[str, None] = {}
        largest, integers = 0, True
        for element in elements:
            if isinstance(element, Interval):
                part = self._interval(element)
                found: Iterable[str] = part.members
                largest = max(largest, part.largest)
            else:
                assert not isinstance(element, SortName | SortSet | RecordSort | SortOperation)
                text = canonical_text(element)
                found = (text,)
                self._handle(1, element.at)
                if is_integer(text):
                    largest = max(largest, abs(int(text)))
                else:
                    largest, integers = max(largest, _largest(text)), False
            for member in found:
                if member in members:
                    raise SourceIssue(element.at, f"{member} is twice in the sort {name}")
                members[member] = None
        return Sort(members, largest, integers)

    def _interval(self, interval: Interval) -> Sort:
        low, high = interval.low, interval.high
        if high < low:
            raise SourceIssue(interval.at, f"the interval {interval} is empty")
        if high - low >= MAX_SORT_SIZE:
            raise SourceIssue(
                interval.at,
                f"the interval {interval} is too long; a sort has at most {MAX_SORT_SIZE} members",
            )
        self._handle(high - low + 1, interval.at)
        return Sort(dict.fromkeys(map(str, range(low, high + 1))), max(abs(low), abs(high)), True)

    def _records(self, record: RecordSort) -> Sort:
        parts = [self._made(part) for part in record.parts]
        count = prod(len(part.members) for part in parts)
        if count > MAX_SORT_SIZE:
            raise SourceIssue(
                record.at,
                f"the records {record.name}(...) are {count}; a sort has at most {MAX_SORT_SIZE} members",
            )
        self._handle(count * (1 + _comparisons(record.condition)), record.at)
        places = {variable: index for index, variable in enumerate(record.variables) if variable}
        if len(places) < sum(variable is not None for variable in record.variables):
            raise SourceIssue(record.at, "a variable stands for two arguments of the record")
        rows: Iterable[Sequence[str]] = product(*(part.members for part in parts))
        if record.condition is not None:
            condition = record.condition
            rows = (row for row in rows if _holds(condition, row, places))
        members = {f"{record.name}({','.join(row)})": None for row in rows}
        return Sort(members, max(part.largest for part in parts), False)

    def _operation(self, operation: SortOperation) -> Sort:
        left, right = self._made(operation.left), self._made(operation.right)
        self._handle(len(left.members) + len(right.members), operation.at)
        if operation.operator == "+":
            members = {**left.members, **right.members}
        elif operation.operator == "*":
            members = {member: None for member in left.members if member in right.members}
        else:
            members = {member: None for member in left.members if member not in right.members}
        return Sort(members, max(left.largest, right.largest), all(map(is_integer, members)))


def _largest(text: str) -> int:
    return max(map(int, _INTEGER.findall(text)), default=0)


def _comparisons(condition: Comparison | Connective | None) -> int:
    """How many comparisons a condition has, each weighed as two members."""
    if isinstance(condition, Connective):
        return _comparisons(condition.left) + _comparisons(condition.right)
    return 2 if condition else 0


def _holds(condition: Comparison | Connective, row: Sequence[str], places: Mapping[str, int]) -> bool:
    if isinstance(condition, Connective):
        left = _holds(condition.left, row, places)
        if left == (condition.operator == "|"):
            return left
        return _holds(condition.right, row, places)
    sides = (
        row[places[side.name]] if isinstance(side, Variable) else canonical_text(side)
        for side in (condition.left, condition.right)
    )
    first, second = sides
    return compare(first, condition.relation, second)


def records_of(elements: Iterable[Expression | SortExpression]) -> Iterator[tuple[str, int]]:
    """Name and number of arguments of each kind of record in sort expressions, names of sorts left alone."""
    for element in elements:
        if isinstance(element, Term) and element.arguments:
            yield element.name, len(element.arguments)
        elif isinstance(element, RecordSort):
            yield element.name, len(element.parts)
            yield from records_of(element.parts)
        elif isinstance(element, SortSet):
            yield from records_of(element.elements)
        elif isinstance(element, SortOperation):
            yield from records_of((element.left, element.right))
