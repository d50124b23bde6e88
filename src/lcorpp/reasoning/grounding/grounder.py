"""From a program to its ground clauses: each statement with its variables replaced in every way their sorts
allow.

It needs no solver and keeps what a solver would throw away, the probabilities. `grounding.py` is the other,
independent way from a program to its worlds; the two are tested against each other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import cast

from lcorpp.errors import ProgramError
from lcorpp.reasoning.grounding.atoms import AtomTable, key_of
from lcorpp.reasoning.grounding.ground_program import (
    Clause,
    ClauseKind,
    GroundProgram,
    Literal as GroundLiteral,
)
from lcorpp.reasoning.grounding.rule_instantiator import Facts, Part, RuleInstantiator, Source
from lcorpp.reasoning.grounding.values import Value, split, value_of
from lcorpp.reasoning.language.arithmetic import canonical_text, evaluate_number, iter_variables
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.program import Program
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
)
from lcorpp.reasoning.language.traversal import iter_expressions, list_expressions

Body = Sequence[Literal | Comparison]

_NONE = Source("()")

QUERY_TERM = "?"
"""The name of the term that has the value true where all literals that are asked for hold."""


def ground_program(
    program: Program, do: Mapping[str, str], observed: Iterable[Literal] = (), asked: Sequence[Literal] = ()
) -> GroundProgram:
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
    except SourceIssue as issue:
        raise ProgramError(str(issue)) from None


class _Grounder:
    def __init__(self, program: Program, do: Mapping[str, str]) -> None:
        self.program, self.signature = program, program.signature
        self.ground = GroundProgram(program)
        self.parts = AtomTable(self.ground)
        self._add = self.ground.clauses.append
        self._sorts: dict[str, Mapping[Value, None]] = {}
        self._do = dict(do)
        self._torn: set[str] = set()
        for statement in program.statements:
            if isinstance(statement, Intervention):
                self._set(canonical_text(statement.term), canonical_text(statement.value))
        self._facts = self._given()

    def _set(self, term: str, value: str) -> None:
        if self._do.setdefault(term, value) != value:  # two values set: no world has both
            if self.ground.do_is_fact:
                self._add(Clause(ClauseKind.FORBID, -1, 0, ()))
            else:
                self._torn.add(term)

    def all(self, observed: Iterable[Literal], asked: Sequence[Literal]) -> GroundProgram:
        for term, value in self._do.items():
            name = term.partition("(")[0]
            found = self.parts.number(name, key_of([value_of(a) for a in split(term)[1]]))
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
                c for c in self.ground.clauses if c.kind is ClauseKind.SELECT and names[c.term] in self._torn
            ]:
                self._add(Clause(ClauseKind.FORBID, -1, 0, c.body, c.statement))
        if asked:
            body = tuple([self.parts.ground_literal(literal) for literal in asked])
            self._add(Clause(ClauseKind.DERIVE, len(self.ground.names), 0, body))
            self.ground.names.append(QUERY_TERM)
            self.ground.values.append(("true",))
        return self.ground

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

    def _join(self, statement: Rule | Selection | Probability, body: Body, facts: Facts) -> RuleInstantiator:
        slots = list(self.signature.slots(statement))
        return RuleInstantiator(self.signature, self._sort, slots, list_expressions(statement), body, facts)

    def _sort(self, name: str) -> Mapping[Value, None]:
        if name not in self._sorts:
            self._sorts[name] = {value_of(text): None for text in self.signature.sorts[name]}
        return self._sorts[name]

    def _rule(self, index: int, rule: Rule) -> None:
        join = self._join(rule, rule.body, self._facts)
        if rule.head is None:
            self._emit(join, ClauseKind.FORBID, -1, 0, rule.body, index)
        else:
            term, value = (
                self.parts.term(join, rule.head.term),
                self.parts.value(join, rule.head.term, rule.head.value),
            )
            self._emit(join, ClauseKind.DERIVE, term, value, rule.body, index)

    def _selection(self, index: int, selection: Selection) -> None:
        join = self._join(selection, selection.body, self._facts)
        inner = list(iter_expressions(selection.range.condition)) if selection.range else []
        label = selection.label.arguments if selection.label else ()
        told = _names((*inner, selection.term, *label))
        shared = sorted(told & _names(list_expressions(selection)))
        term = self.parts.term(join, selection.term)
        instances: dict[tuple[Value, ...], int] = {}
        instance = _tuple(shared)
        if selection.range:
            join.add(f"instances[{instance}] = {join.written(term)}")
        self._emit(
            join, ClauseKind.SELECT, term, 0, selection.body, index, self.parts.label(join, label), instance,
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
        used = [variable, *iter_expressions(condition)]
        join = RuleInstantiator(self.signature, self._sort, slots, used, condition, self._facts, shared)
        value = self.parts.value(join, selection.term, variable)
        run = self._function(
            join, ClauseKind.RANGE, Source("instances[" + _tuple(shared) + "]"), value, condition, index, "",
            _tuple(shared), instances=instances,
        )  # fmt: skip
        for instance in list(instances):
            run(*instance)

    def _probability(self, index: int, atom: Probability) -> None:
        join = self._join(atom, atom.condition, self._facts)
        term, value = self.parts.term(join, atom.term), self.parts.value(join, atom.term, atom.value)
        written = atom.number
        number = written.value if isinstance(written, Number) else _computed(join, written)
        label = self.parts.label(join, atom.label.arguments if atom.label else ())
        self._emit(join, ClauseKind.ASSIGN, term, value, atom.condition, index, label, number=number)

    def _forbid_unless(self, literal: Literal) -> None:
        term, allowed, negated = self.parts.ground_literal(literal)
        everything = (1 << len(self.ground.values[term]) + 1) - 1
        self._add(Clause(ClauseKind.FORBID, -1, 0, ((term, everything & ~allowed, not negated),)))

    # clauses

    def _emit(
        self,
        join: RuleInstantiator,
        kind: ClauseKind,
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
        join: RuleInstantiator,
        kind: ClauseKind,
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

    def _body(self, join: RuleInstantiator, body: Body) -> list[tuple[Part, Part, bool]]:
        return [
            self.parts.literal(join, literal)
            for literal in body
            if isinstance(literal, Literal)
            and not self.signature.is_sort(literal)
            and literal.term.name not in self._facts
        ]


def _names(parts: Iterable[Expression]) -> set[str]:
    return {variable.name for part in parts for variable in iter_variables(part)}


def _tuple(names: Iterable[str]) -> Source:
    return Source("(" + "".join(f"v_{name}, " for name in names) + ")")


def _computed(join: RuleInstantiator, number: Expression) -> Source:
    """The number of a pr-atom that depends on variables, made once for the same values of them."""
    names = sorted(_names([number]))
    known: dict[tuple[Value, ...], Fraction] = {}

    def make(values: tuple[Value, ...]) -> Fraction:
        found = known[values] = evaluate_number(number, dict(zip(names, map(str, values), strict=True)))
        return found

    found = join.name(None)
    join.add(f"{found} = {join.name(known.get)}(k := {_tuple(names)})")
    join.add(f"if {found} is None: {found} = {join.name(make)}(k)")
    return found
