"""All ways to give values to the variables of a statement, as a Python function made for that statement.

The function is nested loops over sorts and facts, cut short by each condition as soon as its variables have
values; what it does for each way is up to the grounder. Made from source text, it runs faster than closures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from lcorpp.reasoning.grounding.values import (
    Value,
    computed,
    divide,
    holds,
    matched,
    matches,
    names_of,
    nested,
    plain_names,
    value_of,
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
"""Attribute -> arguments -> value, of the attributes that are given by facts alone."""


class Source(str):
    """Python source of an expression; anything else that stands in its place is the value itself."""

    __slots__ = ()


Part = Source | Value


class RuleInstantiator:
    """The ways to bind the variables of one statement.

    Args:
        members: gives the members of a sort.
        slots, scope: as `safety.check_scope` takes them; each variable is held to the sorts of its slots.
        body: its comparisons, sort literals and literals of fact attributes are used here.
        facts: the attributes that are given by facts alone.
        bound: variables that already have values, the arguments of the function.
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
        self._facts, self._bound = facts, tuple(bound)
        used = [variable for expression in scope for variable in iter_variables(expression)]
        self._sorts = variable_sorts(slots, used, signature)
        self._known = set(bound)
        self._lines: list[str] = []
        self._depth = 1
        self._names: dict[str, Any] = {"divide": divide, "holds": holds}
        self._tests: list[tuple[set[str], Callable[[], str]]] = []
        self._equations: list[tuple[str, Expression, Callable[[], str]]] = []
        self._records: list[tuple[Term, str]] = []
        self._given: list[Literal] = []
        if not used:
            self._collect(slots, body)
            self._test_bound()
            return
        self._collect(slots, body)
        for name in bound:
            if name in self._sorts:
                self._tests.append(({name}, self._membership(name)))
        self._test_bound()
        while not all(variable.name in self._known for variable in used):
            self._bind_next()

    @property
    def is_ground(self) -> bool:
        """Whether there is exactly one way, with nothing to bind and nothing to test."""
        return not self._lines and not self._bound

    def add(self, line: str) -> None:
        """Append a line that runs once for each way."""
        self._lines.append(" " * self._depth + line)

    def name(self, value: object) -> Source:
        """A name under which the function knows a value."""
        name = f"k{len(self._names)}"
        self._names[name] = value
        return Source(name)

    def part(self, expression: Expression) -> Part:
        """The value of an expression, or the source that computes it from variables with values."""
        if isinstance(expression, Variable):
            return Source(f"v_{expression.name}")
        if isinstance(expression, Number) or not any(iter_variables(expression)):
            return value_of(canonical_text(expression))
        if isinstance(expression, Term):
            inner = " + ',' + ".join(f"str({self.source(argument)})" for argument in expression.arguments)
            return Source(f"({expression.name + '('!r} + {inner} + ')')")
        left, right = self.source(expression.left), self.source(expression.right)
        if expression.operator in ("/", "mod"):
            place = self.name(expression.at)
            return Source(f"divide({left}, {right}, {expression.operator!r}, {place})")
        return Source(f"({left} {expression.operator} {right})")

    def source(self, expression: Expression) -> str:
        """The same as `part`, always as source."""
        return self.written(self.part(expression))

    def written(self, part: Part) -> str:
        """The source of a part."""
        if isinstance(part, int) and part.bit_length() > 64:  # a set of many values
            return self.name(part)
        return str(part) if isinstance(part, Source) else repr(part)

    def function(self, **names: object) -> Callable[..., None]:
        """The function; its arguments are the bound variables. `names` are those that added lines use."""
        arguments = ", ".join(f"v_{name}" for name in self._bound)
        text = "\n".join([f"def run({arguments}):", *self._lines, " pass"])
        space: dict[str, Any] = {**self._names, **names}
        exec(compile(text, "<join>", "exec"), space)
        return space["run"]  # type: ignore[no-any-return]

    # what restricts the variables

    def _sort(self, name: str) -> Mapping[Value, None]:
        return self._members(name)

    def _collect(self, slots: Sequence[Slot], body: Iterable[Literal | Comparison]) -> None:
        for expression, sort in slots:
            if isinstance(expression, Variable) or not any(iter_variables(expression)):
                continue
            self._tests.append((names_of(expression), self._member(expression, sort, "in")))
            if isinstance(expression, Term):
                self._records.append((expression, sort))
        for literal in body:
            if isinstance(literal, Comparison):
                self._compare(literal)
            elif self._signature.is_sort(literal):
                inner = literal.term.arguments[0]
                relation = "not in" if literal.negated else "in"
                self._tests.append((names_of(inner), self._member(inner, literal.term.name, relation)))
            elif literal.term.name in self._facts:
                self._fact(literal)

    def _member(self, expression: Expression, sort: str, relation: str) -> Callable[[], str]:
        return lambda: f"{self.source(expression)} {relation} {self.name(self._sort(sort))}"

    def _membership(self, name: str) -> Callable[[], str]:
        sorts = self._sorts[name]
        return lambda: " and ".join(f"v_{name} in {self.name(self._sort(sort))}" for sort in sorts)

    def _compare(self, comparison: Comparison) -> None:
        left, right, relation = comparison.left, comparison.right, comparison.relation
        if relation in ("=", "!="):
            sign = "==" if relation == "=" else "!="
            test: Callable[[], str] = lambda: f"{self.source(left)} {sign} {self.source(right)}"  # noqa: E731
        else:
            test = lambda: f"holds({self.source(left)}, {relation!r}, {self.source(right)})"  # noqa: E731
        self._tests.append((names_of(left) | names_of(right), test))
        if relation == "=":
            for side, other in ((left, right), (right, left)):
                if isinstance(side, Variable):
                    self._equations.append((side.name, other, test))

    def _fact(self, literal: Literal) -> None:
        table = self._facts[literal.term.name]

        def test() -> str:
            key = "".join(f"{self.source(argument)}, " for argument in literal.term.arguments)
            has = f"{self.name(table)}.get(({key}))"
            value = self.source(literal.value)
            said = f"(h := {has}) is not None and holds(h, {literal.relation!r}, {value})"
            return f"not ({said})" if literal.negated else said

        self._tests.append((names_of(literal.term) | names_of(literal.value), test))
        if not literal.negated and literal.relation == "=":
            self._given.append(literal)

    # the order in which variables are bound

    def _test_bound(self) -> None:
        left = []
        for needed, test in self._tests:
            if needed <= self._known:
                self.add(f"if not ({test()}): {'continue' if self._depth > 1 else 'return'}")
            else:
                left.append((needed, test))
        self._tests = left

    def _learn(self, names: Iterable[str], *, checked: bool = False) -> None:
        for name in names:
            if name not in self._known:
                self._known.add(name)
                if name in self._sorts and not checked:
                    self._tests.append(({name}, self._membership(name)))
        self._test_bound()

    def _loop(self, targets: str, over: str) -> None:
        self.add(f"for {targets} in {over}:")
        self._depth += 1

    def _bind_next(self) -> None:
        for name, other, test in self._equations:
            if name not in self._known and names_of(other) <= self._known:
                self._tests = [pair for pair in self._tests if pair[1] is not test]  # it holds from now on
                self.add(f"v_{name} = {self.source(other)}")
                self._learn([name])
                return
        for literal in self._given:
            if plain_names(literal) - self._known and computed(literal) <= self._known:
                self._match_facts(literal)
                return
        free = [name for name in self._sorts if name not in self._known]
        if free:
            name = min(free, key=lambda name: (self._waits(name), len(self._domain(name))))
            domain = self._domain(name)
            if len(domain) == 1:  # Python nests at most twenty loops
                self.add(f"v_{name} = {domain[0]!r}")
            else:
                self._loop(f"v_{name}", self.name(domain))
            self._learn([name], checked=True)
            return
        for term, sort in self._records:
            if names_of(term) - self._known and nested(term) <= self._known:
                self._match_records(term, sort)
                return
        raise AssertionError("the checker lets no unsafe variable pass")

    def _waits(self, name: str) -> bool:
        """Whether an equation gives this variable once others are bound."""
        return any(target == name and not names_of(other) <= {name} for target, other, _ in self._equations)

    def _domain(self, name: str) -> list[Value]:
        first, *others = (self._sort(sort) for sort in self._sorts[name])
        if not others:
            return list(first)
        return [member for member in first if all(member in other for other in others)]

    def _match_facts(self, literal: Literal) -> None:
        """Bind variables to the facts that agree with what is bound, found by an index over those places."""
        parts = (*literal.term.arguments, literal.value)
        known = [i for i, part in enumerate(parts) if names_of(part) <= self._known]
        free: dict[str, int] = {}
        again: list[tuple[int, str]] = []
        for i, part in enumerate(parts):
            if i not in known and isinstance(part, Variable):
                if part.name in free:
                    again.append((i, part.name))
                else:
                    free[part.name] = i
        index: dict[tuple[Value, ...], list[tuple[Value, ...]]] = {}
        for arguments, value in self._facts[literal.term.name].items():
            row = (*arguments, value)
            if all(row[i] == row[free[name]] for i, name in again):
                key = tuple([row[i] for i in known])
                index.setdefault(key, []).append(tuple([row[i] for i in free.values()]))
        key_source = "".join(f"{self.source(parts[i])}, " for i in known)
        targets = "".join(f"v_{name}, " for name in free)
        self._loop(targets, f"{self.name(index)}.get(({key_source}), ())")
        self._learn(free)

    def _match_records(self, term: Term, sort: str) -> None:
        """Bind the variables of a record to those members of a sort that have its shape."""
        names = sorted(names_of(term))
        free = [name for name in names if name not in self._known]
        known = [name for name in names if name in self._known]
        index: dict[tuple[Value, ...], list[tuple[Value, ...]]] = {}
        for member in self._sort(sort):
            seen: dict[str, Value] = {}
            if matches(term, member, seen):
                told = [name for name in known if name in seen]
                key = tuple([seen[name] for name in told])
                index.setdefault(key, []).append(tuple([seen[name] for name in free]))
        told = [name for name in known if name in matched(term)]
        key_source = "".join(f"v_{name}, " for name in told)
        self._loop("".join(f"v_{name}, " for name in free), f"{self.name(index)}.get(({key_source}), ())")
        self._learn(free)
