"""Instantiate one statement: all bindings of its variables, as a table with a column for each variable.

The table is an indexed join: one sort, fact table or equation after the other extends it, and each condition
filters it as soon as its variables are bound. For ``ok(X,Y) :- next(X,Y), X != 3`` with facts for `next` it
contains the facts, then those with ``X != 3`` and arguments in their sorts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import repeat
from operator import not_

from lcorpp.reasoning.grounding.binding_table import BindingTable
from lcorpp.reasoning.grounding.patterns import (
    find_bare_variables,
    find_inner_variables,
    find_record_variables,
    match,
)
from lcorpp.reasoning.language.arithmetic import Value, compare_values, find_variables, iter_variables
from lcorpp.reasoning.language.issues import Place
from lcorpp.reasoning.language.safety import find_variable_sorts
from lcorpp.reasoning.language.signature import ArgumentSlot, Signature
from lcorpp.reasoning.language.syntax import (
    BodyLiteral,
    ComparisonLiteral,
    Expression,
    Literal,
    Term,
    Variable,
)

Facts = Mapping[str, Mapping[tuple[Value, ...], Value]]
"""attribute -> arguments -> value, for the attributes that only facts define."""


_Test = Callable[[], Iterable[bool]]
"""Returns for each binding whether it satisfies a condition, whose variables are bound."""


class RuleInstantiator:
    """Enumerates the bindings of one statement's variables in `table`.

    Args:
        members: returns the members of a sort.
        slots: the statement's expressions with the sort that their position requires, from
            `Signature.iter_slots`; a variable ranges over the common members of its sorts.
        scope: all expressions of the statement; each of their variables is bound.
        body: its comparisons, sort literals and literals of fact attributes restrict the bindings.
        facts: the attributes that only facts define.
        at: the place of the statement.
        bound: variables that the caller binds.
        bindings: their values.
    """

    def __init__(
        self,
        signature: Signature,
        members: Callable[[str], Mapping[Value, None]],
        slots: Sequence[ArgumentSlot],
        scope: Sequence[Expression],
        body: Iterable[BodyLiteral],
        facts: Facts,
        at: Place,
        bound: Sequence[str] = (),
        bindings: Sequence[tuple[Value, ...]] = ((),),
    ) -> None:
        self._signature, self._members = signature, members
        self.table = BindingTable(at, bound, bindings)
        self._facts = facts
        used = [variable for expression in scope for variable in iter_variables(expression)]
        self._sorts = find_variable_sorts(slots, used, signature)
        self._bound: set[str] = set()
        self._tests: list[tuple[set[str], _Test]] = []  # (variables, test)
        # (variable, expression that it equals, test of the equation)
        self._equations: list[tuple[str, Expression, _Test]] = []
        self._records: list[tuple[Term, str]] = []  # (record with variables, its sort)
        self._fact_literals: list[Literal] = []
        self._collect_conditions(slots, body)
        self._mark_bound(bound)
        while not all(variable.name in self._bound for variable in used):
            self._bind_next_variable()

    def _collect_conditions(self, slots: Sequence[ArgumentSlot], body: Iterable[BodyLiteral]) -> None:
        for expression, sort in slots:
            if isinstance(expression, Variable) or not any(iter_variables(expression)):
                continue
            self._tests.append((find_variables(expression), self._make_member_test(expression, sort)))
            if isinstance(expression, Term):
                self._records.append((expression, sort))
        for literal in body:
            if isinstance(literal, ComparisonLiteral):
                self._collect_comparison(literal)
            elif self._signature.is_sort(literal):
                inner = literal.term.arguments[0]
                test = self._make_member_test(inner, literal.term.name, negated=literal.negated)
                self._tests.append((find_variables(inner), test))
            elif literal.term.name in self._facts:
                self._collect_fact(literal)

    def _make_member_test(self, expression: Expression, sort: str, *, negated: bool = False) -> _Test:
        """Return the test whether the value of an expression is (not) a member of a sort."""
        contains = self._members(sort).__contains__

        def test() -> Iterable[bool]:
            found = map(contains, self.table.iterate(self.table.evaluate(expression)))
            return map(not_, found) if negated else found

        return test

    def _collect_comparison(self, comparison: ComparisonLiteral) -> None:
        left, right, relation = comparison.left, comparison.right, comparison.relation

        def test() -> Iterable[bool]:
            first, second = (self.table.iterate(self.table.evaluate(side)) for side in (left, right))
            return map(compare_values, first, repeat(relation), second)

        self._tests.append((find_variables(left) | find_variables(right), test))
        if relation == "=":
            for side, other in ((left, right), (right, left)):
                if isinstance(side, Variable):
                    self._equations.append((side.name, other, test))

    def _collect_fact(self, literal: Literal) -> None:
        table = self._facts[literal.term.name]

        def agrees(value: Value, *arguments: Value) -> bool:
            fact = table.get(arguments)
            return (fact is not None and compare_values(fact, literal.relation, value)) != literal.negated

        def test() -> Iterable[bool]:
            parts = [self.table.evaluate(x) for x in (literal.value, *literal.term.arguments)]
            return map(agrees, *map(self.table.iterate, parts))

        self._tests.append((find_variables(literal.term) | find_variables(literal.value), test))
        if not literal.negated and literal.relation == "=":
            self._fact_literals.append(literal)

    # the order in which variables are bound

    def _apply_ready_tests(self) -> None:
        """Apply the tests whose variables are all bound."""
        waiting = []
        for needed, test in self._tests:
            if needed <= self._bound:
                self.table.filter(test())
            else:
                waiting.append((needed, test))
        self._tests = waiting

    def _mark_bound(self, names: Iterable[str], *, in_sorts: bool = False) -> None:
        """Mark variables as bound and apply the tests that are now ready.

        Args:
            in_sorts: whether it is certain that the variables are members of their sorts.
        """
        for name in names:
            if name not in self._bound:
                self._bound.add(name)
                if name in self._sorts and not in_sorts:
                    for sort in self._sorts[name]:
                        self._tests.append(({name}, self._make_member_test(Variable(name), sort)))
        self._apply_ready_tests()

    def _bind_next_variable(self) -> None:
        """Bind a variable by an equation if possible, otherwise by facts, the smallest sort or a record.

        Matching a fact binds its bare variables (whole arguments or the value); those inside of records and
        arithmetic must be bound before. Matching a record binds the variables at any depth except those in
        arithmetic.
        """
        for name, other, test in self._equations:
            if name not in self._bound and find_variables(other) <= self._bound:
                # the assignment makes the equation true
                self._tests = [pair for pair in self._tests if pair[1] is not test]
                self.table.bind(name, self.table.evaluate(other))
                self._mark_bound([name])
                return
        for literal in self._fact_literals:
            if find_bare_variables(literal) - self._bound and find_inner_variables(literal) <= self._bound:
                self._join_facts(literal)
                return
        free = [name for name in self._sorts if name not in self._bound]
        if free:
            computable = {target for target, other, _ in self._equations if find_variables(other) - {target}}
            name = min(free, key=lambda name: (name in computable, len(self._list_domain(name))))
            self.table.bind_all(name, self._list_domain(name))
            self._mark_bound([name], in_sorts=True)
            return
        for term, sort in self._records:
            if find_variables(term) - self._bound and find_record_variables(term, True) <= self._bound:
                self._join_records(term, sort)
                return
        raise AssertionError("the checker rejects statements with unsafe variables")

    def _list_domain(self, name: str) -> list[Value]:
        """List the common members of a variable's sorts."""
        first, *others = (self._members(sort) for sort in self._sorts[name])
        if not others:
            return list(first)
        return [member for member in first if all(member in other for other in others)]

    def _join_facts(self, literal: Literal) -> None:
        """Join with the facts that agree with the bound positions, found by an index over these positions."""
        parts = (*literal.term.arguments, literal.value)
        bound = [i for i, part in enumerate(parts) if find_variables(part) <= self._bound]
        unbound = [(i, x.name) for i, x in enumerate(parts) if i not in bound and isinstance(x, Variable)]
        free: dict[str, int] = {}
        for i, name in unbound:
            free.setdefault(name, i)
        index: dict[tuple[Value, ...], list[tuple[Value, ...]]] = {}
        for arguments, value in self._facts[literal.term.name].items():
            row = (*arguments, value)
            if all(row[i] == row[free[name]] for i, name in unbound):
                key = tuple([row[i] for i in bound])
                index.setdefault(key, []).append(tuple([row[i] for i in free.values()]))
        keys = self.table.list_rows(self.table.evaluate(parts[i]) for i in bound)
        self.table.bind_matches(list(free), index, keys)
        self._mark_bound(free)

    def _join_records(self, term: Term, sort: str) -> None:
        """Join with the members of a sort that match a record, found by an index over its bound variables."""
        names = sorted(find_variables(term))
        free = [name for name in names if name not in self._bound]
        bound = [name for name in names if name in self._bound and name in find_record_variables(term, False)]
        index: dict[tuple[Value, ...], list[tuple[Value, ...]]] = {}
        for member in self._members(sort):
            bindings: dict[str, Value] = {}
            if match(term, member, bindings):
                key = tuple([bindings[name] for name in bound])
                index.setdefault(key, []).append(tuple([bindings[name] for name in free]))
        keys = self.table.list_rows(self.table.columns[name] for name in bound)
        self.table.bind_matches(free, index, keys)
        self._mark_bound(free)
