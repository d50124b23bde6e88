"""Inference of the declarations that a program leaves out, from the use of its attributes.

In plog 1.0 `#domain` declares the sorts of variables. Declarations of attributes are optional, and so are the
sorts of their arguments (`place : location.`, then `place(B)`). ProbLog has no declarations. An attribute
that occurs in no head stays undeclared, which the checker reports.

A position is an argument of an attribute, or its value (the last one). Its sort consists of the sorts of its
variables and of its constants; positions that a variable without a sort links share theirs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from itertools import chain

from lcorpp.reasoning.language.arithmetic import canonical_text, iter_variables
from lcorpp.reasoning.language.facts import Fact
from lcorpp.reasoning.language.issues import Place
from lcorpp.reasoning.language.signature import build_signature
from lcorpp.reasoning.language.sorts import BOOLEAN, SortDefinition, SortExpression, SortSet
from lcorpp.reasoning.language.syntax import (
    AttributeDeclaration,
    Clause,
    Expression,
    Intervention,
    Literal,
    Operation,
    Probability,
    Statement,
    Term,
    Variable,
)
from lcorpp.reasoning.language.traversal import iter_expressions, list_literals

Attribute = tuple[str, int]
"""The name of an attribute and the number of its arguments."""

Position = tuple[Attribute, int] | tuple[int, str]
"""An attribute and an index, or the number of a statement and a variable without a sort."""


class Inference:
    """The uses of the attributes that a program does not declare, or declares without their arguments."""

    def __init__(self, statements: Sequence[Statement]) -> None:
        self._declared: dict[str, list[AttributeDeclaration]] = {}
        for statement in statements:
            if isinstance(statement, AttributeDeclaration):
                self._declared.setdefault(statement.name, []).append(statement)
        signature = build_signature([s for s in statements if not isinstance(s, AttributeDeclaration)])
        self._sorts, self._domains = signature.sorts, signature.domains
        self._places: dict[Attribute, Place] = {}  # where an attribute occurs first
        self._heads: set[Attribute] = set()
        self._parents: dict[Position, Position] = {}
        self._uses: dict[Position, dict[str, Expression]] = {}  # by text, a sort by `#name`
        self._defined: dict[Position, str] = {}  # names of inferred sorts
        for number, statement in enumerate(statements):
            if isinstance(statement, Fact):
                self._collect_fact(statement)
            else:
                self._collect(number, statement)
        for position in list(self._uses):
            if (root := self._find_root(position)) != position:
                self._uses[root] = {**self._uses.get(root, {}), **self._uses[position]}

    def _is_inferred(self, name: str) -> bool:
        declared = self._declared.get(name, [])
        is_complete = len(declared) > 1 or any(other.arguments for other in declared)
        return not (is_complete or name in self._sorts or name == "obs")

    def _collect_fact(self, fact: Fact) -> None:
        attribute = (fact.name, len(fact.values) - 1)
        if self._is_inferred(fact.name):
            self._places.setdefault(attribute, fact.at)
            self._heads.add(attribute)
            for index, value in enumerate(fact.values):
                uses = self._uses.setdefault((attribute, index), {})
                if str(value) not in uses:
                    uses[str(value)] = list(iter_expressions([fact.head]))[index]

    def _collect(self, number: int, statement: Statement) -> None:
        literals = list_literals(statement)
        sorts = self._find_variable_sorts(literals)
        head = statement.head if isinstance(statement, Clause) else None
        if isinstance(statement, Probability | Intervention):  # listed as a term without its value
            literals[0] = Literal(statement.term, "=", statement.value, at=statement.at)
        for literal in literals:
            attribute = (literal.term.name, len(literal.term.arguments))
            if not self._is_inferred(literal.term.name):
                continue
            self._places.setdefault(attribute, literal.term.at)
            if head and literal.term is head.term:
                self._heads.add(attribute)
            for index, expression in enumerate(iter_expressions([literal])):
                uses = self._uses.setdefault((attribute, index), {})
                if isinstance(expression, Variable):
                    if sort := sorts.get(expression.name):
                        uses[f"#{sort}"] = Term(f"#{sort}", at=literal.term.at)
                    else:
                        root = self._find_root((attribute, index))
                        self._parents[root] = self._find_root((number, expression.name))
                elif not any(iter_variables(expression)) and expression is not literal.term:
                    uses[canonical_text(expression)] = expression

    def _find_variable_sorts(self, literals: Sequence[Literal]) -> dict[str, str]:
        """Map the variables of a statement to sorts: those of `#domain` and of complete declarations."""
        sorts = dict(self._domains)
        for literal in literals:
            name, arguments = literal.term.name, literal.term.arguments
            pairs = [(argument, name) for argument in arguments] if name in self._sorts else []
            for declared in self._declared.get(name, ()):
                if literal.relation == "=":
                    pairs.append((literal.value, declared.range))
                if len(declared.arguments) == len(arguments):
                    pairs.extend(zip(arguments, declared.arguments, strict=True))
            for expression, sort in pairs:
                if isinstance(expression, Variable) and sort in self._sorts:
                    sorts.setdefault(expression.name, sort)
        return sorts

    def _find_root(self, position: Position) -> Position:
        """Return the representative of the positions that share their sort with this one."""
        while (parent := self._parents.setdefault(position, position)) != position:
            self._parents[position] = position = self._parents.setdefault(parent, parent)
        return position

    def get_uses(self, attribute: Attribute, index: int) -> dict[str, Expression]:
        """Return the constants and sorts of a position by their texts."""
        return self._uses.setdefault(self._find_root((attribute, index)), {})

    def add_missing(self, constant: Term) -> None:
        """Add a constant to the positions without constants."""
        for attribute in self._places:
            for index in range(attribute[1]):
                uses = self.get_uses(attribute, index)
                if not uses:
                    uses[constant.name] = constant

    def declare(self, statements: Sequence[Statement]) -> list[Statement]:
        """Return the statements with the inferred declarations."""
        names = dict.fromkeys(name for name, _ in self._places)
        inferred = list(chain.from_iterable(map(self._infer, names)))
        replaced = {new.name for new in inferred if isinstance(new, AttributeDeclaration)}
        kept = [s for s in statements if not (isinstance(s, AttributeDeclaration) and s.name in replaced)]
        return [*kept, *inferred]

    def _infer(self, name: str) -> Iterator[Statement]:
        """Infer the missing declarations of a name; none if its uses do not determine them."""
        declared = next(iter(self._declared.get(name, ())), None)
        counts = sorted(count for other, count in self._places if other == name)
        if counts == [0] if declared else not all((name, count) in self._heads for count in counts):
            return
        for count in counts:
            at, sorts = self._places[name, count], []
            own = name if count == counts[0] else f"{name}_{count}"
            for index in range(count if declared else count + 1):
                root = self._find_root(((name, count), index))
                if root not in self._defined:
                    sort = self._infer_sort(root, at)
                    if sort is None:
                        return
                    if not isinstance(sort, str):
                        new = f"{own}_sort_{index + 1}"
                        while new in self._defined.values():
                            new += "'"
                        yield SortDefinition(new, sort, at=at)
                        sort = new
                    self._defined[root] = sort
                sorts.append(self._defined[root])
            target = declared.range if declared else sorts.pop()
            yield AttributeDeclaration(name, tuple(sorts), target, at=declared.at if declared else at)

    def _infer_sort(self, root: Position, at: Place) -> str | SortExpression | None:
        """Infer the sort of a position: a name, an expression for a new sort, or None if it has no use."""
        uses = self._uses.get(root, {})
        names = [text[1:] for text in uses if text.startswith("#")]
        constants = {text: use for text, use in uses.items() if not text.startswith("#")}
        if not names and constants.keys() <= self._sorts[BOOLEAN].keys():
            return BOOLEAN if constants else None
        if len(names) == 1 and self._sorts[names[0]].keys() >= constants.keys():
            return names[0]
        parts: list[SortExpression] = [Term(f"#{name}", at=at) for name in names]
        if constants:
            parts.append(SortSet(tuple(constants.values()), at=at))
        return reduce(lambda left, right: Operation("+", left, right, at=at), parts)
