"""Syntax tree of P-log: the statements, with the nodes of `terms` re-exported.

Each node prints as text that parses to an equal node; equality ignores places.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal as OneOf, get_args

from lcorpp.reasoning.language.terms import (
    Arithmetic as Arithmetic,
    BodyLiteral as BodyLiteral,
    ComparisonLiteral as ComparisonLiteral,
    Connective as Connective,
    Expression as Expression,
    IntervalTerm as IntervalTerm,
    Literal as Literal,
    Number as Number,
    RecordSort as RecordSort,
    SortExpression as SortExpression,
    SortName as SortName,
    SortOperation as SortOperation,
    SortSet as SortSet,
    SyntaxNode as SyntaxNode,
    Term as Term,
    Variable as Variable,
)

Semantics = OneOf["2009", "2018"]
"""Semantics of `do` and Condition 1: TPLP 9(1), 2009, or P-log 2, 2018."""

SEMANTICS: tuple[str, ...] = get_args(Semantics)

Body = tuple[BodyLiteral, ...]


def _format_body(body: Body, sign: str = " :- ") -> str:
    return f"{sign}{', '.join(map(str, body))}" if body else ""


def _format_label(label: Term | None) -> str:
    return f"[{label}] " if label else ""


@dataclass(frozen=True, repr=False)
class SortDefinition(SyntaxNode):
    """`name = {elements}.`, or `#name = expression.` with the expression as the only element."""

    name: str
    elements: tuple[Expression | SortExpression, ...]

    @property
    def has_sort_expression(self) -> bool:
        """Whether the definition is a sort expression, a construct of plog 2.0."""
        return len(self.elements) == 1 and isinstance(
            self.elements[0], SortName | SortSet | RecordSort | SortOperation
        )

    def __str__(self) -> str:
        if self.has_sort_expression:
            return f"#{self.name} = {self.elements[0]}."
        return f"{self.name} = {{{', '.join(map(str, self.elements))}}}."


@dataclass(frozen=True, repr=False)
class AttributeDeclaration(SyntaxNode):
    """`name : arguments -> range.`"""

    name: str
    arguments: tuple[str, ...]
    range: str

    def __str__(self) -> str:
        return f"{self.name} : {', '.join(self.arguments)}{' -> ' if self.arguments else ''}{self.range}."


@dataclass(frozen=True, repr=False)
class DomainDirective(SyntaxNode):
    """`#domain sort(X;Y).`: the sort of these variables in the whole program."""

    sort: str
    variables: tuple[str, ...]

    def __str__(self) -> str:
        return f"#domain {self.sort}({';'.join(self.variables)})."


@dataclass(frozen=True, repr=False)
class DynamicRange(SyntaxNode):
    """`{variable : condition}`: the possible values of a selection, which depend on the world."""

    variable: Variable
    condition: Body

    def __str__(self) -> str:
        return f"{{{self.variable} : {', '.join(map(str, self.condition))}}}"


@dataclass(frozen=True, repr=False)
class Selection(SyntaxNode):
    """`[label] random(term : range) :- body.`"""

    term: Term
    range: DynamicRange | None = None
    body: Body = ()
    label: Term | None = None

    def __str__(self) -> str:
        chosen = f" : {self.range}" if self.range else ""
        return f"{_format_label(self.label)}random({self.term}{chosen}){_format_body(self.body)}."


@dataclass(frozen=True, repr=False)
class Probability(SyntaxNode):
    """`[label] pr(term=value | condition) = number.` A number without variables is evaluated."""

    term: Term
    value: Expression
    number: Expression
    condition: Body = ()
    label: Term | None = None

    def __str__(self) -> str:
        number = str(self.number.value) if isinstance(self.number, Number) else str(self.number)
        condition = _format_body(self.condition, " | ")
        return f"{_format_label(self.label)}pr({self.term}={self.value}{condition}) = {number}."


@dataclass(frozen=True, repr=False)
class Rule(SyntaxNode):
    """`head :- body.` A rule without body is a fact, one without head a constraint."""

    head: Literal | None
    body: Body = ()

    def __str__(self) -> str:
        return f"{self.head or ''}{_format_body(self.body)}.".lstrip()


@dataclass(frozen=True, repr=False)
class CrRule(SyntaxNode):
    """`[label] statement +- body.`: a consistency-restoring rule, applied only if no possible world exists.

    statement: the rule or random selection that it adds.
    label: the label of a rule; a selection has its own.
    """

    statement: Rule | Selection
    label: Term | None = None

    def __str__(self) -> str:
        head, _, body = str(self.statement)[:-1].partition(" :- ")
        if isinstance(self.statement, Rule) and self.statement.head is None:
            head, body = "", ", ".join(map(str, self.statement.body))
        return f"{_format_label(self.label)}{head} +- {body}".rstrip() + "."


@dataclass(frozen=True, repr=False)
class Observation(SyntaxNode):
    """`obs(literal)`: excludes the worlds in which the literal is false."""

    literal: Literal

    def __str__(self) -> str:
        return f"obs({self.literal})."


@dataclass(frozen=True, repr=False)
class Intervention(SyntaxNode):
    """`do(term=value)`: an intervention that replaces the random selection of the term."""

    term: Term
    value: Expression

    def __str__(self) -> str:
        return f"do({self.term}={self.value})."


@dataclass(frozen=True, repr=False)
class Query(SyntaxNode):
    """`?{literals} | conditions.` for a probability, `? subjects | conditions.` for a joint distribution.

    A query has either `literals` or `subjects`.
    """

    literals: tuple[Literal, ...] = ()
    subjects: tuple[Term, ...] = ()
    observations: tuple[Observation, ...] = ()
    interventions: tuple[Intervention, ...] = ()

    def __str__(self) -> str:
        parts = ", ".join(map(str, self.subjects or self.literals))
        asked = parts if self.subjects else f"{{{parts}}}"
        conditions = ", ".join(str(c)[:-1] for c in (*self.observations, *self.interventions))
        return f"?{asked}{' | ' if conditions else ''}{conditions}."


Statement = (
    SortDefinition
    | AttributeDeclaration
    | DomainDirective
    | Selection
    | Probability
    | Rule
    | CrRule
    | Observation
    | Intervention
    | Query
)
