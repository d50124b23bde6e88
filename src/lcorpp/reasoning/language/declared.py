"""What a program declares: its sorts and attributes, the sorts of its variables, its random selections."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from types import MappingProxyType

from lcorpp.errors import expected_one_of
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.signature import BOOLEAN, Attribute, Signature, as_selection
from lcorpp.reasoning.language.sorts import BOOLEANS, Sorts, records_of
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    DomainDirective,
    Place,
    Selection,
    SortDefinition,
    Statement,
)


def build_signature(statements: Sequence[Statement]) -> Signature:
    """What a program declares.

    Raises:
        SourceIssue: a declaration is wrong.
    """
    sorts = Sorts()
    sorts.known[BOOLEAN] = BOOLEANS
    places: dict[str, Place] = {}
    for sort in (s for s in statements if isinstance(s, SortDefinition)):
        if sort.name == BOOLEAN:
            _check_boolean(sort)
            continue
        _claim(sort.name, sort.at, places)
        sorts.define(sort)
    values: dict[str, tuple[str, ...]] = {}
    attributes: dict[str, Attribute] = {}
    named: dict[str, Place] = {}
    for declared in (s for s in statements if isinstance(s, AttributeDeclaration)):
        _claim(declared.name, declared.at, named)
        for name in (*declared.arguments, declared.range):
            _known_sort(name, declared.at, sorts.known)
        if declared.range not in values:
            values[declared.range] = tuple(sorts.known[declared.range].members)
        attributes[declared.name] = Attribute(
            declared.name, declared.arguments, declared.range, values[declared.range], declared.at.line
        )
    domains: dict[str, str] = {}
    for domain in (s for s in statements if isinstance(s, DomainDirective)):
        _known_sort(domain.sort, domain.at, sorts.known)
        for variable in domain.variables:
            if domains.setdefault(variable, domain.sort) != domain.sort:
                raise SourceIssue(domain.at, f"variable {variable} already has the sort {domains[variable]}")
    selections: dict[str, tuple[Selection, ...]] = {}
    for selection in filter(None, map(as_selection, statements)):
        selections[selection.term.name] = (*selections.get(selection.term.name, ()), selection)
    return Signature(
        MappingProxyType({name: MappingProxyType(s.members) for name, s in sorts.known.items()}),
        MappingProxyType(attributes),
        MappingProxyType(domains),
        max(sort.largest for sort in sorts.known.values()),
        frozenset(name for name, sort in sorts.known.items() if sort.integers),
        MappingProxyType(selections),
    )


def _check_boolean(sort: SortDefinition) -> None:
    """The built-in sort may be declared as what it is: plog 2.0 asks for it."""
    if sort.is_algebra or {str(element) for element in sort.elements} != {"true", "false"}:
        raise SourceIssue(
            sort.at, "the sort boolean is built in as {true, false} and cannot be declared otherwise"
        )


def _claim(name: str, at: Place, places: dict[str, Place]) -> None:
    if name == BOOLEAN:
        raise SourceIssue(at, "the sort boolean is built in; an attribute cannot have its name")
    if name in places:
        raise SourceIssue(at, f"{name} is declared twice; first at {places[name]}")
    places[name] = at


def _known_sort(name: str, at: Place, sorts: Iterable[str]) -> None:
    if name not in sorts:
        raise SourceIssue(at, f"unknown sort {name!r}; {expected_one_of(list(sorts))}")


def check_record_names(statements: Sequence[Statement]) -> None:
    """Check that no attribute has the name and the number of arguments of a record.

    Raises:
        SourceIssue: one has; where it stands would still tell them apart, but not to a reader.

    Source: the manual of plog 2.0, section on errors in attribute declarations.
    """
    records: set[tuple[str, int]] = set()
    for sort in (s for s in statements if isinstance(s, SortDefinition)):
        records.update(records_of(sort.elements))
    for declared in (s for s in statements if isinstance(s, AttributeDeclaration)):
        if (declared.name, len(declared.arguments)) in records:
            raise SourceIssue(
                declared.at,
                f"{declared.name} is an attribute and, with as many arguments, a record in a sort;"
                " expected different names",
            )
