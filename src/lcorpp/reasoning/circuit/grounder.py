"""From a program to its ground clauses: each statement with its variables replaced in every way their sorts
allow.

It needs no solver and keeps what a solver would throw away, the probabilities. `grounding.py` is the other,
independent way from a program to its worlds; the two are tested against each other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import cast

from lcorpp.errors import ProgramError, TooLargeError
from lcorpp.reasoning.circuit.constants import Value, holds, split, value_of
from lcorpp.reasoning.circuit.ground import Clause, Ground, Kind
from lcorpp.reasoning.circuit.ground import Literal as GroundLiteral
from lcorpp.reasoning.circuit.joins import Facts, Join, Part, Source
from lcorpp.reasoning.language.arithmetic import exact, ground, variables
from lcorpp.reasoning.language.offence import Offence
from lcorpp.reasoning.language.signature import expressions, pr_variables, scope
from lcorpp.reasoning.language.syntax import (
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
from lcorpp.reasoning.program import Program

Body = Sequence[Literal | Comparison]

Key = Value | tuple[Value, ...]
"""The arguments of a term; one alone stands for itself."""


MOST_BITS = 2**31
"""How many bits the conditions of a program may take, one for each value that one may have."""

_NONE = Source("()")

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
        self._sorts: dict[str, Mapping[Value, None]] = {}
        self._bits = 0
        self._indexes: dict[str, dict[Value, int]] = {}
        self._do = dict(do)
        self._torn: set[str] = set()
        for statement in program.statements:
            if isinstance(statement, Intervention):
                self._set(ground(statement.term), ground(statement.value))
        self._facts = self._given()

    def _set(self, term: str, value: str) -> None:
        if self._do.setdefault(term, value) != value:  # two values set: no world has both
            if self.ground.do_is_fact:
                self._add(Clause(Kind.FORBID, -1, 0, ()))
            else:
                self._torn.add(term)

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
        if self._torn:  # in 2018 only where the term is selected
            names = self.ground.names
            for c in [
                c for c in self.ground.clauses if c.kind is Kind.SELECT and names[c.term] in self._torn
            ]:
                self._add(Clause(Kind.FORBID, -1, 0, c.body, c.statement))
        if asked:
            body = tuple([self._ground_literal(literal) for literal in asked])
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
        facts: dict[str, Mapping[tuple[Value, ...], Value]] = {}
        for name, rules in heads.items():
            if name not in other:
                table: dict[tuple[Value, ...], Value] = {}
                for rule in rules:
                    self._collect(rule, table)
                facts[name] = table
        return facts

    def _collect(self, rule: Rule, table: dict[tuple[Value, ...], Value]) -> None:
        assert rule.head
        join = self._join(rule, rule.body, {})
        arguments = [join.part(argument) for argument in rule.head.term.arguments]
        value = join.part(rule.head.value)
        if join.is_ground:
            table[tuple(arguments)] = value
            return
        key = "".join(f"{join.written(argument)}, " for argument in arguments)
        join.add(f"table[({key})] = {join.written(value)}")
        join.function(table=table)()

    # statements

    def _join(self, statement: Rule | Selection | Probability, body: Body, facts: Facts) -> Join:
        slots = list(self.signature.slots(statement))
        return Join(self.signature, self._sort, slots, scope(statement), body, facts)

    def _sort(self, name: str) -> Mapping[Value, None]:
        if name not in self._sorts:
            self._sorts[name] = {value_of(text): None for text in self.signature.sorts[name]}
        return self._sorts[name]

    def _rule(self, index: int, rule: Rule) -> None:
        join = self._join(rule, rule.body, self._facts)
        if rule.head is None:
            self._emit(join, Kind.FORBID, -1, 0, rule.body, index)
        else:
            term, value = self._term(join, rule.head.term), self._value(join, rule.head.term, rule.head.value)
            self._emit(join, Kind.DERIVE, term, value, rule.body, index)

    def _selection(self, index: int, selection: Selection) -> None:
        join = self._join(selection, selection.body, self._facts)
        inner = list(expressions(selection.range.condition)) if selection.range else []
        label = selection.label.arguments if selection.label else ()
        told = _names((*inner, selection.term, *label))
        shared = sorted(told & _names(scope(selection)))
        term = self._term(join, selection.term)
        instances: dict[tuple[Value, ...], int] = {}
        instance = _tuple(shared)
        if selection.range:
            join.add(f"instances[{instance}] = {join.written(term)}")
        self._emit(
            join, Kind.SELECT, term, 0, selection.body, index, self._label(join, label), instance,
            instances=instances,
        )  # fmt: skip
        if selection.range:
            self._range(index, selection, shared, instances)

    def _range(
        self, index: int, selection: Selection, shared: list[str], instances: Mapping[tuple[Value, ...], int]
    ) -> None:
        assert selection.range
        variable, condition = selection.range.variable, selection.range.condition
        slots = list(self.signature.range_slots(selection))
        used = [variable, *expressions(condition)]
        join = Join(self.signature, self._sort, slots, used, condition, self._facts, shared)
        value = self._value(join, selection.term, variable)
        run = self._function(
            join, Kind.RANGE, Source("instances[" + _tuple(shared) + "]"), value, condition, index, "",
            _tuple(shared), instances=instances,
        )  # fmt: skip
        for instance in list(instances):
            run(*instance)

    def _probability(self, index: int, atom: Probability) -> None:
        join = self._join(atom, atom.condition, self._facts)
        term, value = self._term(join, atom.term), self._value(join, atom.term, atom.value)
        names = pr_variables(atom)
        number: Source | Fraction
        if isinstance(atom.number, Number):
            number = atom.number.value
        else:
            given = ", ".join(f"{name!r}: str(v_{name})" for name in names)
            number = Source(f"{join.name(exact)}({join.name(atom.number)}, {{{given}}})")
        label = self._label(join, atom.label.arguments if atom.label else ())
        self._emit(join, Kind.ASSIGN, term, value, atom.condition, index, label, _tuple(names), number)

    def _forbid_unless(self, literal: Literal) -> None:
        term, allowed, negated = self._ground_literal(literal)
        everything = (1 << len(self.ground.values[term]) + 1) - 1
        self._add(Clause(Kind.FORBID, -1, 0, ((term, everything & ~allowed, not negated),)))

    def _ground_literal(self, literal: Literal) -> GroundLiteral:
        term = self.term(literal.term.name, _key([value_of(ground(a)) for a in literal.term.arguments]))
        return term, self._allowed(literal, value_of(ground(literal.value))), literal.negated

    # clauses

    def _emit(
        self,
        join: Join,
        kind: Kind,
        term: Part,
        value: Part,
        body: Body,
        index: int,
        label: Part = "",
        instance: Source = _NONE,
        number: Source | Fraction | None = None,
        **names: object,
    ) -> None:
        """Add a clause for each way to bind the variables of a statement."""
        literals = self._body(join, body)
        parts = (term, value, label, number, *(part for literal in literals for part in literal))
        if join.is_ground and not any(isinstance(part, Source) for part in parts):
            given = tuple([cast(GroundLiteral, literal) for literal in literals])
            self._add(
                Clause(kind, cast(int, term), cast(int, value), given, index, cast(str, label), (), number)  # type: ignore[arg-type]
            )
        else:
            self._function(join, kind, term, value, literals, index, label, instance, number, **names)()

    def _function(
        self,
        join: Join,
        kind: Kind,
        term: Part,
        value: Part,
        body: Body | list[tuple[Part, Part, bool]],
        index: int,
        label: Part,
        instance: Source,
        number: Source | Fraction | None = None,
        **names: object,
    ) -> Callable[..., None]:
        if not all(isinstance(literal, tuple) for literal in body):
            body = self._body(join, cast(Body, body))
        literals = "".join(
            f"({join.written(t)}, {join.written(allowed)}, {negated}), "
            for t, allowed, negated in cast(list[tuple[Part, Part, bool]], body)
        )
        of = number if isinstance(number, Source) else join.name(number)
        join.add(
            f"add(Clause({join.name(kind)}, {join.written(term)}, {join.written(value)}, ({literals}),"
            f" {index}, {join.written(label)}, {instance}, {of}))"
        )
        return join.function(add=self._add, Clause=Clause, **names)

    # parts of clauses

    def _term(self, join: Join, term: Term) -> Part:
        parts = [join.part(argument) for argument in term.arguments]
        if not any(isinstance(part, Source) for part in parts):
            return self.term(term.name, _key(parts))
        inner = ", ".join(map(join.written, parts))
        found = join.name(None)
        key = inner if len(parts) == 1 else f"({inner})"
        join.add(f"{found} = {join.name(self._ids[term.name].get)}(k := {key})")
        join.add(f"if {found} is None: {found} = {join.name(self.term)}({term.name!r}, k)")
        return found

    def _value(self, join: Join, term: Term, value: Expression) -> Part:
        numbers, part = self._numbers(term.name), join.part(value)
        return Source(f"{join.name(numbers)}[{part}]") if isinstance(part, Source) else numbers[part]

    def _label(self, join: Join, arguments: Sequence[Expression]) -> Part:
        parts = [join.part(argument) for argument in arguments]
        if not any(isinstance(part, Source) for part in parts):
            return ",".join(map(str, parts))
        return Source(" + ',' + ".join(f"str({join.written(part)})" for part in parts))

    def _body(self, join: Join, body: Body) -> list[tuple[Part, Part, bool]]:
        return [
            self._literal(join, literal)
            for literal in body
            if isinstance(literal, Literal)
            and not self.signature.is_sort(literal)
            and literal.term.name not in self._facts
        ]

    def _literal(self, join: Join, literal: Literal) -> tuple[Part, Part, bool]:
        value = join.part(literal.value)
        if not isinstance(value, Source):
            return self._term(join, literal.term), self._allowed(literal, value), literal.negated
        known = self._masks.setdefault((literal.term.name, literal.relation, literal.negated), {})

        def make(value: Value) -> int:
            allowed = known[value] = self._allowed(literal, value)
            return allowed

        term, allowed = self._term(join, literal.term), join.name(None)
        join.add(f"{allowed} = {join.name(known.get)}(k := {value})")
        join.add(f"if {allowed} is None: {allowed} = {join.name(make)}(k)")
        return term, allowed, literal.negated

    def _numbers(self, attribute: str) -> dict[Value, int]:
        if attribute not in self._indexes:
            values = self.signature.attributes[attribute].values
            self._indexes[attribute] = {value_of(value): i for i, value in enumerate(values)}
        return self._indexes[attribute]

    def _allowed(self, literal: Literal, value: Value) -> int:
        numbers, relation = self._numbers(literal.term.name), literal.relation
        self._bits += len(numbers)
        if self._bits > MOST_BITS:
            raise TooLargeError(
                f"{literal.at}: too many conditions on attributes with many values, here {len(numbers)}"
            )
        allowed = 0
        if relation == "=":
            allowed = 1 << numbers[value] if value in numbers else 0
        else:
            for has, i in numbers.items():
                if holds(has, relation, value):
                    allowed |= 1 << i
        return ((1 << len(numbers) + 1) - 1) & ~allowed if literal.negated else allowed


def _tuple(names: Iterable[str]) -> Source:
    return Source("(" + "".join(f"v_{name}, " for name in names) + ")")


def _key(arguments: Sequence[Value]) -> Key:
    return arguments[0] if len(arguments) == 1 else tuple(arguments)


def _names(parts: Iterable[Expression]) -> set[str]:
    return {variable.name for part in parts for variable in variables(part)}
