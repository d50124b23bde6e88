"""Attributes that plog 1.0 leaves undeclared, known there by how they are used.

A program for plog 1.0 gives its variables their sorts by `#domain`. It need not declare an attribute, nor the
sorts of arguments (`place : location.` and then `place(B)`), and one name may stand for attributes with
different numbers of arguments. Here the missing declarations are written out, and all but the attribute with
the fewest arguments get a name of their own. A name that no head has is left alone, to be refused.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from lcorpp.reasoning.language.arithmetic import canonical_text, iter_variables
from lcorpp.reasoning.language.rewriting import iter_literals, map_literals
from lcorpp.reasoning.language.signature import BOOLEAN, mangle_name
from lcorpp.reasoning.language.sorts import BOOLEANS, Sorts
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    DomainDirective,
    Expression,
    Literal,
    Place,
    SortDefinition,
    SortExpression,
    SortName,
    SortOperation,
    SortSet,
    Statement,
    Term,
    Variable,
)


@dataclass
class _Slot:
    """What stands in one place of an attribute: variables of these sorts, and these constants."""

    sorts: dict[str, None] = field(default_factory=dict)
    constants: dict[str, Expression] = field(default_factory=dict)

    def note(self, found: Expression, known: dict[str, str], sorts: Sorts) -> None:
        if isinstance(found, Variable):
            if known.get(found.name) in sorts.known:
                self.sorts[known[found.name]] = None
        elif not any(iter_variables(found)):
            self.constants[canonical_text(found)] = found


@dataclass
class _Use:
    """How an attribute with a certain number of arguments is used; the last slot is its value's."""

    at: Place
    slots: list[_Slot]
    in_head: bool = False


@dataclass
class _Found:
    declared: dict[str, AttributeDeclaration] = field(default_factory=dict)
    domains: dict[str, str] = field(default_factory=dict)
    sorts: Sorts = field(default_factory=Sorts)
    uses: dict[str, dict[int, _Use]] = field(default_factory=dict)


def infer_declarations(statements: Sequence[Statement]) -> Sequence[Statement]:
    """The statements with all attributes declared that their use makes known.

    Raises:
        Offence: the definition of a sort is wrong.
    """
    found = _gathered(statements)
    names: dict[tuple[str, int], str] = {}
    instead: dict[str, list[Statement]] = {}
    added: list[Statement] = []
    for name, uses in found.uses.items():
        made = list(_declarations(name, uses, found, names))
        if name in found.declared and made:
            instead[name] = [s for s in made if isinstance(s, AttributeDeclaration)]
            made = [s for s in made if not isinstance(s, AttributeDeclaration)]
        added.extend(made)
    whole: list[Statement] = []
    for statement in statements:
        if isinstance(statement, AttributeDeclaration) and statement.name in instead:
            whole.extend(instead.pop(statement.name))
        else:
            whole.append(statement)
    if any(name != plain for (plain, _), name in names.items()):
        whole = [map_literals(statement, lambda literal: _renamed(literal, names)) for statement in whole]
    return [*whole, *added]


def _renamed(literal: Literal, names: dict[tuple[str, int], str]) -> Literal:
    term = literal.term
    name = names.get((term.name, len(term.arguments)), term.name)
    return literal if name == term.name else replace(literal, term=Term(name, term.arguments, at=term.at))


def _gathered(statements: Sequence[Statement]) -> _Found:
    found = _Found()
    found.sorts.known[BOOLEAN] = BOOLEANS
    for statement in statements:
        if isinstance(statement, AttributeDeclaration):
            found.declared.setdefault(statement.name, statement)
        elif isinstance(statement, DomainDirective):
            found.domains.update(dict.fromkeys(statement.variables, statement.sort))
        elif isinstance(statement, SortDefinition) and statement.name != BOOLEAN:
            found.sorts.define(statement)
    for statement in statements:
        known = _known_sorts(statement, found)
        for literal, is_head in iter_literals(statement):
            _note(literal, is_head, known, found)
    return found


def _known_sorts(statement: Statement, found: _Found) -> dict[str, str]:
    """The sorts of the variables of a statement: those of `#domain`, and of what is declared in full."""
    known = dict(found.domains)
    for literal, _ in iter_literals(statement):
        attribute = found.declared.get(literal.term.name)
        if literal.term.name in found.sorts.known and len(literal.term.arguments) == 1:
            pairs: list[tuple[Expression, str]] = [(literal.term.arguments[0], literal.term.name)]
        elif attribute is None:
            continue
        else:
            pairs = [(literal.value, attribute.range)] if literal.relation == "=" else []
            if len(attribute.arguments) == len(literal.term.arguments):
                pairs.extend(zip(literal.term.arguments, attribute.arguments, strict=True))
        for expression, sort in pairs:
            if isinstance(expression, Variable):
                known.setdefault(expression.name, sort)
    return known


def _note(literal: Literal, is_head: bool, known: dict[str, str], found: _Found) -> None:
    term = literal.term
    declared = found.declared.get(term.name)
    if term.name in found.sorts.known or term.name == "obs" or (declared and declared.arguments):
        return
    use = found.uses.setdefault(term.name, {}).setdefault(
        len(term.arguments), _Use(term.at, [_Slot() for _ in range(len(term.arguments) + 1)])
    )
    use.in_head |= is_head
    for slot, argument in zip(use.slots, term.arguments, strict=False):
        slot.note(argument, known, found.sorts)
    if literal.value is not term:  # a selected term stands as its own value
        use.slots[-1].note(literal.value, known, found.sorts)


def _declarations(
    name: str, uses: dict[int, _Use], found: _Found, names: dict[tuple[str, int], str]
) -> Iterator[Statement]:
    """The declarations that one name lacks, or none if its use does not tell them."""
    declared = found.declared.get(name)
    if declared is None and not all(use.in_head for use in uses.values()):
        return
    if declared is not None and set(uses) == {0}:
        return
    for count, use in sorted(uses.items()):
        own = name if count == min(uses) else mangle_name(name, count)
        names[name, count] = own
        slots = use.slots[:-1] if declared else use.slots
        sorts: list[str] = []
        for place, slot in enumerate(slots):
            sort = _sort(slot, use.at, found)
            if sort is None:
                return
            if not isinstance(sort, str):
                made = f"{own}_sort_{place + 1}"
                yield SortDefinition(made, sort, at=use.at)
                sort = made
            sorts.append(sort)
        target = declared.range if declared else sorts.pop()
        yield AttributeDeclaration(own, tuple(sorts), target, at=declared.at if declared else use.at)


def _sort(slot: _Slot, at: Place, found: _Found) -> str | tuple[Expression | SortExpression, ...] | None:
    """The sort of a place: its name, or the elements of a new one, or nothing if nothing is known."""
    sorts, constants = list(slot.sorts), tuple(slot.constants.values())
    if not sorts and slot.constants.keys() <= BOOLEANS.members.keys():
        return BOOLEAN if constants else None
    if not sorts:
        return constants
    if len(sorts) == 1 and found.sorts.known[sorts[0]].members.keys() >= slot.constants.keys():
        return sorts[0]
    whole: SortExpression = SortName(sorts[0], at=at)
    for name in sorts[1:]:
        whole = SortOperation("+", whole, SortName(name, at=at), at=at)
    if constants:
        whole = SortOperation("+", whole, SortSet(constants, at=at), at=at)
    return (whole,)
