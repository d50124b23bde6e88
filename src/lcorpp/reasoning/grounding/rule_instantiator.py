"""Instantiate one statement: all bindings of its variables, enumerated by generated Python code.

The generated function has nested loops over sorts and fact tables (an indexed join) and tests each condition
as soon as its variables are bound; `grounder` adds the lines that emit a clause for each binding. For
``ok(X,Y) :- next(X,Y), X != 3`` with facts for `next` the function begins:

    def run():
     for v_X, v_Y, in k2.get(('true', ), ()):
      if not (v_X != 3): continue

Generated source runs faster than closures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from lcorpp.reasoning.grounding.values import (
    Value,
    compare_values,
    divide,
    find_arithmetic_variables,
    find_bare_variables,
    find_inner_variables,
    find_matched_variables,
    find_variables,
    match,
    parse_value,
)
from lcorpp.reasoning.language.arithmetic import canonical_text, iter_variables
from lcorpp.reasoning.language.safety import variable_sorts
from lcorpp.reasoning.language.signature import Signature, Slot
from lcorpp.reasoning.language.syntax import (
    Comparison,
    Expression,
    Literal,
    Number,
    Term,
    Variable,
)

Facts = Mapping[str, Mapping[tuple[Value, ...], Value]]
"""attribute -> arguments -> value, for the attributes that only facts define."""


class Source(str):
    """Python source of an expression."""

    __slots__ = ()


Part = Source | Value
"""A value known now, or the source that computes it for each binding."""


class RuleInstantiator:
    """The generated function that enumerates the bindings of one statement's variables.

    Args:
        members: returns the members of a sort.
        slots, scope: as in `safety.check_scope`; a variable ranges over the sorts of its slots.
        body: its comparisons, sort literals and literals of fact attributes restrict the bindings.
        facts: the attributes that only facts define.
        bound: variables bound by the caller, the arguments of the generated function.
    """

    def __init__(
        self,
        signature: Signature,
        members: Callable[[str], Mapping[Value, None]],
        slots: Sequence[Slot],
        scope: Sequence[Expression],
        body: Iterable[Literal | Comparison],
        facts: Facts,
        bound: Sequence[str] = (),
    ) -> None:
        self._signature, self._members = signature, members
        self._facts, self._arguments = facts, tuple(bound)
        used = [variable for expression in scope for variable in iter_variables(expression)]
        self._sorts = variable_sorts(slots, used, signature)
        self._bound = set(bound)
        self._lines: list[str] = []
        self._depth = 1
        self._constants: dict[str, Any] = {"divide": divide, "compare_values": compare_values}
        self._tests: list[tuple[set[str], Callable[[], str]]] = []
        self._equations: list[tuple[str, Expression, Callable[[], str]]] = []
        self._records: list[tuple[Term, str]] = []
        self._fact_literals: list[Literal] = []
        self._collect_conditions(slots, body)
        if not used:
            self._add_ready_tests()
            return
        for name in bound:
            if name in self._sorts:
                self._tests.append(({name}, self._test_sorts(name)))
        self._add_ready_tests()
        while not all(variable.name in self._bound for variable in used):
            self._bind_next_variable()

    @property
    def is_ground(self) -> bool:
        """Whether the statement has exactly one instance and no condition to test."""
        return not self._lines and not self._arguments

    def add_line(self, line: str) -> None:
        """Append a line to the innermost loop: it runs once for each binding."""
        self._lines.append(" " * self._depth + line)

    def name_constant(self, value: object) -> Source:
        """Make a value available to the generated function; return its name."""
        name = f"k{len(self._constants)}"
        self._constants[name] = value
        return Source(name)

    def translate(self, expression: Expression) -> Part:
        """Return the value of an expression, or the source that computes it from bound variables."""
        if isinstance(expression, Variable):
            return Source(f"v_{expression.name}")
        if isinstance(expression, Number) or not any(iter_variables(expression)):
            return parse_value(canonical_text(expression))
        if isinstance(expression, Term):
            inner = " + ',' + ".join(f"str({self._write(argument)})" for argument in expression.arguments)
            return Source(f"({expression.name + '('!r} + {inner} + ')')")
        left, right = self._write(expression.left), self._write(expression.right)
        if expression.operator in ("/", "mod"):
            place = self.name_constant(expression.at)
            return Source(f"divide({left}, {right}, {expression.operator!r}, {place})")
        return Source(f"({left} {expression.operator} {right})")

    def quote(self, part: Part) -> str:
        """Return the source of a part."""
        if isinstance(part, int) and part.bit_length() > 64:  # a mask of many values
            return self.name_constant(part)
        return str(part) if isinstance(part, Source) else repr(part)

    def compile(self, **names: object) -> Callable[..., None]:
        """Compile the function; its arguments are the `bound` variables.

        Args:
            names: the values of the other names in the added lines.
        """
        arguments = ", ".join(f"v_{name}" for name in self._arguments)
        text = "\n".join([f"def run({arguments}):", *self._lines, " pass"])
        namespace: dict[str, Any] = {**self._constants, **names}
        exec(compile(text, "<instantiator>", "exec"), namespace)
        return namespace["run"]  # type: ignore[no-any-return]

    def _write(self, expression: Expression) -> str:
        return self.quote(self.translate(expression))

    # conditions on the variables

    def _collect_conditions(self, slots: Sequence[Slot], body: Iterable[Literal | Comparison]) -> None:
        for expression, sort in slots:
            if isinstance(expression, Variable) or not any(iter_variables(expression)):
                continue
            self._tests.append((find_variables(expression), self._test_member(expression, sort, "in")))
            if isinstance(expression, Term):
                self._records.append((expression, sort))
        for literal in body:
            if isinstance(literal, Comparison):
                self._collect_comparison(literal)
            elif self._signature.is_sort(literal):
                inner = literal.term.arguments[0]
                relation = "not in" if literal.negated else "in"
                test = self._test_member(inner, literal.term.name, relation)
                self._tests.append((find_variables(inner), test))
            elif literal.term.name in self._facts:
                self._collect_fact(literal)

    def _test_member(self, expression: Expression, sort: str, relation: str) -> Callable[[], str]:
        return lambda: f"{self._write(expression)} {relation} {self.name_constant(self._members(sort))}"

    def _test_sorts(self, name: str) -> Callable[[], str]:
        sorts = self._sorts[name]
        return lambda: " and ".join(
            f"v_{name} in {self.name_constant(self._members(sort))}" for sort in sorts
        )

    def _collect_comparison(self, comparison: Comparison) -> None:
        left, right, relation = comparison.left, comparison.right, comparison.relation

        def test() -> str:
            if relation in ("=", "!="):
                return f"{self._write(left)} {'==' if relation == '=' else '!='} {self._write(right)}"
            return f"compare_values({self._write(left)}, {relation!r}, {self._write(right)})"

        self._tests.append((find_variables(left) | find_variables(right), test))
        if relation == "=":
            for side, other in ((left, right), (right, left)):
                if isinstance(side, Variable):
                    self._equations.append((side.name, other, test))

    def _collect_fact(self, literal: Literal) -> None:
        table = self._facts[literal.term.name]

        def test() -> str:
            key = "".join(f"{self._write(argument)}, " for argument in literal.term.arguments)
            fact = f"{self.name_constant(table)}.get(({key}))"
            value = self._write(literal.value)
            agrees = f"(h := {fact}) is not None and compare_values(h, {literal.relation!r}, {value})"
            return f"not ({agrees})" if literal.negated else agrees

        self._tests.append((find_variables(literal.term) | find_variables(literal.value), test))
        if not literal.negated and literal.relation == "=":
            self._fact_literals.append(literal)

    # the order in which variables are bound

    def _add_ready_tests(self) -> None:
        """Add the tests whose variables are all bound."""
        waiting = []
        for needed, test in self._tests:
            if needed <= self._bound:
                self.add_line(f"if not ({test()}): {'continue' if self._depth > 1 else 'return'}")
            else:
                waiting.append((needed, test))
        self._tests = waiting

    def _mark_bound(self, names: Iterable[str], *, checked: bool = False) -> None:
        for name in names:
            if name not in self._bound:
                self._bound.add(name)
                if name in self._sorts and not checked:
                    self._tests.append(({name}, self._test_sorts(name)))
        self._add_ready_tests()

    def _open_loop(self, targets: str, iterable: str) -> None:
        self.add_line(f"for {targets} in {iterable}:")
        self._depth += 1

    def _bind_next_variable(self) -> None:
        """Bind by an equation if possible, otherwise by facts, the smallest sort or a record."""
        for name, other, test in self._equations:
            if name not in self._bound and find_variables(other) <= self._bound:
                self._tests = [pair for pair in self._tests if pair[1] is not test]  # true by construction
                self.add_line(f"v_{name} = {self._write(other)}")
                self._mark_bound([name])
                return
        for literal in self._fact_literals:
            if find_bare_variables(literal) - self._bound and find_inner_variables(literal) <= self._bound:
                self._loop_over_facts(literal)
                return
        free = [name for name in self._sorts if name not in self._bound]
        if free:
            name = min(free, key=lambda name: (self._has_equation(name), len(self._list_domain(name))))
            domain = self._list_domain(name)
            if len(domain) == 1:  # Python allows at most twenty nested loops
                self.add_line(f"v_{name} = {domain[0]!r}")
            else:
                self._open_loop(f"v_{name}", self.name_constant(domain))
            self._mark_bound([name], checked=True)
            return
        for term, sort in self._records:
            if find_variables(term) - self._bound and find_arithmetic_variables(term) <= self._bound:
                self._loop_over_records(term, sort)
                return
        raise AssertionError("the checker rejects statements with unsafe variables")

    def _has_equation(self, name: str) -> bool:
        """Whether an equation binds this variable once other variables are bound."""
        return any(
            target == name and not find_variables(other) <= {name} for target, other, _ in self._equations
        )

    def _list_domain(self, name: str) -> list[Value]:
        first, *others = (self._members(sort) for sort in self._sorts[name])
        if not others:
            return list(first)
        return [member for member in first if all(member in other for other in others)]

    def _loop_over_facts(self, literal: Literal) -> None:
        """Bind variables to the facts that agree with the bound positions, through an index over these."""
        parts = (*literal.term.arguments, literal.value)
        bound = [i for i, part in enumerate(parts) if find_variables(part) <= self._bound]
        free: dict[str, int] = {}
        repeated: list[tuple[int, str]] = []
        for i, part in enumerate(parts):
            if i not in bound and isinstance(part, Variable):
                if part.name in free:
                    repeated.append((i, part.name))
                else:
                    free[part.name] = i
        index: dict[tuple[Value, ...], list[tuple[Value, ...]]] = {}
        for arguments, value in self._facts[literal.term.name].items():
            row = (*arguments, value)
            if all(row[i] == row[free[name]] for i, name in repeated):
                key = tuple([row[i] for i in bound])
                index.setdefault(key, []).append(tuple([row[i] for i in free.values()]))
        key_source = "".join(f"{self._write(parts[i])}, " for i in bound)
        targets = "".join(f"v_{name}, " for name in free)
        self._open_loop(targets, f"{self.name_constant(index)}.get(({key_source}), ())")
        self._mark_bound(free)

    def _loop_over_records(self, term: Term, sort: str) -> None:
        """Bind the variables of a record to the members of a sort that match it."""
        names = sorted(find_variables(term))
        free = [name for name in names if name not in self._bound]
        bound = [name for name in names if name in self._bound and name in find_matched_variables(term)]
        index: dict[tuple[Value, ...], list[tuple[Value, ...]]] = {}
        for member in self._members(sort):
            bindings: dict[str, Value] = {}
            if match(term, member, bindings):
                key = tuple([bindings[name] for name in bound])
                index.setdefault(key, []).append(tuple([bindings[name] for name in free]))
        key_source = "".join(f"v_{name}, " for name in bound)
        targets = "".join(f"v_{name}, " for name in free)
        self._open_loop(targets, f"{self.name_constant(index)}.get(({key_source}), ())")
        self._mark_bound(free)
