"""The syntax tree of P-log: frozen nodes that know where they stand and print as the text that reads back.

The place of a node takes no part in its equality, so a program equals what its own text parses to.
Expressions and literals come from `nodes`, sort expressions from `sort_nodes`; import them from here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal as OneOf

from lcorpp.reasoning.language.sort_nodes import (
    Connective,
    Interval,
    RecordSort,
    SortExpression,
    SortName,
    SortOperation,
    SortSet,
)
from lcorpp.reasoning.language.terms import (
    SYNTHETIC_PLACE,
    Arithmetic,
    Comparison,
    Expression,
    Literal,
    Node,
    Number,
    Place,
    Term,
    Variable,
    depth,
)

__all__ = [
    "SYNTHETIC_PLACE",
    "Arithmetic",
    "AttributeDeclaration",
    "Body",
    "Comparison",
    "Connective",
    "CrRule",
    "DomainDirective",
    "DynamicRange",
    "Expression",
    "Interval",
    "Intervention",
    "Literal",
    "Node",
    "Number",
    "Observation",
    "Place",
    "Probability",
    "Query",
    "RecordSort",
    "Rule",
    "Selection",
    "Semantics",
    "SortDefinition",
    "SortExpression",
    "SortName",
    "SortOperation",
    "SortSet",
    "Statement",
    "Term",
    "Variable",
    "depth",
]

Semantics = OneOf["2009", "2018"]
"""The two meanings of `do` and of Condition 1: that of TPLP 9(1), 2009, and that of P-log 2, 2018."""

Body = tuple[Literal | Comparison, ...]


def _if(body: Body, sign: str = " :- ") -> str:
    return f"{sign}{', '.join(map(str, body))}" if body else ""


def _label(label: Term | None) -> str:
    return f"[{label}] " if label else ""


@dataclass(frozen=True)
class SortDefinition(Node):
    """`name = {elements}.`, or `#name = expression.` with the expression as the only element."""

    name: str
    elements: tuple[Expression | SortExpression, ...]

    @property
    def is_algebra(self) -> bool:
        """Whether it is written with a sort expression, which only plog 2.0 has."""
        return len(self.elements) == 1 and isinstance(
            self.elements[0], SortName | SortSet | RecordSort | SortOperation
        )

    def __str__(self) -> str:
        if self.is_algebra:
            return f"#{self.name} = {self.elements[0]}."
        return f"{self.name} = {{{', '.join(map(str, self.elements))}}}."


@dataclass(frozen=True)
class AttributeDeclaration(Node):
    """`name : arguments -> range.`"""

    name: str
    arguments: tuple[str, ...]
    range: str

    def __str__(self) -> str:
        return f"{self.name} : {', '.join(self.arguments)}{' -> ' if self.arguments else ''}{self.range}."


@dataclass(frozen=True)
class DomainDirective(Node):
    """`#domain sort(X;Y).`: the sort of these variables, everywhere in the program."""

    sort: str
    variables: tuple[str, ...]

    def __str__(self) -> str:
        return f"#domain {self.sort}({';'.join(self.variables)})."


@dataclass(frozen=True)
class DynamicRange(Node):
    """`{variable : condition}`: the values a selection may take, judged in each world."""

    variable: Variable
    condition: Body

    def __str__(self) -> str:
        return f"{{{self.variable} : {', '.join(map(str, self.condition))}}}"


@dataclass(frozen=True)
class Selection(Node):
    """`[label] random(term : range) :- body.`"""

    term: Term
    range: DynamicRange | None = None
    body: Body = ()
    label: Term | None = None

    def __str__(self) -> str:
        chosen = f" : {self.range}" if self.range else ""
        return f"{_label(self.label)}random({self.term}{chosen}){_if(self.body)}."


@dataclass(frozen=True)
class Probability(Node):
    """`[label] pr(term=value | condition) = number.`; a number without variables is kept evaluated."""

    term: Term
    value: Expression
    number: Expression
    condition: Body = ()
    label: Term | None = None

    def __str__(self) -> str:
        number = str(self.number.value) if isinstance(self.number, Number) else str(self.number)
        return f"{_label(self.label)}pr({self.term}={self.value}{_if(self.condition, ' | ')}) = {number}."


@dataclass(frozen=True)
class Rule(Node):
    """`head :- body.`, a fact without body, a constraint without head."""

    head: Literal | None
    body: Body = ()

    def __str__(self) -> str:
        return f"{self.head or ''}{_if(self.body)}.".lstrip()


@dataclass(frozen=True)
class CrRule(Node):
    """`[label] statement +- body.`: a rule that applies only if there is no possible world without it.

    statement: the rule, or the random selection, that it then is.
    label: of a rule; a selection carries its own.
    """

    statement: Rule | Selection
    label: Term | None = None

    def __str__(self) -> str:
        head, _, body = str(self.statement)[:-1].partition(" :- ")
        if isinstance(self.statement, Rule) and self.statement.head is None:
            head, body = "", ", ".join(map(str, self.statement.body))
        return f"{_label(self.label)}{head} +- {body}".rstrip() + "."


@dataclass(frozen=True)
class Observation(Node):
    """`obs(literal)`: only worlds in which the literal holds are possible."""

    literal: Literal

    def __str__(self) -> str:
        return f"obs({self.literal})."


@dataclass(frozen=True)
class Intervention(Node):
    """`do(term=value)`: the term is set, its random selection does not take place."""

    term: Term
    value: Expression

    def __str__(self) -> str:
        return f"do({self.term}={self.value})."


@dataclass(frozen=True)
class Query(Node):
    """`?{literals} | conditions.` for a probability, `? subject | conditions.` for a distribution.

    Exactly one of `literals` and `subject` is given.
    """

    literals: tuple[Literal, ...] = ()
    subject: Term | None = None
    observations: tuple[Observation, ...] = ()
    interventions: tuple[Intervention, ...] = ()

    def __str__(self) -> str:
        asked = str(self.subject) if self.subject else f"{{{', '.join(map(str, self.literals))}}}"
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
