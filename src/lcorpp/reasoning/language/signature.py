"""What a program declares, its sorts and attributes, and which sort each place of a statement asks for."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from lcorpp.reasoning.language.arithmetic import iter_variables
from lcorpp.reasoning.language.syntax import (
    Comparison,
    CrRule,
    Expression,
    Literal,
    Probability,
    Rule,
    Selection,
    Statement,
    Term,
)

BOOLEAN = "boolean"
"""The sort that every program has, with the values true and false."""

Slot = tuple[Expression, str]
"""An expression and the sort that its place asks for."""


@dataclass(frozen=True)
class Attribute:
    """A declared attribute.

    arguments: the names of the sorts of its arguments.
    range: the name of the sort of its values.
    values: its range, in the order of declaration, integers as decimal text.
    line: where it was declared.
    """

    name: str
    arguments: tuple[str, ...]
    range: str
    values: tuple[str, ...]
    line: int


@dataclass(frozen=True)
class Signature:
    """The declarations of a program.

    sorts: the members of each sort in order, as text.
    attributes: by name.
    domains: the sort of each variable that `#domain` declares.
    largest: no integer in a member of a sort has a larger absolute value.
    integer_sorts: the sorts whose members are all integers.
    selections: attribute -> its random selections, those of cr-rules included.
    """

    sorts: Mapping[str, Mapping[str, None]]
    attributes: Mapping[str, Attribute]
    domains: Mapping[str, str]
    largest: int
    integer_sorts: frozenset[str] = frozenset()
    selections: Mapping[str, tuple[Selection, ...]] = field(default_factory=dict)
    _shared: dict[tuple[str, ...], int] = field(default_factory=dict, init=False, compare=False, repr=False)

    def shared(self, names: Iterable[str]) -> int:
        """How many members some sorts have in common."""
        key = tuple(names)
        if len(key) == 1:
            return len(self.sorts[key[0]])
        if key not in self._shared:
            members = [self.sorts[name].keys() for name in key]
            self._shared[key] = len(set(members[0]).intersection(*members[1:]))
        return self._shared[key]

    def named(self, term: Term) -> Term:
        """The term under the name of its attribute: `pair(a,b)` may be `pair_2(a,b)` beside `pair(a)`."""
        count = len(term.arguments)
        attribute = self.attributes.get(term.name)
        other = self.attributes.get(mangle_name(term.name, count))
        if attribute is None or len(attribute.arguments) == count or other is None:
            return term
        return Term(other.name, term.arguments, at=term.at) if len(other.arguments) == count else term

    def term_slots(self, term: Term) -> Iterator[Slot]:
        """The arguments of an attribute with their sorts."""
        return zip(term.arguments, self.attributes[term.name].arguments, strict=True)

    def literal_slots(self, literal: Literal) -> Iterator[Slot]:
        """Arguments and value of a literal with their sorts; a value that is only ordered needs none."""
        if self.is_sort(literal):
            return
        yield from self.term_slots(literal.term)
        if literal.relation in ("=", "!="):
            yield literal.value, self.attributes[literal.term.name].range

    def is_sort(self, literal: Literal) -> bool:
        """Whether the literal `s(X)` says that X is a member of the sort s, and s is no attribute as well."""
        return literal.term.name in self.sorts and literal.term.name not in self.attributes

    def slots(self, statement: Rule | Selection | Probability) -> Iterator[Slot]:
        """All slots of a statement but those of a dynamic range, which has its own variables."""
        if isinstance(statement, Rule):
            if statement.head:
                yield from self.literal_slots(statement.head)
            yield from self.body_slots(statement.body)
        else:
            yield from self.term_slots(statement.term)
            if isinstance(statement, Probability):
                yield statement.value, self.attributes[statement.term.name].range
            yield from self.body_slots(get_body(statement))

    def range_slots(self, selection: Selection) -> Iterator[Slot]:
        """The slots of a selection's dynamic range, its variable first."""
        if selection.range:
            yield selection.range.variable, self.attributes[selection.term.name].range
            yield from self.body_slots(selection.range.condition)

    def body_slots(self, body: Iterable[Literal | Comparison]) -> Iterator[Slot]:
        """The slots of the literals of a body; `s(X)` gives one if it is not negated."""
        for literal in body:
            if isinstance(literal, Literal):
                yield from self.literal_slots(literal)
                if self.is_sort(literal) and not literal.negated:
                    yield literal.term.arguments[0], literal.term.name


def mangle_name(name: str, count: int) -> str:
    """The name of an attribute that shares its own with one that has fewer arguments."""
    return f"{name}_{count}"


def as_selection(statement: Statement) -> Selection | None:
    """The random selection that a statement is, perhaps as a cr-rule."""
    if isinstance(statement, CrRule):
        statement = statement.statement
    return statement if isinstance(statement, Selection) else None


def get_body(statement: Rule | Selection | Probability) -> tuple[Literal | Comparison, ...]:
    """The conditions under which a statement speaks."""
    return statement.condition if isinstance(statement, Probability) else statement.body


def iter_expressions(body: Iterable[Literal | Comparison]) -> Iterator[Expression]:
    """Every expression of a body, terms of attributes included."""
    for literal in body:
        if isinstance(literal, Literal):
            yield from (*literal.term.arguments, literal.value)
        else:
            yield from (literal.left, literal.right)


def list_expressions(statement: Rule | Selection | Probability) -> list[Expression]:
    """Every expression of a statement outside of a dynamic range."""
    found: list[Expression] = []
    if isinstance(statement, Rule):
        found.extend(iter_expressions((statement.head,) if statement.head else ()))
    else:
        found.extend((*statement.term.arguments, *(statement.label.arguments if statement.label else ())))
        if isinstance(statement, Probability):
            found.extend((statement.value, statement.number))
    found.extend(iter_expressions(get_body(statement)))
    return found


def list_pr_variables(atom: Probability) -> list[str]:
    """The variables of a pr-atom in the order in which an instance of it lists their values."""
    return sorted(
        {variable.name for expression in list_expressions(atom) for variable in iter_variables(expression)}
    )
