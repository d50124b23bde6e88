"""Syntax tree of P-log: expressions, literals and statements; sort expressions are in `sorts`.

Nodes are frozen. Each has a place, which equality ignores, and prints as text that parses to an equal node.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from decimal import Decimal
from fractions import Fraction
from typing import Any, Literal as OneOf, TypeVar, dataclass_transform, get_args

from lcorpp.reasoning.language.issues import SYNTHETIC_PLACE, Place
from lcorpp.reasoning.quoting import write_name

Semantics = OneOf["2009", "2018"]
"""Semantics of `do` and Condition 1: TPLP 9(1), 2009, or P-log 2, 2018."""

SEMANTICS: tuple[str, ...] = get_args(Semantics)

_Node = TypeVar("_Node")

SHOWN_CHARACTERS = 120
"""`repr` of a node shows at most this many characters of its text."""


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def syntax_node(kind: type[_Node]) -> type[_Node]:
    """Make a class a dataclass that is frozen for the type checker and inherits equality.

    The methods that `dataclass` generates for these take half of the time to import the reasoner.
    """
    return dataclass(eq=False, repr=False)(kind)


@syntax_node
class SyntaxNode:
    """Base class of nodes.

    at: the place where the node begins.
    """

    at: Place = field(default=SYNTHETIC_PLACE, compare=False, kw_only=True)

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self._list_values() == other._list_values()

    def __hash__(self) -> int:
        return hash(self._list_values())

    def _list_values(self) -> tuple[Any, ...]:
        return tuple([getattr(self, field.name) for field in fields(self) if field.compare])

    def __repr__(self) -> str:
        text = str(self)
        if len(text) > SHOWN_CHARACTERS:
            text = f"{text[:SHOWN_CHARACTERS]}..."
        return f"<{type(self).__name__} {text}>"


@syntax_node
class Number(SyntaxNode):
    """A number. Only the number of a pr-atom may be a fraction."""

    value: Fraction

    def __str__(self) -> str:
        for digits in range(self.value.denominator.bit_length()):
            shifted = self.value * 10**digits
            if shifted.denominator == 1:  # a finite decimal
                return f"{Decimal(f'{shifted.numerator}E-{digits}'):f}"
        return str(self.value)


@syntax_node
class Variable(SyntaxNode):
    """A variable, an identifier with a capital first letter."""

    name: str

    def __str__(self) -> str:
        return self.name


@syntax_node
class Term(SyntaxNode):
    """A constant `a`, a record `f(1, a)` or an attribute with its arguments, depending on the context."""

    name: str
    arguments: tuple[Expression, ...] = ()

    def __str__(self) -> str:
        name = write_name(str(self.name))
        return f"{name}({','.join(map(str, self.arguments))})" if self.arguments else name

    def as_literal(self) -> Literal:
        """A literal without a value of its own: an order, whose right side is not bound to the range."""
        return Literal(self, "<", self, at=self.at)


@syntax_node
class Operation(SyntaxNode):
    """`left operator right`, an operation on numbers or, in `sorts`, on sorts and conditions."""

    operator: str
    left: SyntaxNode
    right: SyntaxNode

    def __str__(self) -> str:
        space = "" if self.operator in "+-*/" else " "
        return f"{_format_operand(self.left)}{space}{self.operator}{space}{_format_operand(self.right)}"


@syntax_node
class Arithmetic(Operation):
    """An operation on numbers with one of ``+ - * / mod``.

    Division is exact in the number of a pr-atom, elsewhere the integer division of ASP.
    """

    left: Expression
    right: Expression


Expression = Number | Variable | Term | Arithmetic


def _format_operand(operand: SyntaxNode) -> str:
    text = str(operand)
    return f"({text})" if isinstance(operand, Operation) or text.startswith("-") else text


@syntax_node
class Literal(SyntaxNode):
    """`term relation value`, or its default negation. `p` is `p=true`, `-p` is `p=false`."""

    term: Term
    relation: str
    value: Expression
    negated: bool = False

    def __str__(self) -> str:
        return f"{'not ' if self.negated else ''}{self.term}{self.relation}{self.value}"


@syntax_node
class ComparisonLiteral(SyntaxNode):
    """`left relation right` between expressions without attributes."""

    left: Expression
    relation: str
    right: Expression

    def __str__(self) -> str:
        return f"{self.left}{self.relation}{self.right}"


BodyLiteral = Literal | ComparisonLiteral


class Statement(SyntaxNode):
    """A statement of a program: one of the classes below, or a `sorts.SortDefinition`."""


Body = tuple[BodyLiteral, ...]


@syntax_node
class AttributeDeclaration(Statement):
    """`name : arguments -> range.`"""

    name: str
    arguments: tuple[str, ...]
    range: str

    def __str__(self) -> str:
        arguments = f"{', '.join(self.arguments)} -> " if self.arguments else ""
        return f"{write_name(str(self.name))} : {arguments}{self.range}."


@syntax_node
class DomainDirective(Statement):
    """`#domain sort(X;Y).`: the sort of these variables in the whole program."""

    sort: str
    variables: tuple[str, ...]

    def __str__(self) -> str:
        return f"#domain {self.sort}({';'.join(self.variables)})."


@syntax_node
class DynamicRange(SyntaxNode):
    """`{variable : condition}`: the possible values of a selection, which depend on the world."""

    variable: Variable
    condition: Body

    def __str__(self) -> str:
        return f"{{{self.variable} : {', '.join(map(str, self.condition))}}}"


@syntax_node
class Rule(Statement):
    """`head :- body.` A rule without body is a fact, one without head a constraint.

    is_cr_rule: whether the rule is consistency-restoring, `[label] head +- body.`: applied only if no
        possible world exists.
    """

    head: Literal | None
    body: Body = ()
    label: Term | None = None
    is_cr_rule: bool = False

    def __str__(self) -> str:
        return _format_clause(self, str(self.head or ""))


@syntax_node
class Selection(Statement):
    """`[label] random(term : range) :- body.`, or with `+-`, see `Rule.is_cr_rule`."""

    term: Term
    range: DynamicRange | None = None
    body: Body = ()
    label: Term | None = None
    is_cr_rule: bool = False

    @property
    def head(self) -> Literal:
        """The selected term, without a value."""
        return self.term.as_literal()

    def __str__(self) -> str:
        return _format_clause(self, f"random({self.term}{f' : {self.range}' if self.range else ''})")


@syntax_node
class Probability(Statement):
    """`[label] pr(term=value | body) = number.` A number without variables is evaluated."""

    term: Term
    value: Expression
    number: Expression
    body: Body = ()
    label: Term | None = None

    @property
    def head(self) -> Literal:
        """`term=value`."""
        return Literal(self.term, "=", self.value, at=self.at)

    @property
    def left_side(self) -> str:
        """`[label] pr(term=value | body)`."""
        condition = f" | {', '.join(map(str, self.body))}" if self.body else ""
        return f"{_format_label(self.label)}pr({self.head}{condition})"

    def __str__(self) -> str:
        number = self.number.value if isinstance(self.number, Number) else self.number
        return f"{self.left_side} = {number}."


Clause = Rule | Selection | Probability
"""A statement with variables, an abbreviation of its ground instances."""


def _format_label(label: Term | None) -> str:
    return f"[{label}] " if label else ""


def _format_clause(clause: Rule | Selection, head: str) -> str:
    arrow = "+-" if clause.is_cr_rule else ":-" if clause.body else ""
    text = f"{_format_label(clause.label)}{head} {arrow} {', '.join(map(str, clause.body))}"
    return f"{text.strip()}."


Formula = tuple[tuple[Literal, ...], ...]
"""A disjunction of conjunctions of literals."""


@syntax_node
class Observation(Statement):
    """`obs(formula)`: excludes the worlds in which the formula is false."""

    formula: Formula

    def __str__(self) -> str:
        return f"obs({' or '.join([' and '.join(map(str, case)) for case in self.formula])})."


@syntax_node
class Intervention(Statement):
    """`do(term=value)`: an intervention that replaces the random selection of the term."""

    term: Term
    value: Expression

    def __str__(self) -> str:
        return f"do({self.term}={self.value})."


@syntax_node
class Query(Statement):
    """`?{formula} | conditions.` for a probability, `?subjects | conditions.` for their distribution, or
    `?E[expression] | conditions.` for an expectation; the subjects are the variables of the expression.

    written: the query in the language of the program that was translated, "" for P-log.
    """

    formula: Formula = ()
    subjects: tuple[Term, ...] = ()
    expression: Expression | None = None
    observations: tuple[Observation, ...] = ()
    interventions: tuple[Intervention, ...] = ()
    written: str = field(default="", compare=False)

    def __str__(self) -> str:
        asked = f"E[{self.expression}]" if self.expression else ", ".join(map(str, self.subjects))
        if not self.subjects:
            asked = f"{{{' or '.join([', '.join(map(str, case)) for case in self.formula])}}}"
        return f"?{asked}{' | ' if self.conditions else ''}{', '.join(self.conditions)}."

    @property
    def conditions(self) -> list[str]:
        """The observations and interventions as text."""
        return [str(condition)[:-1] for condition in (*self.observations, *self.interventions)]
