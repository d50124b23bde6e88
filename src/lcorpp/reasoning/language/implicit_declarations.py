"""Type inference for plog 1.0: infer the declarations of attributes from their use.

In plog 1.0 `#domain` declares the sorts of variables. Declarations of attributes are optional, and so are the
sorts of their arguments (`place : location.`, then `place(B)`). Attributes with different numbers of
arguments may share a name; all but the one with the fewest arguments get a mangled name. An attribute that
occurs in no head stays undeclared, which the checker reports.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import reduce

from lcorpp.reasoning.language.arithmetic import canonical_text, iter_variables
from lcorpp.reasoning.language.facts import Fact
from lcorpp.reasoning.language.issues import Place
from lcorpp.reasoning.language.signature import build_signature, mangle_name
from lcorpp.reasoning.language.sorts import (
    BOOLEAN,
    SortDefinition,
    SortExpression,
    SortName,
    SortOperation,
    SortSet,
)
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    Clause,
    Expression,
    Literal,
    Statement,
    Variable,
)
from lcorpp.reasoning.language.traversal import list_literals, map_literals


@dataclass
class _Use:
    """The uses of an attribute with a certain number of arguments.

    slots: for each argument and the value the sorts of its variables (keys `#sort`) and its constants.
    """

    at: Place
    slots: list[dict[str, SortName | Expression]]
    in_head: bool = False


class _Inference:
    """The declarations of a program and the uses of the attributes that lack one.

    uses: name -> number of arguments -> use.
    names: (name, number of arguments) -> mangled name.
    """

    def __init__(self, statements: Sequence[Statement]) -> None:
        signature = build_signature(statements)
        self.declared, self._sorts, self._domains = signature.attributes, signature.sorts, signature.domains
        self.uses: dict[str, dict[int, _Use]] = {}
        self.names: dict[tuple[str, int], str] = {}
        for statement in statements:
            if isinstance(statement, Fact):
                self._collect_constants(statement)
            else:
                self._collect_uses(statement)

    def _find_use(self, name: str, count: int, at: Place) -> _Use | None:
        """Find the use of an attribute; None if its declaration is complete, or if it is a sort."""
        declared = self.declared.get(name)
        if name in self._sorts or name == "obs" or (declared and declared.arguments):
            return None
        return self.uses.setdefault(name, {}).setdefault(count, _Use(at, [{} for _ in range(count + 1)]))

    def _collect_constants(self, fact: Fact) -> None:
        use = self._find_use(fact.name, len(fact.values) - 1, fact.at)
        if use:
            use.in_head = True
            for i, (slot, value) in enumerate(zip(use.slots, fact.values, strict=True)):
                if str(value) not in slot:
                    slot[str(value)] = (*fact.head.term.arguments, fact.head.value)[i]

    def _collect_uses(self, statement: Statement) -> None:
        literals = list_literals(statement)
        head = statement.head if isinstance(statement, Clause) else None
        sorts = self._find_variable_sorts(literals)
        for literal in literals:
            term = literal.term
            use = self._find_use(term.name, len(term.arguments), term.at)
            if use is None:
                continue
            use.in_head |= head is not None and term is head.term
            values = () if literal.value is term else (literal.value,)  # a selected term has no value
            for slot, expression in zip(use.slots, (*term.arguments, *values), strict=False):
                if isinstance(expression, Variable):
                    if (sort := sorts.get(expression.name)) in self._sorts:
                        slot[f"#{sort}"] = SortName(str(sort), at=term.at)
                elif not any(iter_variables(expression)):
                    slot[canonical_text(expression)] = expression

    def _find_variable_sorts(self, literals: Sequence[Literal]) -> dict[str, str]:
        """Map the variables of a statement to sorts: those of `#domain` and of complete declarations."""
        sorts = dict(self._domains)
        for literal in literals:
            name, arguments = literal.term.name, literal.term.arguments
            attribute = self.declared.get(name)
            pairs: list[tuple[Expression, str]] = []
            if name in self._sorts and len(arguments) == 1:
                pairs.append((arguments[0], name))
            elif attribute:
                if literal.relation == "=":
                    pairs.append((literal.value, attribute.range))
                if len(attribute.arguments) == len(arguments):
                    pairs.extend(zip(arguments, attribute.arguments, strict=True))
            for expression, sort in pairs:
                if isinstance(expression, Variable):
                    sorts.setdefault(expression.name, sort)
        return sorts

    def infer(self, name: str) -> Iterator[Statement]:
        """Infer the missing declarations of a name; none if its uses do not determine them."""
        declared, uses = self.declared.get(name), self.uses[name]
        if set(uses) == {0} if declared else not all(use.in_head for use in uses.values()):
            return
        for count, use in sorted(uses.items()):
            own = self.names[name, count] = name if count == min(uses) else mangle_name(name, count)
            sorts: list[str] = []
            for place, slot in enumerate(use.slots[:-1] if declared else use.slots, 1):
                sort = self._infer_sort(slot, use.at)
                if sort is None:
                    return
                if not isinstance(sort, str):
                    yield SortDefinition(f"{own}_sort_{place}", sort, at=use.at)
                    sort = f"{own}_sort_{place}"
                sorts.append(sort)
            target = declared.range if declared else sorts.pop()
            yield AttributeDeclaration(own, tuple(sorts), target, at=declared.at if declared else use.at)

    def _infer_sort(self, slot: dict[str, SortName | Expression], at: Place) -> str | SortExpression | None:
        """Infer the sort of a position: a name, an expression for a new sort, or None if it has no use."""
        names = [use for use in slot.values() if isinstance(use, SortName)]
        constants = {text: use for text, use in slot.items() if not isinstance(use, SortName)}
        if not names and constants.keys() <= self._sorts[BOOLEAN].keys():
            return BOOLEAN if constants else None
        if len(names) == 1 and self._sorts[names[0].name].keys() >= constants.keys():
            return names[0].name
        parts: list[SortExpression] = [*names]
        if constants:
            parts.append(SortSet(tuple(constants.values()), at=at))
        return reduce(lambda left, right: SortOperation("+", left, right, at=at), parts)


def infer_declarations(statements: Sequence[Statement]) -> Sequence[Statement]:
    """Return the statements with the inferred declarations.

    Raises:
        SourceIssue: the definition of a sort is invalid.
    """
    inference = _Inference(statements)
    replacements: dict[str, list[Statement]] = {}
    added: list[Statement] = []
    for name in inference.uses:
        for new in inference.infer(name):
            if isinstance(new, AttributeDeclaration) and name in inference.declared:
                replacements.setdefault(name, []).append(new)
            else:
                added.append(new)

    mangled = {key: name for key, name in inference.names.items() if name != key[0]}

    def rename(literal: Literal) -> Literal:
        name = mangled.get((literal.term.name, len(literal.term.arguments)))
        return replace(literal, term=replace(literal.term, name=name)) if name else literal

    whole: list[Statement] = []
    for statement in statements:
        name = statement.name if isinstance(statement, AttributeDeclaration) else ""
        whole.extend(replacements.pop(name, [map_literals(statement, rename) if mangled else statement]))
    return [*whole, *added]
