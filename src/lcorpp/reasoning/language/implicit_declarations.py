"""Type inference for plog 1.0: infer the declarations of attributes from their use.

In plog 1.0 `#domain` declares the sorts of variables. Declarations of attributes are optional, and so are the
sorts of their arguments (`place : location.`, then `place(B)`). Attributes with different numbers of
arguments may share a name; all but the one with the fewest arguments get a mangled name. An attribute that
occurs in no head stays undeclared, which the checker reports.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from lcorpp.reasoning.language.arithmetic import canonical_text, iter_variables
from lcorpp.reasoning.language.issues import Place
from lcorpp.reasoning.language.signature import BOOLEAN, mangle_name
from lcorpp.reasoning.language.sorts import BOOLEANS, SortTable
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    DomainDirective,
    Expression,
    Literal,
    SortDefinition,
    SortExpression,
    SortName,
    SortOperation,
    SortSet,
    Statement,
    Variable,
)
from lcorpp.reasoning.language.traversal import iter_literals, map_literals


@dataclass
class _Slot:
    """The uses of one argument or value position: the sorts of its variables, and its constants."""

    sorts: dict[str, None] = field(default_factory=dict)
    constants: dict[str, Expression] = field(default_factory=dict)

    def add(self, expression: Expression, known: dict[str, str], sorts: SortTable) -> None:
        """Add a use; `known` maps variables to their sorts."""
        if isinstance(expression, Variable):
            if known.get(expression.name) in sorts.known:
                self.sorts[known[expression.name]] = None
        elif not any(iter_variables(expression)):
            self.constants[canonical_text(expression)] = expression


@dataclass
class _Use:
    """The uses of an attribute with a certain number of arguments; the last slot is that of the value."""

    at: Place
    slots: list[_Slot]
    in_head: bool = False


@dataclass
class _Analysis:
    """Declarations and uses of a program; `uses` maps name -> number of arguments -> use."""

    declared: dict[str, AttributeDeclaration] = field(default_factory=dict)
    domains: dict[str, str] = field(default_factory=dict)
    sorts: SortTable = field(default_factory=SortTable)
    uses: dict[str, dict[int, _Use]] = field(default_factory=dict)


def infer_declarations(statements: Sequence[Statement]) -> Sequence[Statement]:
    """Return the statements with the inferred declarations.

    Raises:
        SourceIssue: the definition of a sort is invalid.
    """
    analysis = _analyse(statements)
    names: dict[tuple[str, int], str] = {}
    replacements: dict[str, list[Statement]] = {}
    added: list[Statement] = []
    for name, uses in analysis.uses.items():
        inferred = list(_infer_for_name(name, uses, analysis, names))
        if name in analysis.declared and inferred:
            replacements[name] = [s for s in inferred if isinstance(s, AttributeDeclaration)]
            inferred = [s for s in inferred if not isinstance(s, AttributeDeclaration)]
        added.extend(inferred)
    whole: list[Statement] = []
    for statement in statements:
        if isinstance(statement, AttributeDeclaration) and statement.name in replacements:
            whole.extend(replacements.pop(statement.name))
        else:
            whole.append(statement)

    def rename(literal: Literal) -> Literal:
        term = literal.term
        name = names.get((term.name, len(term.arguments)), term.name)
        return literal if name == term.name else replace(literal, term=replace(term, name=name))

    return [*(map_literals(statement, rename) for statement in whole), *added]


def _analyse(statements: Sequence[Statement]) -> _Analysis:
    analysis = _Analysis()
    analysis.sorts.known[BOOLEAN] = BOOLEANS
    for statement in statements:
        if isinstance(statement, AttributeDeclaration):
            analysis.declared.setdefault(statement.name, statement)
        elif isinstance(statement, DomainDirective):
            analysis.domains.update(dict.fromkeys(statement.variables, statement.sort))
        elif isinstance(statement, SortDefinition) and statement.name != BOOLEAN:
            analysis.sorts.define(statement)
    for statement in statements:
        known = _find_variable_sorts(statement, analysis)
        for literal, is_head in iter_literals(statement):
            _record_use(literal, is_head, known, analysis)
    return analysis


def _find_variable_sorts(statement: Statement, analysis: _Analysis) -> dict[str, str]:
    """Map the variables of a statement to sorts: those of `#domain` and of complete declarations."""
    known = dict(analysis.domains)
    for literal, _ in iter_literals(statement):
        name, arguments = literal.term.name, literal.term.arguments
        attribute = analysis.declared.get(name)
        pairs: list[tuple[Expression, str]] = []
        if name in analysis.sorts.known and len(arguments) == 1:
            pairs.append((arguments[0], name))
        elif attribute:
            if literal.relation == "=":
                pairs.append((literal.value, attribute.range))
            if len(attribute.arguments) == len(arguments):
                pairs.extend(zip(arguments, attribute.arguments, strict=True))
        for expression, sort in pairs:
            if isinstance(expression, Variable):
                known.setdefault(expression.name, sort)
    return known


def _record_use(literal: Literal, is_head: bool, known: dict[str, str], analysis: _Analysis) -> None:
    term = literal.term
    declared = analysis.declared.get(term.name)
    if term.name in analysis.sorts.known or term.name == "obs" or (declared and declared.arguments):
        return
    use = analysis.uses.setdefault(term.name, {}).setdefault(
        len(term.arguments), _Use(term.at, [_Slot() for _ in range(len(term.arguments) + 1)])
    )
    use.in_head |= is_head
    for slot, argument in zip(use.slots, term.arguments, strict=False):
        slot.add(argument, known, analysis.sorts)
    if literal.value is not term:  # a selected term has no value
        use.slots[-1].add(literal.value, known, analysis.sorts)


def _infer_for_name(
    name: str, uses: dict[int, _Use], analysis: _Analysis, names: dict[tuple[str, int], str]
) -> Iterator[Statement]:
    """Infer the missing declarations of one name; none if its use does not determine them."""
    declared = analysis.declared.get(name)
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
            sort = _infer_sort(slot, use.at, analysis)
            if sort is None:
                return
            if not isinstance(sort, str):
                new_name = f"{own}_sort_{place + 1}"
                yield SortDefinition(new_name, sort, at=use.at)
                sort = new_name
            sorts.append(sort)
        target = declared.range if declared else sorts.pop()
        yield AttributeDeclaration(own, tuple(sorts), target, at=declared.at if declared else use.at)


def _infer_sort(
    slot: _Slot, at: Place, analysis: _Analysis
) -> str | tuple[Expression | SortExpression, ...] | None:
    """Infer the sort of a position: its name, the elements of a new sort, or None if it has no use."""
    sorts, constants = list(slot.sorts), tuple(slot.constants.values())
    if not sorts and slot.constants.keys() <= BOOLEANS.members.keys():
        return BOOLEAN if constants else None
    if not sorts:
        return constants
    if len(sorts) == 1 and analysis.sorts.known[sorts[0]].members.keys() >= slot.constants.keys():
        return sorts[0]
    whole: SortExpression = SortName(sorts[0], at=at)
    for name in sorts[1:]:
        whole = SortOperation("+", whole, SortName(name, at=at), at=at)
    if constants:
        whole = SortOperation("+", whole, SortSet(constants, at=at), at=at)
    return (whole,)
