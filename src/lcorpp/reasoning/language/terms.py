"""Nodes of the syntax tree below statements: expressions, literals and sort expressions.

Nodes are frozen. Each has a place, which equality ignores, and prints as P-log text.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

from lcorpp.reasoning.language.issues import SYNTHETIC_PLACE, Place

SHOWN_CHARACTERS = 120
"""`repr` of a node shows at most this many characters of its text."""


@dataclass(frozen=True)
class SyntaxNode:
    """Base class of nodes.

    at: the place where the node begins.
    """

    at: Place = field(default=SYNTHETIC_PLACE, compare=False, kw_only=True)

    def __repr__(self) -> str:
        text = str(self)
        if len(text) > SHOWN_CHARACTERS:
            text = f"{text[:SHOWN_CHARACTERS]}..."
        return f"<{type(self).__name__} {text}>"


@dataclass(frozen=True, repr=False)
class Number(SyntaxNode):
    """A number. Only the number of a pr-atom may be a fraction."""

    value: Fraction

    def __str__(self) -> str:
        if self.value.denominator == 1:
            return str(self.value.numerator)
        for digits in range(1, self.value.denominator.bit_length()):  # a finite decimal
            shifted = self.value * 10**digits
            if shifted.denominator == 1:
                shown = f"{abs(shifted.numerator):0{digits + 1}d}"
                return f"{'-' if self.value < 0 else ''}{shown[:-digits]}.{shown[-digits:]}"
        return str(self.value)


@dataclass(frozen=True, repr=False)
class Variable(SyntaxNode):
    """A variable, an identifier with a capital first letter."""

    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, repr=False)
class Term(SyntaxNode):
    """A constant `a`, a record `f(1, a)` or an attribute with its arguments, depending on the context."""

    name: str
    arguments: tuple[Expression, ...] = ()
    depth: int = field(init=False, compare=False, repr=False)

    def __post_init__(self) -> None:
        depths = [1 + depth(argument) for argument in self.arguments]
        object.__setattr__(self, "depth", max(depths) if depths else 1)

    def __str__(self) -> str:
        return f"{self.name}({','.join(map(str, self.arguments))})" if self.arguments else self.name


@dataclass(frozen=True, repr=False)
class Arithmetic(SyntaxNode):
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
        return f"{_format_operand(self.left)}{space}{self.operator}{space}{_format_operand(self.right)}"


Expression = Number | Variable | Term | Arithmetic


def depth(expression: Expression) -> int:
    """Nesting depth of an expression. The parser limits it, so that recursive functions are safe."""
    return expression.depth if isinstance(expression, Term | Arithmetic) else 0


def _format_operand(expression: Expression) -> str:
    bare = not isinstance(expression, Arithmetic) and not str(expression).startswith("-")
    return str(expression) if bare else f"({expression})"


@dataclass(frozen=True, repr=False)
class Literal(SyntaxNode):
    """`term relation value`, or its default negation. `p` is `p=true`, `-p` is `p=false`."""

    term: Term
    relation: str
    value: Expression
    negated: bool = False

    def __str__(self) -> str:
        return f"{'not ' if self.negated else ''}{self.term}{self.relation}{self.value}"


@dataclass(frozen=True, repr=False)
class ComparisonLiteral(SyntaxNode):
    """`left relation right` between expressions without attributes."""

    left: Expression
    relation: str
    right: Expression

    def __str__(self) -> str:
        return f"{self.left}{self.relation}{self.right}"


BodyLiteral = Literal | ComparisonLiteral


# sort expressions


@dataclass(frozen=True, repr=False)
class IntervalTerm(SyntaxNode):
    """`low..high`, including both ends."""

    low: int
    high: int

    def __str__(self) -> str:
        return f"{self.low}..{self.high}"


@dataclass(frozen=True, repr=False)
class SortName(SyntaxNode):
    """`#name`: the members of a sort defined earlier."""

    name: str

    def __str__(self) -> str:
        return f"#{self.name}"


@dataclass(frozen=True, repr=False)
class SortSet(SyntaxNode):
    """`{elements}` within a sort expression."""

    elements: tuple[Expression | IntervalTerm, ...]

    def __str__(self) -> str:
        return f"{{{', '.join(map(str, self.elements))}}}"


@dataclass(frozen=True, repr=False)
class Connective(SyntaxNode):
    """`left & right` or `left | right` in the condition of a record sort."""

    operator: str
    left: ComparisonLiteral | Connective
    right: ComparisonLiteral | Connective

    def __str__(self) -> str:
        return f"({self.left} {self.operator} {self.right})"


@dataclass(frozen=True, repr=False)
class RecordSort(SyntaxNode):
    """`name(part(Variable), part) : condition`: records with arguments from the parts.

    variables: the variable of each part in the condition, None without one.
    """

    name: str
    parts: tuple[SortExpression, ...]
    variables: tuple[str | None, ...]
    condition: ComparisonLiteral | Connective | None = None

    def __str__(self) -> str:
        pairs = zip(self.parts, self.variables, strict=True)
        inside = ", ".join(f"{part}({variable})" if variable else str(part) for part, variable in pairs)
        return f"{self.name}({inside}){f' : {self.condition}' if self.condition else ''}"


@dataclass(frozen=True, repr=False)
class SortOperation(SyntaxNode):
    """`left operator right`: union `+`, difference `-` or intersection `*` of sorts."""

    operator: str
    left: SortExpression
    right: SortExpression

    def __str__(self) -> str:
        return f"({self.left}) {self.operator} ({self.right})"


SortExpression = SortName | SortSet | RecordSort | SortOperation | IntervalTerm
