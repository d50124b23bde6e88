"""All ways to give values to the variables of a statement: loops over sorts, cut short early."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import ge, gt, itemgetter, le, lt
from typing import cast

from lcorpp.reasoning.arithmetic import ground, is_integer, variables
from lcorpp.reasoning.offence import Offence
from lcorpp.reasoning.safety import variable_sorts
from lcorpp.reasoning.signature import Signature, Slot
from lcorpp.reasoning.syntax import Arithmetic, Comparison, Expression, Literal, Number, Term, Variable

Value = int | str
"""A value: integers as such, constants and records as text."""

Bindings = dict[str, Value]
"""Variable -> value."""

Reader = Callable[[Bindings], Value]
"""Gives the value of an expression under bindings."""

Run = Callable[[], None]

Facts = dict[str, dict[tuple[Value, ...], Value]]
"""Attribute -> arguments -> value, of the attributes that are given by facts alone."""


def reader(expression: Expression) -> Reader:
    """A function that evaluates an expression.

    Raises:
        Offence: (from the function) a division by zero.
    """
    if isinstance(expression, Variable):
        return itemgetter(expression.name)
    if isinstance(expression, Number) or not any(variables(expression)):
        constant = value_of(ground(expression))
        return lambda b: constant
    if isinstance(expression, Term):
        parts = [reader(argument) for argument in expression.arguments]
        start = expression.name + "("
        return lambda b: start + ",".join([str(part(b)) for part in parts]) + ")"
    return _arithmetic(expression)


def value_of(text: str) -> Value:
    """The value that a canonical text stands for."""
    return int(text) if is_integer(text) else text


def holds(left: Value, relation: str, right: Value) -> bool:
    """Whether a relation holds between two values; order is that of integers, false elsewhere."""
    if relation == "=":
        return left == right
    if relation == "!=":
        return left != right
    if isinstance(left, str) or isinstance(right, str):
        return False
    return _ORDER[relation](left, right)


_ORDER: dict[str, Callable[[int, int], bool]] = {"<": lt, "<=": le, ">": gt, ">=": ge}


def _arithmetic(expression: Arithmetic) -> Reader:
    # the checker lets only integers into arithmetic
    left = cast(Callable[[Bindings], int], reader(expression.left))
    right = cast(Callable[[Bindings], int], reader(expression.right))
    operator = expression.operator
    if (
        operator in ("+", "-")
        and isinstance(expression.left, Variable)
        and isinstance(expression.right, Number)
    ):
        name, step = expression.left.name, int(ground(expression.right)) * (1 if operator == "+" else -1)
        return lambda b: b[name] + step  # type: ignore[operator]  # the form that most programs use
    if operator == "+":
        return lambda b: left(b) + right(b)
    if operator == "-":
        return lambda b: left(b) - right(b)
    if operator == "*":
        return lambda b: left(b) * right(b)

    def divide(b: Bindings) -> int:
        over, under = left(b), right(b)
        if under == 0:
            raise Offence(expression.at, f"cannot be grounded: division by zero in {expression}")
        quotient = abs(over) // abs(under) * (-1 if (over < 0) != (under < 0) else 1)
        return quotient if operator == "/" else over - under * quotient

    return divide


def split(value: str) -> tuple[str, tuple[str, ...]]:
    """The name and the arguments of a record, ``f(1,g(a))`` to ``("f", ("1", "g(a)"))``."""
    name, bracket, rest = value.partition("(")
    if not bracket:
        return value, ()
    found, depth, begin = [], 0, 0
    for end, letter in enumerate(rest):
        if letter == "(":
            depth += 1
        elif letter == ")" and depth:
            depth -= 1
        elif letter in ",)" and not depth:
            found.append(rest[begin:end])
            begin = end + 1
    return name, tuple(found)


@dataclass
class Join:
    """The ways to bind the variables of one statement.

    slots, scope: as `safety.check_scope` takes them; each variable is held to the sorts of its slots.
    body: its comparisons, sort literals and literals of fact attributes are used here.
    facts: the attributes that are given by facts alone.
    bound: variables that already have values.
    """

    signature: Signature
    slots: Sequence[Slot]
    scope: Sequence[Expression]
    body: Iterable[Literal | Comparison]
    facts: Facts
    bound: frozenset[str] = frozenset()
    bindings: Bindings = field(default_factory=dict)

    def __post_init__(self) -> None:
        used = [variable for expression in self.scope for variable in variables(expression)]
        self._members: dict[str, dict[Value, None]] = {}
        self._sorts = variable_sorts(self.slots, used, self.signature)
        self._known = set(self.bound)
        self._steps: list[Callable[[Run], Run]] = []
        self._tests: list[tuple[set[str], Callable[[Bindings], bool]]] = []
        self._equations: list[tuple[str, Expression]] = []
        self._records: list[tuple[Term, str]] = []
        self._given: list[Literal] = []
        self._collect()
        self._test_bound()
        while not self._complete(used):
            self._bind_next()

    def run(self, emit: Run) -> None:
        """Call `emit` once for each way to bind the variables, with `bindings` filled."""
        for step in reversed(self._steps):
            emit = step(emit)
        emit()

    def _sort(self, name: str) -> dict[Value, None]:
        if name not in self._members:
            self._members[name] = {value_of(text): None for text in self.signature.sorts[name]}
        return self._members[name]

    # what restricts the variables

    def _collect(self) -> None:
        for expression, sort in self.slots:
            if isinstance(expression, Variable) or not any(variables(expression)):
                continue
            self._tests.append((_names(expression), _member(expression, self._sort(sort), True)))
            if isinstance(expression, Term):
                self._records.append((expression, sort))
        for literal in self.body:
            if isinstance(literal, Comparison):
                self._compare(literal)
            elif self.signature.is_sort(literal):
                inner = literal.term.arguments[0]
                member = _member(inner, self._sort(literal.term.name), not literal.negated)
                self._tests.append((_names(inner), member))
            elif literal.term.name in self.facts:
                self._fact(literal)
        for name in self._known & self._sorts.keys():
            self._tests.append(({name}, self._membership(name)))

    def _membership(self, name: str) -> Callable[[Bindings], bool]:
        members = [self._sort(sort) for sort in self._sorts[name]]
        return lambda b: all(b[name] in m for m in members)

    def _compare(self, comparison: Comparison) -> None:
        left, right, relation = reader(comparison.left), reader(comparison.right), comparison.relation
        needed = _names(comparison.left) | _names(comparison.right)
        self._tests.append((needed, lambda b: holds(left(b), relation, right(b))))
        if relation == "=":
            for side, other in (
                (comparison.left, comparison.right),
                (comparison.right, comparison.left),
            ):
                if isinstance(side, Variable):
                    self._equations.append((side.name, other))

    def _fact(self, literal: Literal) -> None:
        table = self.facts[literal.term.name]
        arguments = [reader(argument) for argument in literal.term.arguments]
        value, relation, negated = reader(literal.value), literal.relation, literal.negated

        def test(b: Bindings) -> bool:
            has = table.get(tuple([argument(b) for argument in arguments]))
            return negated != (has is not None and holds(has, relation, value(b)))

        self._tests.append((_names(literal.term) | _names(literal.value), test))
        if not negated and relation == "=":
            self._given.append(literal)

    # the order in which variables are bound

    def _complete(self, used: Iterable[Variable]) -> bool:
        return all(variable.name in self._known for variable in used)

    def _add(self, step: Callable[[Run], Run], names: Iterable[str]) -> None:
        self._steps.append(step)
        for name in names:
            if name not in self._known:
                self._known.add(name)
                if name in self._sorts:
                    self._tests.append(({name}, self._membership(name)))
        self._test_bound()

    def _test_bound(self) -> None:
        for needed, test in [t for t in self._tests if t[0] <= self._known]:
            self._tests.remove((needed, test))
            self._steps.append(self._filter(test))

    def _filter(self, test: Callable[[Bindings], bool]) -> Callable[[Run], Run]:
        def step(then: Run) -> Run:
            b = self.bindings

            def run() -> None:
                if test(b):
                    then()

            return run

        return step

    def _bind_next(self) -> None:
        for name, other in self._equations:
            if name not in self._known and _names(other) <= self._known:
                read = reader(other)
                self._add(self._each(name, lambda b, read=read: (read(b),)), [name])  # type: ignore[misc]
                return
        for literal in self._given:
            if self._pattern_names(literal) - self._known and self._computed(literal) <= self._known:
                self._match_facts(literal)
                return
        free = [name for name in self._sorts if name not in self._known]
        if free:
            name = min(free, key=lambda name: (self._helps(name), len(self._domain(name))))
            domain = self._domain(name)
            self._known.add(name)
            self._steps.append(self._each(name, lambda b: domain))
            self._test_bound()
            return
        for term, sort in self._records:
            if _names(term) - self._known and self._nested(term) <= self._known:
                self._match_records(term, sort)
                return
        raise AssertionError("the checker lets no unsafe variable pass")

    def _helps(self, name: str) -> bool:
        """Whether an equation would give this variable once others are bound: such a variable waits."""
        return any(target == name and not _names(other) <= {name} for target, other in self._equations)

    def _domain(self, name: str) -> list[Value]:
        first, *others = (self._sort(sort) for sort in self._sorts[name])
        if not others:
            return list(first)
        return [member for member in first if all(member in other for other in others)]

    def _each(self, name: str, domain: Callable[[Bindings], Iterable[Value]]) -> Callable[[Run], Run]:
        def step(then: Run) -> Run:
            b = self.bindings

            def run() -> None:
                for value in domain(b):
                    b[name] = value
                    then()

            return run

        return step

    # matching

    @staticmethod
    def _computed(literal: Literal) -> set[str]:
        """The variables under arithmetic or in records: matching a fact cannot give them."""
        parts = (*literal.term.arguments, literal.value)
        return {v for part in parts if not isinstance(part, Variable) for v in _names(part)}

    @staticmethod
    def _pattern_names(literal: Literal) -> set[str]:
        return {p.name for p in (*literal.term.arguments, literal.value) if isinstance(p, Variable)}

    @staticmethod
    def _nested(term: Term) -> set[str]:
        """The variables under arithmetic in a record: matching cannot give them."""
        found: set[str] = set()
        for part in term.arguments:
            if isinstance(part, Arithmetic):
                found |= _names(part)
            elif isinstance(part, Term):
                found |= Join._nested(part)
        return found

    def _match_facts(self, literal: Literal) -> None:
        """Bind variables to the facts that agree with what is bound, found by an index over those places."""
        parts = (*literal.term.arguments, literal.value)
        known = [i for i, part in enumerate(parts) if _names(part) <= self._known]
        free = [(i, p.name) for i, p in enumerate(parts) if isinstance(p, Variable) and i not in known]
        index: dict[tuple[Value, ...], list[tuple[Value, ...]]] = {}
        for arguments, value in self.facts[literal.term.name].items():
            row = (*arguments, value)
            index.setdefault(tuple([row[i] for i in known]), []).append(row)
        readers = [reader(parts[i]) for i in known]

        def step(then: Run) -> Run:
            b = self.bindings

            def run() -> None:
                for row in index.get(tuple([read(b) for read in readers]), ()):
                    seen: Bindings = {}
                    if all(seen.setdefault(name, row[i]) == row[i] for i, name in free):
                        b.update(seen)
                        then()

            return run

        self._add(step, [name for _, name in free])

    def _match_records(self, term: Term, sort: str) -> None:
        """Bind the variables of a record to those members of a sort that have its shape."""
        members = list(self._sort(sort))
        names = _names(term)
        known = frozenset(self._known)

        def step(then: Run) -> Run:
            b = self.bindings

            def run() -> None:
                for member in members:
                    seen: Bindings = {name: b[name] for name in names & known}
                    if _match(term, member, seen):
                        b.update(seen)
                        then()

            return run

        self._add(step, sorted(names))


def _match(pattern: Expression, value: Value, seen: Bindings) -> bool:
    if isinstance(pattern, Variable):
        return seen.setdefault(pattern.name, value) == value
    if isinstance(pattern, Term) and pattern.arguments:
        if isinstance(value, int):
            return False
        name, arguments = split(value)
        return (
            name == pattern.name
            and len(arguments) == len(pattern.arguments)
            and all(_match(p, value_of(a), seen) for p, a in zip(pattern.arguments, arguments, strict=True))
        )
    return reader(pattern)(seen) == value


def _member(
    expression: Expression, members: Mapping[Value, None], wanted: bool
) -> Callable[[Bindings], bool]:
    read = reader(expression)
    return lambda b: (read(b) in members) == wanted


def _names(expression: Expression) -> set[str]:
    return {variable.name for variable in variables(expression)}
