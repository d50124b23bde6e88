"""Instantiate one statement: all bindings of its variables, as a table with a column for each variable.

The statement's sorts and positive literals are joined as relations, the one with the fewest matches first;
each condition filters the table as soon as its variables are bound. For ``ok(X,Y) :- next(X,Y), X != 3`` the
table contains the pairs for which `next` may be true, then those with ``X != 3``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from itertools import repeat
from operator import not_

from lcorpp.reasoning.grounding.binding_table import BindingTable, Memo
from lcorpp.reasoning.grounding.relation import Relation, list_matched_variables
from lcorpp.reasoning.language.arithmetic import Value, as_value, compare_values, find_variables
from lcorpp.reasoning.language.issues import Place
from lcorpp.reasoning.language.signature import ArgumentSlot, Signature
from lcorpp.reasoning.language.syntax import (
    BodyLiteral,
    ComparisonLiteral,
    Expression,
    Literal,
    Variable,
)


class Atoms:
    """The atoms of an attribute that may be true in a world.

    relation: the arguments of each, with the value if they are certain.
    is_certain: whether they are facts, true in every world, and there are no others.
    """

    def __init__(self, relation: Relation, arity: int, is_certain: bool) -> None:
        self.relation, self.is_certain, self._arity = relation, is_certain, arity

    @cached_property
    def terms(self) -> Relation:
        """The arguments of each term that may have a value."""
        if not self.is_certain:
            return self.relation
        return Relation.from_rows(self.values, self._arity)

    @cached_property
    def values(self) -> Mapping[tuple[Value, ...], Value]:
        """The value of each fact by its arguments."""
        return {row[:-1]: row[-1] for row in zip(*self.relation.columns, strict=True)}


Source = tuple[Sequence[Expression], Relation]
"""Patterns, and the relation of which their values are a row."""

_Test = Callable[[], Iterable[bool]]
"""A test of each binding."""


class RuleInstantiator:
    """Enumerates the bindings of statements' variables.

    atoms: attribute -> its atoms; literals of other attributes do not restrict the bindings.
    """

    def __init__(self, signature: Signature) -> None:
        self.signature = signature
        self.atoms: dict[str, Atoms] = {}
        self._sorts: Memo[str, Relation] = Memo(self._make_sort)

    def _make_sort(self, name: str) -> Relation:
        members = list(map(as_value, self.signature.sorts[name]))
        return Relation([members], len(members))

    def instantiate(
        self,
        slots: Iterable[ArgumentSlot],
        scope: Iterable[Expression],
        body: Iterable[BodyLiteral],
        at: Place,
        sources: Sequence[Source] = (),
    ) -> BindingTable:
        """Return the bindings of a statement's variables.

        Args:
            slots: the statement's expressions with the sort that their position requires, from
                `Signature.iter_slots`.
            scope: all expressions of the statement; each of their variables is bound.
            body: the conditions.
            at: the place of the statement.
            sources: further conditions.
        """
        join = _Join(BindingTable(at))
        variables = find_variables(*scope)
        for patterns, relation in sources:
            variables |= find_variables(*patterns)
            join.add_source(patterns, relation)
        if variables:
            domains = [(Variable(x), sort) for x, sort in self.signature.domains.items() if x in variables]
            distinct = {(str(expression), sort): expression for expression, sort in (*domains, *slots)}
            for (_, sort), expression in distinct.items():
                if find_variables(expression):
                    join.add_source((expression,), self._sorts[sort])
        for literal in body:
            if isinstance(literal, ComparisonLiteral):
                join.add_comparison(literal)
            elif self.signature.is_sort(literal):
                if literal.negated or not find_variables(literal.term):
                    join.add_membership(
                        literal.term.arguments, self._sorts[literal.term.name], literal.negated
                    )
            elif literal.term.name in self.atoms:
                self._add_literal(join, literal)
        join.bind(variables)
        return join.table

    def _add_literal(self, join: _Join, literal: Literal) -> None:
        atoms, arguments = self.atoms[literal.term.name], literal.term.arguments
        if atoms.is_certain and literal.relation == "=" and not literal.negated:
            join.add_source((*arguments, literal.value), atoms.relation)
            return
        if not literal.negated:
            join.add_source(arguments, atoms.terms)
        if atoms.is_certain:
            join.add_value_test(literal, atoms.values)


class _Join:
    """The join of one statement: its conditions, and the table of the bindings that satisfy them so far."""

    def __init__(self, table: BindingTable) -> None:
        self.table = table
        self._sources: list[tuple[Source, _Test]] = []
        self._tests: list[tuple[set[str], _Test]] = []  # (variables, test)
        # (variable, expression that it equals, test of the equation)
        self._equations: list[tuple[str, Expression, _Test]] = []

    # conditions

    def add_source(self, patterns: Sequence[Expression], relation: Relation) -> None:
        """Add the condition that the values of expressions are a row of a relation."""
        self._sources.append(((patterns, relation), self.add_membership(patterns, relation, False)))

    def add_membership(self, patterns: Sequence[Expression], relation: Relation, negated: bool) -> _Test:
        """Add the test whether the values of expressions are (not) a row of a relation."""

        def test() -> Iterable[bool]:
            keys = self.table.iter_keys(list(map(self.table.evaluate, patterns)))
            found = map(relation.rows.__contains__, keys)
            return map(not_, found) if negated else found

        self._tests.append((find_variables(*patterns), test))
        return test

    def add_comparison(self, comparison: ComparisonLiteral) -> None:
        """Add a comparison; an equation can bind a variable."""
        left, right, relation = comparison.left, comparison.right, comparison.relation

        def test() -> Iterable[bool]:
            first, second = (self.table.iterate(self.table.evaluate(side)) for side in (left, right))
            return map(compare_values, first, repeat(relation), second)

        self._tests.append((find_variables(left, right), test))
        if relation == "=":
            for side, other in ((left, right), (right, left)):
                if isinstance(side, Variable):
                    self._equations.append((side.name, other, test))

    def add_value_test(self, literal: Literal, values: Mapping[tuple[Value, ...], Value]) -> None:
        """Add the test of a literal whose terms have these values in every world."""

        def agrees(value: Value, *arguments: Value) -> bool:
            fact = values.get(arguments)
            return (fact is not None and compare_values(fact, literal.relation, value)) != literal.negated

        def test() -> Iterable[bool]:
            parts = [self.table.evaluate(x) for x in (literal.value, *literal.term.arguments)]
            return map(agrees, *map(self.table.iterate, parts))

        self._tests.append((find_variables(literal.term, literal.value), test))

    # the order in which variables are bound

    def bind(self, variables: set[str]) -> None:
        """Bind variables, and apply each test as soon as its variables are bound."""
        columns = self.table.columns
        while True:
            waiting = []
            for needed, test in self._tests:
                if needed <= columns.keys():
                    self.table.filter(test())
                else:
                    waiting.append((needed, test))
            self._tests = waiting
            if variables <= columns.keys():
                return
            self._bind_next()

    def _bind_next(self) -> None:
        """Bind a variable by an equation if possible, otherwise by the source with the fewest matches."""
        bound = self.table.columns.keys()
        for name, other, test in self._equations:
            if name not in bound and find_variables(other) <= bound:
                self.table.columns[name] = list(self.table.iterate(self.table.evaluate(other)))
                self._drop_test(test)  # the assignment makes the equation true
                return
        computable = {name for name, other, _ in self._equations if find_variables(other) - {name}}
        best: tuple[tuple[bool, float], Source, _Test | None] | None = None
        for (patterns, relation), test in self._sources:
            free = [x for x in patterns if not find_variables(x) <= bound]
            names = {x.name for x in free if isinstance(x, Variable)}
            is_plain = len(names) == len(free)
            if not is_plain:
                names = set(list_matched_variables(patterns)) - bound
            if names:
                n_matches = relation.count ** (len(free) / len(patterns))
                rank = (not is_plain or names <= computable, n_matches)
                if best is None or rank < best[0]:
                    best = rank, (patterns, relation), test if is_plain else None
        assert best, "the checker rejects statements with unsafe variables"
        _, (patterns, relation), implied = best
        if implied:
            self._drop_test(implied)
        else:
            patterns, relation = relation.match(patterns)
        self._join(patterns, relation)

    def _join(self, patterns: Sequence[Expression], relation: Relation) -> None:
        """Join with the rows that agree with the bound positions; the other positions are variables."""
        bound = [i for i, x in enumerate(patterns) if find_variables(x) <= self.table.columns.keys()]
        keys = self.table.iter_keys([self.table.evaluate(patterns[i]) for i in bound])
        columns = {str(x): relation.columns[i] for i, x in enumerate(patterns) if i not in bound}
        self.table.join(keys, relation.indexes[tuple(bound)], columns)

    def _drop_test(self, test: _Test) -> None:
        self._tests = [pair for pair in self._tests if pair[1] is not test]
