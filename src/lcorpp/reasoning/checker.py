"""What can be known to be wrong with a program before a world is made: names, arities, sorts, safety, sizes.

Variables and arithmetic are left to `safety`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from types import MappingProxyType

from lcorpp.errors import expected
from lcorpp.reasoning.arithmetic import ground, variables
from lcorpp.reasoning.offence import Offence
from lcorpp.reasoning.safety import check_order, check_scope, check_slots
from lcorpp.reasoning.signature import BOOLEAN, Attribute, Signature, expressions, scope
from lcorpp.reasoning.syntax import (
    AttributeDeclaration,
    Comparison,
    Domain,
    Interval,
    Intervention,
    Literal,
    Number,
    Observation,
    Place,
    Probability,
    Query,
    Rule,
    Selection,
    SortDefinition,
    Statement,
    Term,
)

LARGEST_SORT = 100_000
"""How many members a sort may have."""

_INTEGER = re.compile(r"\b[0-9]+\b")


def check(statements: Sequence[Statement]) -> Signature:
    """Check a whole program.

    Returns:
        What it declares.

    Raises:
        Offence: the first thing that is wrong.
    """
    signature = _declarations(statements)
    labels: dict[str, Selection] = {}
    for statement in statements:
        if isinstance(statement, Selection):
            label = str(statement.label)
            if statement.label and label in labels:
                raise Offence(statement.at, f"label [{label}] is taken at {labels[label].at}")
            labels[label] = statement
            _check_selection(statement, signature)
    for statement in statements:
        if isinstance(statement, Rule):
            if statement.head:
                _check_attribute(statement.head.term, signature)
            _check_body(statement.body, signature)
            check_scope(
                statement.at, scope(statement), list(signature.slots(statement)), statement.body, signature
            )
        elif isinstance(statement, Probability):
            _check_probability(statement, statements, signature)
        elif isinstance(statement, Query):
            check_query(statement, statements, signature)
        elif isinstance(statement, Observation):
            _check_ground(statement.literal, signature)
        elif isinstance(statement, Intervention):
            _check_intervention(statement, statements, signature)
    return signature


def check_query(query: Query, statements: Sequence[Statement], signature: Signature) -> None:
    """Check a query against a program.

    Raises:
        Offence: the first thing that is wrong with it.
    """
    if query.subject:
        _check_term(query.subject, signature)
    for literal in (*query.literals, *(observation.literal for observation in query.observations)):
        _check_ground(literal, signature)
    for intervention in query.interventions:
        _check_intervention(intervention, statements, signature)


# declarations


def _declarations(statements: Sequence[Statement]) -> Signature:
    sorts: dict[str, dict[str, None]] = {BOOLEAN: {"true": None, "false": None}}
    places: dict[str, Place] = {}
    for sort in (s for s in statements if isinstance(s, SortDefinition)):
        _claim(sort.name, sort.at, places)
        sorts[sort.name] = _members(sort)
    attributes: dict[str, Attribute] = {}
    for declared in (s for s in statements if isinstance(s, AttributeDeclaration)):
        _claim(declared.name, declared.at, places)
        for name in (*declared.arguments, declared.range):
            _known_sort(name, declared.at, sorts)
        values = tuple(sorts[declared.range])
        attributes[declared.name] = Attribute(
            declared.name, declared.arguments, declared.range, values, declared.at.line
        )
    domains: dict[str, str] = {}
    for domain in (s for s in statements if isinstance(s, Domain)):
        _known_sort(domain.sort, domain.at, sorts)
        for variable in domain.variables:
            if domains.setdefault(variable, domain.sort) != domain.sort:
                raise Offence(domain.at, f"variable {variable} already has the sort {domains[variable]}")
    read_only = {name: MappingProxyType(members) for name, members in sorts.items()}
    largest = max(
        (int(n) for members in sorts.values() for m in members for n in _INTEGER.findall(m)), default=0
    )
    return Signature(
        MappingProxyType(read_only), MappingProxyType(attributes), MappingProxyType(domains), largest
    )


def _claim(name: str, at: Place, places: dict[str, Place]) -> None:
    if name == BOOLEAN:
        raise Offence(at, "the sort boolean is built in and cannot be declared")
    if name in places:
        raise Offence(at, f"{name} is declared twice; first at {places[name]}")
    places[name] = at


def _known_sort(name: str, at: Place, sorts: Iterable[str]) -> None:
    if name not in sorts:
        raise Offence(at, f"unknown sort {name!r}; {expected(list(sorts))}")


def _members(sort: SortDefinition) -> dict[str, None]:
    members: dict[str, None] = {}
    for element in sort.elements:
        if isinstance(element, Interval):
            if element.high < element.low:
                raise Offence(element.at, f"the interval {element} is empty")
            if element.high - element.low >= LARGEST_SORT:
                raise Offence(
                    element.at,
                    f"the interval {element} is too long; a sort has at most {LARGEST_SORT} members",
                )
            found: Iterable[str] = map(str, range(element.low, element.high + 1))
        else:
            found = (ground(element),)
        for member in found:
            if member in members:
                raise Offence(element.at, f"{member} is twice in the sort {sort.name}")
            members[member] = None
        if len(members) > LARGEST_SORT:
            raise Offence(sort.at, f"the sort {sort.name} is too large; at most {LARGEST_SORT} members")
    return members


# terms and literals


def _check_attribute(term: Term, signature: Signature) -> None:
    attribute = signature.attributes.get(term.name)
    if attribute is None:
        what = "is a sort, not an attribute" if term.name in signature.sorts else "is not declared"
        raise Offence(term.at, f"{term.name!r} {what}; {expected(list(signature.attributes))}")
    if len(term.arguments) != len(attribute.arguments):
        shape = f"{term.name}({', '.join(attribute.arguments)})" if attribute.arguments else term.name
        raise Offence(
            term.at,
            f"{term.name} has {len(attribute.arguments)} arguments, not {len(term.arguments)};"
            f" expected {shape}",
        )


def _check_body(body: Iterable[Literal | Comparison], signature: Signature) -> None:
    for literal in body:
        if not isinstance(literal, Literal):
            continue
        if not signature.is_sort(literal):
            _check_attribute(literal.term, signature)
        elif len(literal.term.arguments) != 1 or (literal.relation, literal.value) != ("=", Term("true")):
            raise Offence(
                literal.at, f"{literal.term.name} is a sort; expected {literal.term.name}(...) without value"
            )


def _check_term(term: Term, signature: Signature) -> None:
    _check_attribute(term, signature)
    for argument in term.arguments:
        ground(argument)
    check_slots(signature.term_slots(term), signature)


def _check_ground(literal: Literal, signature: Signature) -> None:
    _check_term(literal.term, signature)
    ground(literal.value)
    check_slots(signature.literal_slots(literal), signature)
    check_order((literal,), {}, signature)


def _check_intervention(
    intervention: Intervention, statements: Sequence[Statement], signature: Signature
) -> None:
    _check_ground(Literal(intervention.term, "=", intervention.value, at=intervention.at), signature)
    _check_random(intervention.term, intervention.at, statements)


def _check_random(term: Term, at: Place, statements: Sequence[Statement]) -> list[Selection]:
    selections = [s for s in statements if isinstance(s, Selection) and s.term.name == term.name]
    if not selections:
        raise Offence(at, f"{term.name} has no random selection; expected 'random({term}).' in the program")
    return selections


# statements


def _check_selection(selection: Selection, signature: Signature) -> None:
    _check_attribute(selection.term, signature)
    _check_body(selection.body, signature)
    outer = scope(selection)
    outcomes = len(signature.attributes[selection.term.name].values)
    slots = list(signature.slots(selection))
    check_scope(selection.at, outer, slots, selection.body, signature, outcomes=outcomes)
    if selection.range:
        chosen, condition = selection.range.variable, selection.range.condition
        if any(variable == chosen for expression in outer for variable in variables(expression)):
            raise Offence(chosen.at, f"variable {chosen} of the dynamic range is also used outside of it")
        _check_body(condition, signature)
        slots = [*slots, *signature.range_slots(selection)]
        inner = [*outer, chosen, *expressions(condition)]
        check_scope(selection.at, inner, slots, (*selection.body, *condition), signature)


def _check_probability(statement: Probability, statements: Sequence[Statement], signature: Signature) -> None:
    _check_attribute(statement.term, signature)
    _check_body(statement.condition, signature)
    selections = _check_random(statement.term, statement.at, statements)
    if statement.label:
        label = statement.label
        named = [s.label for s in selections if s.label]
        if not any(other.name == label.name for other in named):
            raise Offence(
                label.at,
                f"no random selection of {statement.term.name} has the label [{label}];"
                f" {expected(list(map(str, named)))}",
            )
        sizes = {len(other.arguments) for other in named if other.name == label.name}
        if label.arguments and len(label.arguments) not in sizes:
            raise Offence(
                label.at,
                f"label [{label}] has {len(label.arguments)} arguments, the selection's has {min(sizes)}",
            )
    if isinstance(statement.number, Number) and not 0 <= statement.number.value <= 1:
        raise Offence(statement.number.at, f"the probability {statement.number.value} is not between 0 and 1")
    check_scope(
        statement.at,
        scope(statement),
        list(signature.slots(statement)),
        statement.condition,
        signature,
        statement.number,
    )
