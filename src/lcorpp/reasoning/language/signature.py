"""The signature of a program: its sorts and attributes, the sorts of its variables, its random selections."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

from lcorpp.errors import expected_one_of
from lcorpp.reasoning.language.arithmetic import is_integer
from lcorpp.reasoning.language.issues import Place, SourceIssue
from lcorpp.reasoning.language.sorts import BOOLEAN, SortDefinition, SortTable, find_record_shapes
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
)
from lcorpp.reasoning.language.traversal import as_selection, get_body, get_head

ArgumentSlot = tuple[Expression, str]
"""An expression and the sort required at its position."""


@dataclass(frozen=True, repr=False)
class Attribute:
    """A declared attribute.

    arguments: the sort names of its arguments.
    range: the sort name of its values.
    values: the values in order of declaration; integers are decimal text.
    line: the line of the declaration.
    """

    name: str
    arguments: tuple[str, ...]
    range: str
    values: tuple[str, ...]
    line: int

    def __repr__(self) -> str:
        arguments = f"{', '.join(self.arguments)} -> " if self.arguments else ""
        return f"<Attribute {self.name} : {arguments}{self.range}, {len(self.values)} values>"


@dataclass(frozen=True, repr=False)
class Signature:
    """The declarations of a program.

    sorts: sort -> its members in order, as text.
    attributes: name -> attribute.
    domains: variable -> the sort declared by `#domain`.
    selections: attribute -> its random selections, including those of cr-rules.
    """

    sorts: Mapping[str, Mapping[str, None]]
    attributes: Mapping[str, Attribute]
    domains: Mapping[str, str]
    selections: Mapping[str, tuple[Selection, ...]] = field(default_factory=dict)
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
        """Return the literal with the mangled name (`mangle_name`) of its attribute if that is overloaded."""
        term, count = literal.term, len(literal.term.arguments)
        attribute = self.attributes.get(term.name)
        other = self.attributes.get(mangle_name(term.name, count))
        if attribute is None or other is None:
            return literal
        if len(attribute.arguments) == count or len(other.arguments) != count:
            return literal
        return replace(literal, term=replace(term, name=other.name))

    def is_sort(self, literal: Literal) -> bool:
        """Whether the literal is a sort membership `s(X)`; attributes take precedence over sorts."""
        return literal.term.name in self.sorts and literal.term.name not in self.attributes

    def iter_term_slots(self, term: Term) -> Iterator[ArgumentSlot]:
        """The argument slots of an attribute term."""
        return zip(term.arguments, self.attributes[term.name].arguments, strict=True)

    def iter_literal_slots(self, literal: Literal) -> Iterator[ArgumentSlot]:
        """The argument slots of a literal: arguments, and the value unless it is only compared by order.

        A positive sort membership `s(X)` has one slot, a negated one none.
        """
        if not self.is_sort(literal):
            yield from self.iter_term_slots(literal.term)
            if literal.relation in ("=", "!="):
                yield literal.value, self.attributes[literal.term.name].range
        elif not literal.negated:
            yield literal.term.arguments[0], literal.term.name

    def iter_body_slots(self, body: Iterable[BodyLiteral]) -> Iterator[ArgumentSlot]:
        """The argument slots of a body."""
        for literal in body:
            if isinstance(literal, Literal):
                yield from self.iter_literal_slots(literal)

    def iter_slots(self, clause: Clause) -> Iterator[ArgumentSlot]:
        """The argument slots of a clause without those of a dynamic range, which has its own variables."""
        head = get_head(clause)
        return self.iter_body_slots((head, *get_body(clause)) if head else get_body(clause))

    def iter_range_slots(self, selection: Selection) -> Iterator[ArgumentSlot]:
        """The argument slots of a dynamic range, its variable first."""
        if selection.range:
            yield selection.range.variable, self.attributes[selection.term.name].range
            yield from self.iter_body_slots(selection.range.condition)


def mangle_name(name: str, count: int) -> str:
    """Return the internal name of an overload: `pair(a,b)` is `pair_2(a,b)` if `pair(a)` exists, too."""
    return f"{name}_{count}"


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
    attributes = _collect_attributes(statements, sorts.known)
    domains: dict[str, str] = {}
    for domain in (s for s in statements if isinstance(s, DomainDirective)):
        _check_sort(domain.sort, domain.at, sorts.known)
        for variable in domain.variables:
            if domains.setdefault(variable, domain.sort) != domain.sort:
                raise SourceIssue(domain.at, f"variable {variable} already has the sort {domains[variable]}")
    selections: dict[str, tuple[Selection, ...]] = {}
    for selection in filter(None, map(as_selection, statements)):
        selections[selection.term.name] = (*selections.get(selection.term.name, ()), selection)
    return Signature(
        MappingProxyType({name: MappingProxyType(members) for name, members in sorts.known.items()}),
        MappingProxyType(attributes),
        MappingProxyType(domains),
        MappingProxyType(selections),
    )


def _collect_attributes(
    statements: Sequence[Statement], sorts: Mapping[str, Mapping[str, None]]
) -> dict[str, Attribute]:
    values = {name: tuple(members) for name, members in sorts.items()}  # shared by the attributes of a sort
    attributes: dict[str, Attribute] = {}
    places: dict[str, Place] = {}
    for declared in (s for s in statements if isinstance(s, AttributeDeclaration)):
        _check_new(declared.name, declared.at, places)
        for name in (*declared.arguments, declared.range):
            _check_sort(name, declared.at, sorts)
        attributes[declared.name] = Attribute(
            declared.name, declared.arguments, declared.range, values[declared.range], declared.at.line
        )
    return attributes


def _check_new(name: str, at: Place, places: dict[str, Place]) -> None:
    if name == BOOLEAN:
        raise SourceIssue(at, "the sort boolean is built in; an attribute cannot have its name")
    if name in places:
        raise SourceIssue(at, f"{name} is declared twice; first at {places[name]}")
    places[name] = at


def _check_sort(name: str, at: Place, sorts: Iterable[str]) -> None:
    if name not in sorts:
        raise SourceIssue(at, f"unknown sort {name!r}; {expected_one_of(list(sorts))}")


def check_record_names(statements: Sequence[Statement]) -> None:
    """Check that no attribute has the name and the number of arguments of a record.

    Raises:
        SourceIssue: an attribute has. The parser could distinguish the two, a reader could not.

    Source: the manual of plog 2.0, section on errors in attribute declarations.
    """
    records = set().union(*(find_record_shapes(s.sort) for s in statements if isinstance(s, SortDefinition)))
    for declared in (s for s in statements if isinstance(s, AttributeDeclaration)):
        if (declared.name, len(declared.arguments)) in records:
            raise SourceIssue(
                declared.at,
                f"{declared.name} is an attribute and, with as many arguments, a record in a sort;"
                " expected different names",
            )
