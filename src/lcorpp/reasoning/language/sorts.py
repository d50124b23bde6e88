"""Sorts: definitions, sort expressions (sets, intervals, records, set operations) and their evaluation.

The total work for one program is bounded by `MAX_HANDLED_MEMBERS`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from math import prod

from lcorpp.errors import expected_one_of
from lcorpp.reasoning.language.arithmetic import as_value, canonical_text, compare_values
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.syntax import (
    ComparisonLiteral,
    Expression,
    Operation,
    Statement,
    SyntaxNode,
    Term,
    Variable,
    syntax_node,
)

MAX_SORT_SIZE = 100_000
"""Maximal number of members of a sort."""

MAX_HANDLED_MEMBERS = 500_000
"""Maximal number of members created or compared to evaluate the sorts of a program."""

BOOLEAN = "boolean"
"""The built-in sort with the values true and false."""

Members = dict[str, None]
"""The members of a sort in order, as text."""


@syntax_node
class Interval(SyntaxNode):
    """`low..high`, including both ends."""

    low: int
    high: int

    def __str__(self) -> str:
        return f"{self.low}..{self.high}"


@syntax_node
class SortSet(SyntaxNode):
    """`{elements}`."""

    elements: tuple[Expression | Interval, ...]

    def __str__(self) -> str:
        return f"{{{', '.join(map(str, self.elements))}}}"


@syntax_node
class RecordSort(SyntaxNode):
    """`name(part(Variable), part) : condition`: records with arguments from the parts.

    variables: the variable of each part in the condition, None without one.
    """

    name: str
    parts: tuple[SortExpression, ...]
    variables: tuple[str | None, ...]
    condition: Condition | None = None

    def __str__(self) -> str:
        pairs = zip(self.parts, self.variables, strict=True)
        inside = ", ".join(f"{part}({variable})" if variable else str(part) for part, variable in pairs)
        records = f"{self.name}({inside})"
        return f"({records} : {self.condition})" if self.condition else records


SortExpression = Term | SortSet | RecordSort | Operation
"""A name `#s`, a set, records, or the union `+`, difference `-` or intersection `*` of sorts."""

Condition = ComparisonLiteral | Operation
"""A comparison, or the conjunction `&` or disjunction `|` of conditions."""


@syntax_node
class SortDefinition(Statement):
    """`name = {elements}.` or, a construct of plog 2.0, `#name = expression.`"""

    name: str
    sort: SortExpression

    def __str__(self) -> str:
        return f"{'' if isinstance(self.sort, SortSet) else '#'}{self.name} = {self.sort}."


class SortTable:
    """The evaluated sorts of a program; a definition may refer to earlier sorts.

    known: name -> members.
    records: name and number of arguments of the records.
    """

    def __init__(self) -> None:
        self.records: set[tuple[str, int]] = set()
        self.known: dict[str, Members] = {BOOLEAN: {"true": None, "false": None}}
        self._handled = 0

    def define(self, definition: SortDefinition) -> None:
        """Evaluate one definition and add the sort.

        Raises:
            SourceIssue: the definition names an unknown sort, has a member twice, is empty or too large.
        """
        name, sort, at = definition.name, definition.sort, definition.at
        members = self._evaluate_set(sort, name) if isinstance(sort, SortSet) else self._evaluate(sort)
        if not members:
            raise SourceIssue(at, f"the sort {name} is empty")
        _check_size(len(members), f"sort {name} has", at)
        self.known[name] = members

    def _count_work(self, count: int, at: Place) -> None:
        self._handled += count
        if self._handled > MAX_HANDLED_MEMBERS:
            raise SourceIssue(
                at, f"evaluation of the sorts up to here takes more than {MAX_HANDLED_MEMBERS} members"
            )

    def _evaluate(self, sort: SyntaxNode) -> Members:
        match sort:
            case Term(name):
                if name[1:] not in self.known:
                    names = expected_one_of([f"#{known}" for known in self.known])
                    raise SourceIssue(sort.at, f"unknown sort {name!r}; {names}")
                return self.known[name[1:]]
            case RecordSort():
                return self._evaluate_records(sort)
            case Operation(operator, left_sort, right_sort):
                left, right = self._evaluate(left_sort), self._evaluate(right_sort)
                self._count_work(len(left) + len(right), sort.at)
                if operator == "+":
                    return {**left, **right}
                return {member: None for member in left if (member in right) == (operator == "*")}
        assert isinstance(sort, SortSet)
        return self._evaluate_set(sort, "here")

    def _evaluate_set(self, sort: SortSet, name: str) -> Members:
        """Evaluate a set; `name` is the name of the sort in messages."""
        members: Members = {}
        for element in sort.elements:
            if isinstance(element, Interval):
                count = element.high - element.low + 1
                if count < 1:
                    raise SourceIssue(element.at, f"the interval {element} is empty")
                _check_size(count, f"interval {element} has", element.at)
                self._count_work(count, element.at)
                new = list(map(str, range(element.low, element.high + 1)))
            else:
                self._count_work(1, element.at)
                new = [canonical_text(element)]
                if isinstance(element, Term) and element.arguments:
                    self.records.add((element.name, len(element.arguments)))
            for member in new:
                if member in members:
                    raise SourceIssue(element.at, f"{member} appears twice in the sort {name}")
                members[member] = None
        return members

    def _evaluate_records(self, sort: RecordSort) -> Members:
        """Evaluate the records that satisfy the condition."""
        name, condition = sort.name, sort.condition
        parts = list(map(self._evaluate, sort.parts))
        count = prod(map(len, parts))
        _check_size(count, f"records {name}(...) have", sort.at)
        self.records.add((name, len(parts)))
        self._count_work(count * (1 + 2 * len(list_comparisons(condition))), sort.at)
        places = {variable: index for index, variable in enumerate(sort.variables) if variable}
        if len(places) < sum(variable is not None for variable in sort.variables):
            raise SourceIssue(sort.at, "a variable names two arguments of the record")
        rows = (row for row in product(*parts) if condition is None or _is_satisfied(condition, row, places))
        return {f"{name}({','.join(row)})": None for row in rows}


def _check_size(count: int, what: str, at: Place) -> None:
    if count > MAX_SORT_SIZE:
        raise SourceIssue(at, f"the {what} {count} members; a sort has at most {MAX_SORT_SIZE}")


def list_comparisons(condition: SyntaxNode | None) -> list[ComparisonLiteral]:
    """List the comparisons of a condition."""
    if isinstance(condition, Operation):
        return [*list_comparisons(condition.left), *list_comparisons(condition.right)]
    return [condition] if isinstance(condition, ComparisonLiteral) else []


def _is_satisfied(condition: SyntaxNode, row: Sequence[str], places: Mapping[str, int]) -> bool:
    if isinstance(condition, Operation):
        parts = (_is_satisfied(part, row, places) for part in (condition.left, condition.right))
        return any(parts) if condition.operator == "|" else all(parts)
    assert isinstance(condition, ComparisonLiteral)
    left, right = (
        as_value(row[places[side.name]] if isinstance(side, Variable) else canonical_text(side))
        for side in (condition.left, condition.right)
    )
    return compare_values(left, condition.relation, right)
