"""What statements are made of: expressions and literals, frozen nodes that know where they stand.

The place of a node takes no part in its equality.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction


@dataclass(frozen=True)
class Place:
    """Where a node begins: file, line and column, the last two counted from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


SYNTHETIC_PLACE = Place("<made>", 1, 1)
"""The place of nodes that no text was read for."""


@dataclass(frozen=True)
class Node:
    """What all nodes share: their place."""

    at: Place = field(default=SYNTHETIC_PLACE, compare=False, repr=False, kw_only=True)


@dataclass(frozen=True)
class Number(Node):
    """A number; only the number of a pr-atom may be a fraction."""

    value: Fraction

    def __str__(self) -> str:
        if self.value.denominator == 1:
            return str(self.value.numerator)
        for digits in range(1, self.value.denominator.bit_length()):  # a decimal as written, if it ends
            shifted = self.value * 10**digits
            if shifted.denominator == 1:
                shown = f"{abs(shifted.numerator):0{digits + 1}d}"
                return f"{'-' if self.value < 0 else ''}{shown[:-digits]}.{shown[-digits:]}"
        return str(self.value)


@dataclass(frozen=True)
class Variable(Node):
    """A variable: an identifier that begins with a capital."""

    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Term(Node):
    """A constant `a`, a record `f(1, a)` or an attribute with its arguments; the context tells which."""

    name: str
    arguments: tuple[Expression, ...] = ()
    depth: int = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "depth", 1 + max((depth(a) for a in self.arguments), default=0))

    def __str__(self) -> str:
        return f"{self.name}({','.join(map(str, self.arguments))})" if self.arguments else self.name


@dataclass(frozen=True)
class Arithmetic(Node):
    """`left operator right`, the operator one of ``+ - * / mod``.

    Division is exact in the number of a pr-atom, elsewhere the integer division of ASP.
    """

    operator: str
    left: Expression
    right: Expression
    depth: int = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "depth", 1 + max(depth(self.left), depth(self.right)))

    def __str__(self) -> str:
        space = " " if self.operator == "mod" else ""
        return f"{_operand(self.left)}{space}{self.operator}{space}{_operand(self.right)}"


Expression = Number | Variable | Term | Arithmetic


def depth(expression: Expression) -> int:
    """How deep an expression is nested; the parser refuses what a recursive function could not walk."""
    return expression.depth if isinstance(expression, Term | Arithmetic) else 0


def _operand(expression: Expression) -> str:
    bare = not isinstance(expression, Arithmetic) and not str(expression).startswith("-")
    return str(expression) if bare else f"({expression})"


@dataclass(frozen=True)
class Literal(Node):
    """`term relation value`, under `not` if negated; `p` and `-p` are `p=true` and `p=false`."""

    term: Term
    relation: str
    value: Expression
    negated: bool = False

    def __str__(self) -> str:
        return f"{'not ' if self.negated else ''}{self.term}{self.relation}{self.value}"


@dataclass(frozen=True)
class Comparison(Node):
    """`left relation right` between expressions without attributes."""

    left: Expression
    relation: str
    right: Expression

    def __str__(self) -> str:
        return f"{self.left}{self.relation}{self.right}"
