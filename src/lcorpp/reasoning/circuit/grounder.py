"""From a program to its ground clauses: each statement with its variables replaced in every way their sorts
allow.

It needs no solver and keeps what a solver would throw away, the probabilities. `grounding.py` is the other,
independent way from a program to its worlds; the two are tested against each other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from lcorpp.errors import ProgramError
from lcorpp.reasoning.arithmetic import exact, ground, variables
from lcorpp.reasoning.circuit.ground import Clause, Ground, Kind
from lcorpp.reasoning.circuit.ground import Literal as GroundLiteral
from lcorpp.reasoning.circuit.joins import (
    Bindings,
    Facts,
    Join,
    Reader,
    Value,
    holds,
    reader,
    split,
    value_of,
)
from lcorpp.reasoning.offence import Offence
from lcorpp.reasoning.program import Program
from lcorpp.reasoning.signature import expressions, pr_variables, scope
from lcorpp.reasoning.syntax import (
    Comparison,
    Expression,
    Intervention,
    Literal,
    Number,
    Observation,
    Probability,
    Rule,
    Selection,
    Term,
)

Body = Sequence[Literal | Comparison]

Key = Value | tuple[Value, ...]
"""The arguments of a term; one alone stands for itself."""


ASKED = "?"
"""The name of the term that has the value true where all literals that are asked for hold."""


def ground_program(
    program: Program, do: Mapping[str, str], observed: Iterable[Literal] = (), asked: Sequence[Literal] = ()
) -> Ground:
    """Ground a program.

    Args:
        do: interventions beside those in the program, term -> value.
        observed: ground literals without which there is no world, beside the observations in the program.
        asked: ground literals for which the term `ASKED` is to stand.

    Raises:
        ProgramError: arithmetic is undefined.
    """
    try:
        return _Grounder(program, do).all(observed, asked)
    except Offence as offence:
        raise ProgramError(str(offence)) from None


class _Grounder:
    def __init__(self, program: Program, do: Mapping[str, str]) -> None:
        self.program, self.signature = program, program.signature
        self.ground = Ground(program)
        self._ids: dict[str, dict[Key, int]] = {name: {} for name in self.signature.attributes}
        self._masks: dict[tuple[str, str, bool], dict[Value, int]] = {}
        self._do = dict(do)
        for statement in program.statements:
            if isinstance(statement, Intervention):
                self._set(ground(statement.term), ground(statement.value))
        self._facts = self._given()

    def _set(self, term: str, value: str) -> None:
        if self._do.setdefault(term, value) != value:
            self._add(Clause(Kind.FORBID, -1, 0, ()))  # two values set: no world has both

    def all(self, observed: Iterable[Literal], asked: Sequence[Literal]) -> Ground:
        for term, value in self._do.items():
            name = term.partition("(")[0]
            found = self.term(name, _key([value_of(a) for a in split(term)[1]]))
            self.ground.do[found] = self.signature.attributes[name].values.index(value)
        for index, statement in enumerate(self.program.statements):
            if isinstance(statement, Rule):
                self._rule(index, statement)
            elif isinstance(statement, Selection):
                self._selection(index, statement)
            elif isinstance(statement, Probability):
                self._probability(index, statement)
            elif isinstance(statement, Observation):
                self._forbid_unless(statement.literal)
        for literal in observed:
            self._forbid_unless(literal)
        if asked:
            body = tuple([self._literal(literal, {})() for literal in asked])
            self._add(Clause(Kind.DERIVE, len(self.ground.names), 0, body))
            self.ground.names.append(ASKED)
            self.ground.values.append(("true",))
        return self.ground

    def term(self, attribute: str, key: Key) -> int:
        """The number of a term, a new one if it was not met before."""
        ids = self._ids[attribute]
        found = ids.get(key)
        if found is None:
            found = ids[key] = len(self.ground.values)
            arguments = key if isinstance(key, tuple) else (key,)
            text = f"{attribute}({','.join(map(str, arguments))})" if arguments else attribute
            self.ground.names.append(text)
            self.ground.values.append(self.signature.attributes[attribute].values)
        return found

    def _add(self, clause: Clause) -> None:
        self.ground.clauses.append(clause)

    # facts

    def _given(self) -> Facts:
        """The attributes that nothing but facts speaks of, and those facts."""
        other = {t.partition("(")[0] for t in self._do}
        heads: dict[str, list[Rule]] = {}
        for statement in self.program.statements:
            if isinstance(statement, Selection):
                other.add(statement.term.name)
            elif isinstance(statement, Rule) and statement.head:
                heads.setdefault(statement.head.term.name, []).append(statement)
                if any(isinstance(x, Literal) and not self.signature.is_sort(x) for x in statement.body):
                    other.add(statement.head.term.name)
        facts: Facts = {}
        for name, rules in heads.items():
            if name not in other:
                facts[name] = {}
                for rule in rules:
                    self._collect(rule, facts[name])
        return facts

    def _collect(self, rule: Rule, table: dict[tuple[Value, ...], Value]) -> None:
        assert rule.head
        join = self._join(rule, rule.body, {})
        arguments, value = [reader(a) for a in rule.head.term.arguments], reader(rule.head.value)
        b = join.bindings

        def emit() -> None:
            table[tuple([argument(b) for argument in arguments])] = value(b)

        join.run(emit)

    # statements

    def _join(self, statement: Rule | Selection | Probability, body: Body, facts: Facts) -> Join:
        slots = list(self.signature.slots(statement))
        return Join(self.signature, slots, scope(statement), body, facts)

    def _rule(self, index: int, rule: Rule) -> None:
        join = self._join(rule, rule.body, self._facts)
        body = self._body(rule.body, join.bindings)
        if rule.head is None:
            join.run(lambda: self._add(Clause(Kind.FORBID, -1, 0, body(), index)))
            return
        head = self._outcome(rule.head.term, rule.head.value, join.bindings)

        def emit() -> None:
            term, value = head()
            self._add(Clause(Kind.DERIVE, term, value, body(), index))

        join.run(emit)

    def _selection(self, index: int, selection: Selection) -> None:
        join = self._join(selection, selection.body, self._facts)
        b = join.bindings
        term_of, body = self._term(selection.term, b), self._body(selection.body, b)
        labels = [reader(a) for a in (selection.label.arguments if selection.label else ())]
        inner = list(expressions(selection.range.condition)) if selection.range else []
        told = _names((*inner, selection.term, *(selection.label.arguments if selection.label else ())))
        shared = sorted(told & _names(scope(selection)))
        instances: dict[tuple[Value, ...], int] = {}

        def emit() -> None:
            term, instance = term_of(), tuple([b[name] for name in shared])
            instances[instance] = term
            label = ",".join([str(read(b)) for read in labels]) if labels else ""
            self._add(Clause(Kind.SELECT, term, 0, body(), index, label, instance))

        join.run(emit)
        if selection.range:
            self._range(index, selection, shared, instances)

    def _range(
        self, index: int, selection: Selection, shared: list[str], instances: dict[tuple[Value, ...], int]
    ) -> None:
        assert selection.range
        variable, condition = selection.range.variable, selection.range.condition
        slots = list(self.signature.range_slots(selection))
        join = Join(
            self.signature,
            slots,
            [variable, *expressions(condition)],
            condition,
            self._facts,
            frozenset(shared),
        )
        b, body = join.bindings, self._body(condition, join.bindings)
        values = self._numbers(selection.term.name)
        for instance, term in instances.items():
            b.update(zip(shared, instance, strict=True))
            join.run(
                lambda term=term, instance=instance: self._add(  # type: ignore[misc]
                    Clause(Kind.RANGE, term, values[b[variable.name]], body(), index, "", instance)
                )
            )

    def _probability(self, index: int, atom: Probability) -> None:
        join = self._join(atom, atom.condition, self._facts)
        b = join.bindings
        outcome, body = self._outcome(atom.term, atom.value, b), self._body(atom.condition, b)
        labels = [reader(a) for a in (atom.label.arguments if atom.label else ())]
        names = pr_variables(atom)
        number = atom.number.value if isinstance(atom.number, Number) else None

        def emit() -> None:
            term, value = outcome()
            given = exact(atom.number, {name: str(b[name]) for name in names}) if number is None else number
            label = ",".join([str(read(b)) for read in labels]) if labels else ""
            instance = tuple([b[name] for name in names])
            self._add(Clause(Kind.ASSIGN, term, value, body(), index, label, instance, given))

        join.run(emit)

    def _forbid_unless(self, literal: Literal) -> None:
        term, allowed, negated = self._literal(literal, {})()
        everything = (1 << len(self.ground.values[term]) + 1) - 1
        self._add(Clause(Kind.FORBID, -1, 0, ((term, everything & ~allowed, not negated),)))

    # parts of statements

    def _term(self, term: Term, b: Bindings) -> Callable[[], int]:
        name, parts = term.name, [reader(argument) for argument in term.arguments]
        if not any(variables(term)):
            number = self.term(name, _key([part(b) for part in parts]))
            return lambda: number
        known, new = self._ids[name].get, self.term
        if len(parts) == 1:
            only = parts[0]

            def find_by_one() -> int:
                key = only(b)
                found = known(key)
                return new(name, key) if found is None else found

            return find_by_one

        def find() -> int:
            key = tuple([part(b) for part in parts])
            found = known(key)
            return new(name, key) if found is None else found

        return find

    def _numbers(self, attribute: str) -> dict[Value, int]:
        values = self.signature.attributes[attribute].values
        return {value_of(value): i for i, value in enumerate(values)}

    def _outcome(self, term: Term, value: Expression, b: Bindings) -> Callable[[], tuple[int, int]]:
        find, read, numbers = self._term(term, b), reader(value), self._numbers(term.name)
        if any(variables(value)):
            return lambda: (find(), numbers[read(b)])
        only = numbers[read(b)]
        return lambda: (find(), only)

    def _body(self, body: Body, b: Bindings) -> Callable[[], tuple[GroundLiteral, ...]]:
        literals = [
            self._literal(literal, b)
            for literal in body
            if isinstance(literal, Literal)
            and not self.signature.is_sort(literal)
            and literal.term.name not in self._facts
        ]
        if not literals:
            return tuple
        if len(literals) == 1:
            only = literals[0]
            return lambda: (only(),)
        return lambda: tuple([literal() for literal in literals])

    def _literal(self, literal: Literal, b: Bindings) -> Callable[[], GroundLiteral]:
        find, negated = self._term(literal.term, b), literal.negated
        read: Reader = reader(literal.value)
        if not any(variables(literal.value)):
            always = self._allowed(literal, read(b))
            return lambda: (find(), always, negated)
        masks = self._masks.setdefault((literal.term.name, literal.relation, negated), {})

        def make() -> GroundLiteral:
            value = read(b)
            allowed = masks.get(value)
            if allowed is None:
                allowed = masks[value] = self._allowed(literal, value)
            return find(), allowed, negated

        return make

    def _allowed(self, literal: Literal, value: Value) -> int:
        numbers = self._numbers(literal.term.name)
        allowed = 0
        for has, i in numbers.items():
            if holds(has, literal.relation, value):
                allowed |= 1 << i
        return ((1 << len(numbers) + 1) - 1) & ~allowed if literal.negated else allowed


def _key(arguments: Sequence[Value]) -> Key:
    return arguments[0] if len(arguments) == 1 else tuple(arguments)


def _names(parts: Iterable[Expression]) -> set[str]:
    return {variable.name for part in parts for variable in variables(part)}
