"""The signature of a program: its sorts and attributes, the sorts of its variables, its random selections."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

from lcorpp.errors import expected_one_of
from lcorpp.reasoning.language.arithmetic import canonical_text, is_integer, iter_variables, split_record
from lcorpp.reasoning.language.issues import Place, SortMismatch, SourceIssue
from lcorpp.reasoning.language.sorts import BOOLEAN, SortDefinition, SortTable
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    BodyLiteral,
    Clause,
    DomainDirective,
    Expression,
    Literal,
    Selection,
    Statement,
    Term,
    syntax_node,
)

_IMPLICIT_VALUES = {"true": "; a alone stands for a=true", "false": "; -a stands for a=false"}

ArgumentSlot = tuple[Expression, str]
"""An expression and the sort required at its position."""


@syntax_node
class Attribute(AttributeDeclaration):
    """A declared attribute.

    values: the values in order of declaration; integers are decimal text.

    Examples:
        >>> from lcorpp import parse_plog
        >>> program = parse_plog("dice = {d1, d2}. sides = {1..6}. roll : dice -> sides. random(roll(D)).")
        >>> program.attributes["roll"]
        <Attribute roll : dice -> sides, 6 values>
    """

    values: tuple[str, ...]

    @property
    def line(self) -> int:
        """The line of the declaration."""
        return self.at.line

    def __repr__(self) -> str:
        return f"<Attribute {str(self)[:-1]}, {len(self.values)} values>"


@dataclass(frozen=True, repr=False)
class Signature:
    """The declarations of a program.

    sorts: sort -> its members in order, as text.
    attributes: name -> attribute.
    domains: variable -> the sort declared by `#domain`.
    selections: attribute -> its random selections, including those of cr-rules.
    records: name and number of arguments of the records in sorts.
    """

    sorts: Mapping[str, Mapping[str, None]]
    attributes: Mapping[str, Attribute]
    domains: Mapping[str, str]
    selections: Mapping[str, tuple[Selection, ...]]
    records: frozenset[tuple[str, int]] = frozenset()
    _common_counts: dict[tuple[str, ...], int] = field(default_factory=dict, init=False, compare=False)

    def __repr__(self) -> str:
        return f"<Signature with {len(self.sorts)} sorts, {len(self.attributes)} attributes>"

    @cached_property
    def max_integer(self) -> int:
        """The largest absolute value of the integers in all sorts, also within records."""
        found = (re.findall(r"\b[0-9]+\b", " ".join(members)) for members in self.sorts.values())
        return max((max(map(int, integers)) for integers in found if integers), default=0)

    @cached_property
    def integer_sorts(self) -> frozenset[str]:
        """The sorts that contain only integers."""
        return frozenset(name for name, members in self.sorts.items() if all(map(is_integer, members)))

    def count_common_members(self, sorts: Iterable[str]) -> int:
        """Return the size of the intersection of some sorts."""
        key = tuple(sorts)
        if len(key) == 1:
            return len(self.sorts[key[0]])
        if key not in self._common_counts:
            members = [self.sorts[name].keys() for name in key]
            self._common_counts[key] = len(set(members[0]).intersection(*members[1:]))
        return self._common_counts[key]

    def resolve_overload(self, literal: Literal) -> Literal:
        """Return the literal with the internal name of its attribute if that is an overload."""
        term = literal.term
        attribute = self.attributes.get(f"{term.name}/{len(term.arguments)}")
        return replace(literal, term=replace(term, name=attribute.name)) if attribute else literal

    def find_attribute(self, term: str) -> Attribute:
        """Return the attribute of a ground term of the program, given as text."""
        name, arguments = split_record(term)
        return self.attributes.get(f"{name}/{len(arguments)}") or self.attributes[name]

    def is_sort(self, literal: Literal) -> bool:
        """Whether the literal is a sort membership `s(X)`; attributes take precedence over sorts."""
        return literal.term.name in self.sorts and literal.term.name not in self.attributes

    def get_attribute(self, term: Term) -> Attribute:
        """Return the attribute of a term.

        Raises:
            SourceIssue: its name is unknown.
            SortMismatch: the term has a wrong number of arguments.
        """
        attribute = self.attributes.get(term.name)
        if attribute is None:
            what = "is a sort, not an attribute" if term.name in self.sorts else "is not declared"
            raise SourceIssue(
                term.at, f"{term.name!r} {what}; {expected_one_of(dict.fromkeys(map(str, self.attributes)))}"
            )
        if len(term.arguments) != len(attribute.arguments):
            shape = f"{term.name}({', '.join(attribute.arguments)})" if attribute.arguments else term.name
            raise SortMismatch(
                term.at,
                f"{term.name} has {len(attribute.arguments)} arguments, not {len(term.arguments)};"
                f" expected {shape}",
            )
        return attribute

    def iter_attribute_slots(self, literal: Literal) -> Iterator[ArgumentSlot]:
        """The slots of a literal: its arguments, and its value unless that is only compared by order.

        Raises:
            SourceIssue, SortMismatch: as `get_attribute`.
        """
        attribute = self.get_attribute(literal.term)
        yield from zip(literal.term.arguments, attribute.arguments, strict=True)
        if literal.relation in ("=", "!="):
            yield literal.value, attribute.range

    def iter_body_slots(self, body: Iterable[BodyLiteral]) -> Iterator[ArgumentSlot]:
        """The slots of a body; a positive sort membership `s(X)` has one."""
        for literal in body:
            if not isinstance(literal, Literal):
                continue
            if not self.is_sort(literal):
                yield from self.iter_attribute_slots(literal)
            elif len(literal.term.arguments) != 1 or (literal.relation, literal.value) != ("=", Term("true")):
                name = literal.term.name
                raise SourceIssue(literal.at, f"{name} is a sort; expected {name}(...) without value")
            elif not literal.negated:
                yield literal.term.arguments[0], literal.term.name

    def iter_slots(self, clause: Clause) -> Iterator[ArgumentSlot]:
        """The slots of a clause without those of a dynamic range, which has its own variables."""
        if clause.head:
            yield from self.iter_attribute_slots(clause.head)
        yield from self.iter_body_slots(clause.body)

    def iter_range_slots(self, selection: Selection) -> Iterator[ArgumentSlot]:
        """The slots of a dynamic range, its variable first."""
        if selection.range:
            yield selection.range.variable, self.attributes[selection.term.name].range
            yield from self.iter_body_slots(selection.range.condition)

    def check_slots(self, slots: Iterable[ArgumentSlot]) -> None:
        """Check that constants in argument slots are members of their sorts; raise SortMismatch if not."""
        for expression, sort in slots:
            if not any(iter_variables(expression)):
                value = canonical_text(expression)
                if value not in self.sorts[sort]:
                    known = expected_one_of(list(self.sorts[sort])) + _IMPLICIT_VALUES.get(value, "")
                    words = f"{value!r} is not a member of the sort {sort}; {known}"
                    raise SortMismatch(expression.at, words)


def build_signature(statements: Sequence[Statement]) -> Signature:
    """Collect the declarations of a program.

    Raises:
        SourceIssue: a declaration is invalid.
    """
    sorts = SortTable()
    places: dict[str, Place] = {}
    for sort in (s for s in statements if isinstance(s, SortDefinition)):
        if sort.name != BOOLEAN:
            _check_new(sort.name, sort.at, places)
            sorts.define(sort)
        elif str(sort) not in ("boolean = {true, false}.", "boolean = {false, true}."):
            raise SourceIssue(  # plog 2.0 requires `boolean = {true, false}`
                sort.at, "the sort boolean is built in as {true, false} and cannot be declared otherwise"
            )
    values = {name: tuple(members) for name, members in sorts.known.items()}  # shared by attributes
    attributes: dict[str, Attribute] = {}
    places = {}
    for declared in (s for s in statements if isinstance(s, AttributeDeclaration)):
        name, arguments, target, at = declared.name, declared.arguments, declared.range, declared.at
        _check_new(name, at, places)
        for sort_name in (*arguments, target):
            _check_sort(sort_name, at, sorts.known)
        attributes[name] = Attribute(name, arguments, target, values[target], at=at)
    domains: dict[str, str] = {}
    for domain in (s for s in statements if isinstance(s, DomainDirective)):
        _check_sort(domain.sort, domain.at, sorts.known)
        for variable in domain.variables:
            if domains.setdefault(variable, domain.sort) != domain.sort:
                raise SourceIssue(domain.at, f"variable {variable} already has the sort {domains[variable]}")
    selections: dict[str, tuple[Selection, ...]] = {}
    for selection in (s for s in statements if isinstance(s, Selection)):
        selections[selection.term.name] = (*selections.get(selection.term.name, ()), selection)
    return Signature(
        MappingProxyType({name: MappingProxyType(members) for name, members in sorts.known.items()}),
        MappingProxyType(attributes),
        MappingProxyType(domains),
        MappingProxyType(selections),
        frozenset(sorts.records),
    )


def _check_new(name: str, at: Place, places: dict[str, Place]) -> None:
    if name == BOOLEAN:
        raise SourceIssue(at, "the sort boolean is built in; an attribute cannot have its name")
    if name in places:
        raise SourceIssue(at, f"{name} is declared twice; first at {places[name]}")
    places[name] = at


def _check_sort(name: str, at: Place, sorts: Iterable[str]) -> None:
    if name not in sorts:
        raise SourceIssue(at, f"unknown sort {name!r}; {expected_one_of(list(sorts))}")


def check_record_names(signature: Signature) -> None:
    """Check that no attribute has the name and the number of arguments of a record.

    Raises:
        SourceIssue: an attribute has. The parser could distinguish the two, a reader could not.

    Source: the manual of plog 2.0, section on errors in attribute declarations.
    """
    for attribute in signature.attributes.values():
        if (str(attribute.name), len(attribute.arguments)) in signature.records:
            raise SourceIssue(
                attribute.at,
                f"{attribute.name} is an attribute and, with as many arguments, a record in a sort;"
                " expected different names",
            )
