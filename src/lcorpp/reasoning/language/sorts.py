"""Sorts: definitions, sort expressions (sets, intervals, records, set operations) and their evaluation.

The total work for one program is bounded by `MAX_HANDLED_MEMBERS`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
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
        members = sort.evaluate(self, name) if isinstance(sort, SortSet) else sort.evaluate(self)
        if not members:
            raise SourceIssue(at, f"the sort {name} is empty")
        _check_size(len(members), f"sort {name} has", at)
        self.known[name] = members

    def count_work(self, count: int, at: Place) -> None:
        """Count members handled; raise SourceIssue if they are too many."""
        self._handled += count
        if self._handled > MAX_HANDLED_MEMBERS:
            raise SourceIssue(
                at, f"evaluation of the sorts up to here takes more than {MAX_HANDLED_MEMBERS} members"
            )


def _check_size(count: int, what: str, at: Place) -> None:
    if count > MAX_SORT_SIZE:
        raise SourceIssue(at, f"the {what} {count} members; a sort has at most {MAX_SORT_SIZE}")


# sort expressions


@syntax_node
class Interval(SyntaxNode):
    """`low..high`, including both ends."""

    low: int
    high: int

    def __str__(self) -> str:
        return f"{self.low}..{self.high}"

    def evaluate(self, table: SortTable) -> Members:
        """Return the integers."""
        if self.high < self.low:
            raise SourceIssue(self.at, f"the interval {self} is empty")
        count = self.high - self.low + 1
        _check_size(count, f"interval {self} has", self.at)
        table.count_work(count, self.at)
        return dict.fromkeys(map(str, range(self.low, self.high + 1)))


@syntax_node
class SortName(SyntaxNode):
    """`#name`: the members of a sort defined earlier."""

    name: str

    def __str__(self) -> str:
        return f"#{self.name}"

    def evaluate(self, table: SortTable) -> Members:
        """Look the sort up."""
        if self.name not in table.known:
            names = expected_one_of([f"#{name}" for name in table.known])
            raise SourceIssue(self.at, f"unknown sort {str(self)!r}; {names}")
        return table.known[self.name]


@syntax_node
class SortSet(SyntaxNode):
    """`{elements}`."""

    elements: tuple[Expression | Interval, ...]

    def __str__(self) -> str:
        return f"{{{', '.join(map(str, self.elements))}}}"

    def evaluate(self, table: SortTable, name: str = "here") -> Members:
        """Return the elements; `name` is the name of the sort in messages."""
        members: Members = {}
        for element in self.elements:
            if isinstance(element, Interval):
                new = element.evaluate(table)
            else:
                table.count_work(1, element.at)
                new = {canonical_text(element): None}
                if isinstance(element, Term) and element.arguments:
                    table.records.add((element.name, len(element.arguments)))
            for member in new:
                if member in members:
                    raise SourceIssue(element.at, f"{member} is twice in the sort {name}")
                members[member] = None
        return members


@syntax_node
class SortOperation(Operation):
    """The union `+`, difference `-` or intersection `*` of sorts."""

    left: SortExpression
    right: SortExpression

    def __str__(self) -> str:
        return f"({self.left}) {self.operator} ({self.right})"

    def evaluate(self, table: SortTable) -> Members:
        """Return the union, difference or intersection in the order of the operands."""
        left, right = self.left.evaluate(table), self.right.evaluate(table)
        table.count_work(len(left) + len(right), self.at)
        if self.operator == "+":
            return {**left, **right}
        return {member: None for member in left if (member in right) == (self.operator == "*")}


@syntax_node
class Connective(Operation):
    """`left & right` or `left | right` in the condition of a record sort."""

    left: Condition
    right: Condition

    def __str__(self) -> str:
        return f"({self.left} {self.operator} {self.right})"


Condition = ComparisonLiteral | Connective


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
        return f"{self.name}({inside}){f' : {self.condition}' if self.condition else ''}"

    def evaluate(self, table: SortTable) -> Members:
        """Return the records that satisfy the condition."""
        parts = [part.evaluate(table) for part in self.parts]
        count = prod(map(len, parts))
        _check_size(count, f"records {self.name}(...) have", self.at)
        table.records.add((self.name, len(parts)))
        table.count_work(count * (1 + 2 * len(list_comparisons(self.condition))), self.at)
        places = {variable: index for index, variable in enumerate(self.variables) if variable}
        if len(places) < sum(variable is not None for variable in self.variables):
            raise SourceIssue(self.at, "a variable names two arguments of the record")
        rows: Iterable[Sequence[str]] = product(*parts)
        if (condition := self.condition) is not None:
            rows = (row for row in rows if _is_satisfied(condition, row, places))
        return {f"{self.name}({','.join(row)})": None for row in rows}


def list_comparisons(condition: Condition | None) -> list[ComparisonLiteral]:
    """List the comparisons of a condition."""
    if isinstance(condition, Connective):
        return [*list_comparisons(condition.left), *list_comparisons(condition.right)]
    return [condition] if condition else []


def _is_satisfied(condition: Condition, row: Sequence[str], places: Mapping[str, int]) -> bool:
    if isinstance(condition, Connective):
        parts = (_is_satisfied(part, row, places) for part in (condition.left, condition.right))
        return any(parts) if condition.operator == "|" else all(parts)
    left, right = (
        as_value(row[places[side.name]] if isinstance(side, Variable) else canonical_text(side))
        for side in (condition.left, condition.right)
    )
    return compare_values(left, condition.relation, right)


SortExpression = SortName | SortSet | RecordSort | SortOperation
