"""The nodes of sort expressions: what may stand on the right of `#name =`."""

from __future__ import annotations

from dataclasses import dataclass

from lcorpp.reasoning.language.terms import Comparison, Expression, Node


@dataclass(frozen=True)
class Interval(Node):
    """`low..high`, both ends included."""

    low: int
    high: int

    def __str__(self) -> str:
        return f"{self.low}..{self.high}"


@dataclass(frozen=True)
class SortName(Node):
    """`#name`: the members of a sort that is defined further up."""

    name: str

    def __str__(self) -> str:
        return f"#{self.name}"


@dataclass(frozen=True)
class SortSet(Node):
    """`{elements}` within a sort expression."""

    elements: tuple[Expression | Interval, ...]

    def __str__(self) -> str:
        return f"{{{', '.join(map(str, self.elements))}}}"


@dataclass(frozen=True)
class Connective(Node):
    """`left & right` or `left | right` in the condition of a record sort."""

    operator: str
    left: Comparison | Connective
    right: Comparison | Connective

    def __str__(self) -> str:
        return f"({self.left} {self.operator} {self.right})"


@dataclass(frozen=True)
class RecordSort(Node):
    """`name(part(Variable), part) : condition`: the records whose arguments are members of the parts.

    variables: for each part the variable that stands for it in the condition, or nothing.
    """

    name: str
    parts: tuple[SortExpression, ...]
    variables: tuple[str | None, ...]
    condition: Comparison | Connective | None = None

    def __str__(self) -> str:
        pairs = zip(self.parts, self.variables, strict=True)
        inside = ", ".join(f"{part}({variable})" if variable else str(part) for part, variable in pairs)
        return f"{self.name}({inside}){f' : {self.condition}' if self.condition else ''}"


@dataclass(frozen=True)
class SortOperation(Node):
    """`left operator right`: union `+`, difference `-` or intersection `*` of sorts."""

    operator: str
    left: SortExpression
    right: SortExpression

    def __str__(self) -> str:
        return f"({self.left}) {self.operator} ({self.right})"


SortExpression = SortName | SortSet | RecordSort | SortOperation | Interval
