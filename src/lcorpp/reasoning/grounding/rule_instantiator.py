"""Instantiate one statement: all bindings of its variables, enumerated by generated Python code.

The generated function has nested loops over sorts and fact tables (an indexed join) and tests each condition
as soon as its variables are bound; `grounder` adds the lines that emit a clause for each binding. For
``ok(X,Y) :- next(X,Y), X != 3`` with facts for `next` and the sort `node` of both arguments, the function
begins:

    def run():
     for v_X, v_Y,  in k1.get(('true', ), ()):
      if not ((h := k2.get((v_X, v_Y, ))) is not None and compare_values(h, '=', 'true')): continue
      if not (v_X != 3): continue
      if not (v_X in k3): continue
      if not (v_Y in k4): continue

k1 is an index over the facts, k2 the table of the facts, k3 and k4 contain the members of `node`. Generated
source runs faster than closures.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

from lcorpp.reasoning.grounding.generated_function import GeneratedFunction
from lcorpp.reasoning.grounding.patterns import (
    find_bare_variables,
    find_inner_variables,
    find_record_variables,
    match,
)
from lcorpp.reasoning.language.arithmetic import Value, find_variables, iter_variables
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

_Index = dict[tuple[Value, ...], list[tuple[Value, ...]]]

Facts = Mapping[str, Mapping[tuple[Value, ...], Value]]
"""attribute -> arguments -> value, for the attributes that only facts define."""


class RuleInstantiator(GeneratedFunction):
    """Generates the function that enumerates the bindings of one statement's variables.

    Args:
        members: returns the members of a sort.
        slots: the statement's expressions with the sort that their position requires, from
            `Signature.iter_slots`; a variable ranges over the common members of its sorts.
        scope: all expressions of the statement; each of their variables is bound.
        body: its comparisons, sort literals and literals of fact attributes restrict the bindings.
        facts: the attributes that only facts define.
        bound: variables bound by the caller, the arguments of the generated function.
    """

    def __init__(
        self,
        signature: Signature,
        members: Callable[[str], Mapping[Value, None]],
        slots: Sequence[ArgumentSlot],
        scope: Sequence[Expression],
        body: Iterable[BodyLiteral],
        facts: Facts,
        bound: Sequence[str] = (),
    ) -> None:
        self._signature, self._members = signature, members
        super().__init__(bound)
        self._facts = facts
        used = [variable for expression in scope for variable in iter_variables(expression)]
        self._sorts = find_variable_sorts(slots, used, signature)
        self._bound: set[str] = set()
        # (variables, function that writes the source of the test once they are bound)
        self._tests: list[tuple[set[str], Callable[[], str]]] = []
        # (variable, expression that it equals, test of the equation)
        self._equations: list[tuple[str, Expression, Callable[[], str]]] = []
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
            self._tests.append((find_variables(expression), self._make_member_test(expression, sort, "in")))
            if isinstance(expression, Term):
                self._records.append((expression, sort))
        for literal in body:
            if isinstance(literal, ComparisonLiteral):
                self._collect_comparison(literal)
            elif self._signature.is_sort(literal):
                inner = literal.term.arguments[0]
                relation = "not in" if literal.negated else "in"
                test = self._make_member_test(inner, literal.term.name, relation)
                self._tests.append((find_variables(inner), test))
            elif literal.term.name in self._facts:
                self._collect_fact(literal)

    def _make_member_test(self, expression: Expression, sort: str, relation: str) -> Callable[[], str]:
        """Return a function that writes the source of a membership test; `relation` is `in` or `not in`."""
        return lambda: f"{self.write_source(expression)} {relation} {self.name_constant(self._members(sort))}"

    def _make_sort_test(self, name: str) -> Callable[[], str]:
        """Return a function that writes the source of the test that a variable is a member of its sorts."""
        sorts = self._sorts[name]
        return lambda: " and ".join(
            f"v_{name} in {self.name_constant(self._members(sort))}" for sort in sorts
        )

    def _collect_comparison(self, comparison: ComparisonLiteral) -> None:
        left, right, relation = comparison.left, comparison.right, comparison.relation

        def write_test() -> str:
            if relation in ("=", "!="):
                operator = "==" if relation == "=" else "!="
                return f"{self.write_source(left)} {operator} {self.write_source(right)}"
            return f"compare_values({self.write_source(left)}, {relation!r}, {self.write_source(right)})"

        self._tests.append((find_variables(left) | find_variables(right), write_test))
        if relation == "=":
            for side, other in ((left, right), (right, left)):
                if isinstance(side, Variable):
                    self._equations.append((side.name, other, write_test))

    def _collect_fact(self, literal: Literal) -> None:
        table = self._facts[literal.term.name]

        def write_test() -> str:
            arguments = "".join(f"{self.write_source(x)}, " for x in literal.term.arguments)
            fact = f"{self.name_constant(table)}.get(({arguments}))"
            value = self.write_source(literal.value)
            agrees = f"(h := {fact}) is not None and compare_values(h, {literal.relation!r}, {value})"
            return f"not ({agrees})" if literal.negated else agrees

        self._tests.append((find_variables(literal.term) | find_variables(literal.value), write_test))
        if not literal.negated and literal.relation == "=":
            self._fact_literals.append(literal)

    # the order in which variables are bound

    def _add_ready_tests(self) -> None:
        """Add the tests whose variables are all bound."""
        waiting = []
        for needed, write_test in self._tests:
            if needed <= self._bound:
                self.add_line(f"if not ({write_test()}): {'continue' if self._depth > 1 else 'return'}")
            else:
                waiting.append((needed, write_test))
        self._tests = waiting

    def _mark_bound(self, names: Iterable[str], *, in_sorts: bool = False) -> None:
        """Mark variables as bound and add the tests that are now ready.

        Args:
            in_sorts: whether the loop ensures that the variables are members of their sorts.
        """
        for name in names:
            if name not in self._bound:
                self._bound.add(name)
                if name in self._sorts and not in_sorts:
                    self._tests.append(({name}, self._make_sort_test(name)))
        self._add_ready_tests()

    def _bind_next_variable(self) -> None:
        """Bind a variable by an equation if possible, otherwise by facts, the smallest sort or a record.

        Matching a fact binds its bare variables (whole arguments or the value); those inside of records and
        arithmetic must be bound before. Matching a record binds the variables at any depth except those in
        arithmetic.
        """
        for name, other, write_test in self._equations:
            if name not in self._bound and find_variables(other) <= self._bound:
                # the assignment makes the equation true
                self._tests = [pair for pair in self._tests if pair[1] is not write_test]
                self.add_line(f"v_{name} = {self.write_source(other)}")
                self._mark_bound([name])
                return
        for literal in self._fact_literals:
            if find_bare_variables(literal) - self._bound and find_inner_variables(literal) <= self._bound:
                self._loop_over_facts(literal)
                return
        free = [name for name in self._sorts if name not in self._bound]
        if free:
            computable = {target for target, other, _ in self._equations if find_variables(other) - {target}}
            name = min(free, key=lambda name: (name in computable, len(self._list_domain(name))))
            domain = self._list_domain(name)
            if len(domain) == 1:  # Python allows at most twenty nested loops
                self.add_line(f"v_{name} = {domain[0]!r}")
            else:
                self.open_loop(f"v_{name}", self.name_constant(domain))
            self._mark_bound([name], in_sorts=True)
            return
        for term, sort in self._records:
            if find_variables(term) - self._bound and find_record_variables(term, True) <= self._bound:
                self._loop_over_records(term, sort)
                return
        raise AssertionError("the checker rejects statements with unsafe variables")

    def _list_domain(self, name: str) -> list[Value]:
        """List the common members of a variable's sorts."""
        first, *others = (self._members(sort) for sort in self._sorts[name])
        if not others:
            return list(first)
        return [member for member in first if all(member in other for other in others)]

    def _loop_over_facts(self, literal: Literal) -> None:
        """Loop over the facts that agree with the bound positions, found by an index over these positions."""
        parts = (*literal.term.arguments, literal.value)
        bound = [i for i, part in enumerate(parts) if find_variables(part) <= self._bound]
        unbound = [(i, x.name) for i, x in enumerate(parts) if i not in bound and isinstance(x, Variable)]
        free: dict[str, int] = {}
        for i, name in unbound:
            free.setdefault(name, i)
        index: _Index = {}
        for arguments, value in self._facts[literal.term.name].items():
            row = (*arguments, value)
            if all(row[i] == row[free[name]] for i, name in unbound):
                key = tuple([row[i] for i in bound])
                index.setdefault(key, []).append(tuple([row[i] for i in free.values()]))
        self._loop_over_index(index, [self.write_source(parts[i]) for i in bound], free)

    def _loop_over_records(self, term: Term, sort: str) -> None:
        """Loop over the members of a sort that match a record, found by an index over its bound variables."""
        names = sorted(find_variables(term))
        free = [name for name in names if name not in self._bound]
        bound = [name for name in names if name in self._bound and name in find_record_variables(term, False)]
        index: _Index = {}
        for member in self._members(sort):
            bindings: dict[str, Value] = {}
            if match(term, member, bindings):
                key = tuple([bindings[name] for name in bound])
                index.setdefault(key, []).append(tuple([bindings[name] for name in free]))
        self._loop_over_index(index, [f"v_{name}" for name in bound], free)

    def _loop_over_index(self, index: _Index, key: Iterable[str], free: Collection[str]) -> None:
        targets = "".join(f"v_{name}, " for name in free)
        key_source = "".join(f"{part}, " for part in key)
        self.open_loop(targets, f"{self.name_constant(index)}.get(({key_source}), ())")
        self._mark_bound(free)
