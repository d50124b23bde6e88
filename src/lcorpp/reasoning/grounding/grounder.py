"""Compilation, step 1: ground a program: one clause for each admissible binding of a statement's variables.

Unlike an ASP grounder, this one keeps the probabilities and needs no solver. Literals of attributes that only
facts define are evaluated here and are not part of the clauses. The other, independent way from a program to
its worlds is `enumeration.asp_translation`; tests compare the two.

Source: the reducts of Baral, Gelfond and Rushton, TPLP 9(1), 2009, section 3; semantics 2018: Balai, Gelfond
and Zhang, 2019, section 3.1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from typing import cast

from lcorpp.errors import ProgramError
from lcorpp.reasoning.gc_pause import pause_gc
from lcorpp.reasoning.grounding.atoms import AtomTable, make_key
from lcorpp.reasoning.grounding.generated_function import Part, Source
from lcorpp.reasoning.grounding.ground_program import (
    Clause,
    ClauseKind,
    GroundLiteral,
    GroundProgram,
)
from lcorpp.reasoning.grounding.rule_instantiator import Facts, RuleInstantiator
from lcorpp.reasoning.grounding.values import Value, parse_value, split_record
from lcorpp.reasoning.language.arithmetic import canonical_text, evaluate_number, iter_variables
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import (
    BodyLiteral,
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

Body = Sequence[BodyLiteral]

_EMPTY_TUPLE = Source("()")

QUERY_TERM = "?"
"""The name of the term that has the value `true` in the worlds in which all literals of a query are true."""


def ground_program(
    program: Program, do: Mapping[str, str], observed: Iterable[Literal] = (), asked: Sequence[Literal] = ()
) -> GroundProgram:
    """Ground a program.

    Args:
        do: interventions besides those in the program, term -> value.
        observed: ground literals that are true in every world, besides the observations in the program.
        asked: the ground literals that define the term `QUERY_TERM`.

    Raises:
        ProgramError: arithmetic is undefined.
    """
    try:
        with pause_gc():
            return _Grounder(program, do).run(observed, asked)
    except SourceIssue as issue:
        raise ProgramError(str(issue)) from None


class _Grounder:
    def __init__(self, program: Program, do: Mapping[str, str]) -> None:
        self.program, self.signature = program, program.signature
        self.result = GroundProgram(program)
        self.atoms = AtomTable(self.result)
        self._add = self.result.clauses.append
        self._sorts: dict[str, Mapping[Value, None]] = {}
        self._do = dict(do)
        self._contradictory: set[str] = set()  # terms that interventions set to two values (2018)
        for statement in program.statements:
            if isinstance(statement, Intervention):
                self._intervene(canonical_text(statement.term), canonical_text(statement.value))
        self._facts = self._evaluate_facts()

    def _intervene(self, term: str, value: str) -> None:
        if self._do.setdefault(term, value) != value:  # no world satisfies both interventions
            if self.result.do_is_fact:
                self._add(Clause(ClauseKind.FORBID, -1, 0, ()))
            else:
                self._contradictory.add(term)

    def run(self, observed: Iterable[Literal], asked: Sequence[Literal]) -> GroundProgram:
        for term, value in self._do.items():
            name = term.partition("(")[0]
            number = self.atoms.number_term(name, make_key([parse_value(a) for a in split_record(term)[1]]))
            self.result.do[number] = self.signature.attributes[name].values.index(value)
        for index, statement in enumerate(self.program.statements):
            if isinstance(statement, Rule):
                self._ground_rule(index, statement)
            elif isinstance(statement, Selection):
                self._ground_selection(index, statement)
            elif isinstance(statement, Probability):
                self._ground_pr_atom(index, statement)
            elif isinstance(statement, Observation):
                self._observe(statement.literal)
        for literal in observed:
            self._observe(literal)
        if self._contradictory:  # 2018: the worlds in which the term is selected are impossible
            names = self.result.names
            for clause in list(self.result.clauses):
                if clause.kind is ClauseKind.SELECT and names[clause.term] in self._contradictory:
                    self._add(Clause(ClauseKind.FORBID, -1, 0, clause.body, clause.statement))
        if asked:
            body = tuple([self.atoms.translate_ground_literal(literal) for literal in asked])
            self._add(Clause(ClauseKind.DERIVE, len(self.result.names), 0, body))
            self.result.names.append(QUERY_TERM)
            self.result.values.append(("true",))
        return self.result

    # facts

    def _evaluate_facts(self) -> Facts:
        """Find the attributes that only facts define, and evaluate these facts."""
        other = {t.partition("(")[0] for t in self._do}
        rules_of: dict[str, list[Rule]] = {}
        for statement in self.program.statements:
            if isinstance(statement, Selection):
                other.add(statement.term.name)
            elif isinstance(statement, Rule) and statement.head:
                rules_of.setdefault(statement.head.term.name, []).append(statement)
                if any(isinstance(x, Literal) and not self.signature.is_sort(x) for x in statement.body):
                    other.add(statement.head.term.name)
        facts: dict[str, Mapping[tuple[Value, ...], Value]] = {}
        for name, rules in rules_of.items():
            if name not in other:
                table: dict[tuple[Value, ...], Value] = {}
                for fact in rules:
                    self._evaluate_fact(fact, table)
                facts[name] = table
        return facts

    def _evaluate_fact(self, fact: Rule, table: dict[tuple[Value, ...], Value]) -> None:
        assert fact.head
        rule = self._instantiate(fact, fact.body, {})
        arguments = [rule.translate(argument) for argument in fact.head.term.arguments]
        value = rule.translate(fact.head.value)
        if rule.is_ground:
            table[tuple(arguments)] = value
            return
        key = "".join(f"{rule.quote(argument)}, " for argument in arguments)
        rule.add_line(f"table[({key})] = {rule.quote(value)}")
        rule.compile(table=table)()

    # statements

    def _instantiate(
        self, statement: Rule | Selection | Probability, body: Body, facts: Facts
    ) -> RuleInstantiator:
        slots = list(self.signature.iter_slots(statement))
        return RuleInstantiator(
            self.signature, self._list_members, slots, list_expressions(statement), body, facts
        )

    def _list_members(self, sort: str) -> Mapping[Value, None]:
        if sort not in self._sorts:
            self._sorts[sort] = {parse_value(text): None for text in self.signature.sorts[sort]}
        return self._sorts[sort]

    def _ground_rule(self, index: int, statement: Rule) -> None:
        rule = self._instantiate(statement, statement.body, self._facts)
        head = statement.head
        if head is None:
            self._emit(rule, ClauseKind.FORBID, -1, 0, statement.body, index)
        else:
            term = self.atoms.translate_term(rule, head.term)
            value = self.atoms.translate_value(rule, head.term, head.value)
            self._emit(rule, ClauseKind.DERIVE, term, value, statement.body, index)

    def _ground_selection(self, index: int, selection: Selection) -> None:
        rule = self._instantiate(selection, selection.body, self._facts)
        conditions = list(iter_expressions(selection.range.condition)) if selection.range else []
        label = selection.label.arguments if selection.label else ()
        used = _find_all_variables((*conditions, selection.term, *label))
        shared = sorted(used & _find_all_variables(list_expressions(selection)))
        term = self.atoms.translate_term(rule, selection.term)
        instances: dict[tuple[Value, ...], int] = {}  # values of the shared variables -> term
        instance = _write_tuple(shared)
        if selection.range:
            rule.add_line(f"instances[{instance}] = {rule.quote(term)}")
        self._emit(
            rule, ClauseKind.SELECT, term, 0, selection.body, index,
            self.atoms.translate_label(rule, label), instance, instances=instances,
        )  # fmt: skip
        if selection.range:
            self._ground_dynamic_range(index, selection, shared, instances)

    def _ground_dynamic_range(
        self, index: int, selection: Selection, shared: list[str], instances: Mapping[tuple[Value, ...], int]
    ) -> None:
        assert selection.range
        variable, condition = selection.range.variable, selection.range.condition
        slots = list(self.signature.iter_range_slots(selection))
        used = [variable, *iter_expressions(condition)]
        rule = RuleInstantiator(
            self.signature, self._list_members, slots, used, condition, self._facts, shared
        )
        value = self.atoms.translate_value(rule, selection.term, variable)
        instance = _write_tuple(shared)
        run = self._compile(
            rule, ClauseKind.RANGE, Source(f"instances[{instance}]"), value,
            self._translate_body(rule, condition), index, "", instance, instances=instances,
        )  # fmt: skip
        for values in list(instances):
            run(*values)

    def _ground_pr_atom(self, index: int, atom: Probability) -> None:
        rule = self._instantiate(atom, atom.condition, self._facts)
        term = self.atoms.translate_term(rule, atom.term)
        value = self.atoms.translate_value(rule, atom.term, atom.value)
        written = atom.number
        number = written.value if isinstance(written, Number) else _compute_number(rule, written)
        label = self.atoms.translate_label(rule, atom.label.arguments if atom.label else ())
        self._emit(rule, ClauseKind.ASSIGN, term, value, atom.condition, index, label, number=number)

    def _observe(self, literal: Literal) -> None:
        """Forbid the worlds in which a ground literal is false."""
        term, mask, negated = self.atoms.translate_ground_literal(literal)
        every_outcome = (1 << len(self.result.values[term]) + 1) - 1
        self._add(Clause(ClauseKind.FORBID, -1, 0, ((term, every_outcome & ~mask, not negated),)))

    # clauses

    def _emit(
        self,
        rule: RuleInstantiator,
        kind: ClauseKind,
        term: Part,
        value: Part,
        body: Body,
        index: int,
        label: Part = "",
        instance: Source = _EMPTY_TUPLE,
        number: Source | Fraction | None = None,
        **names: object,
    ) -> None:
        """Add one clause for each binding of the variables of a statement."""
        literals = self._translate_body(rule, body)
        parts = (term, value, label, number, *(part for literal in literals for part in literal))
        if rule.is_ground and not any(isinstance(part, Source) for part in parts):
            ground_body = tuple([cast(GroundLiteral, literal) for literal in literals])
            clause = Clause(kind, cast(int, term), cast(int, value), ground_body, index, cast(str, label))
            clause.number = cast("Fraction | None", number)
            self._add(clause)
        else:
            self._compile(rule, kind, term, value, literals, index, label, instance, number, **names)()

    def _compile(
        self,
        rule: RuleInstantiator,
        kind: ClauseKind,
        term: Part,
        value: Part,
        body: Sequence[tuple[Part, Part, bool]],
        index: int,
        label: Part,
        instance: Source,
        number: Source | Fraction | None = None,
        **names: object,
    ) -> Callable[..., None]:
        """Compile the function that adds the clauses."""
        literals = "".join(f"({rule.quote(t)}, {rule.quote(mask)}, {negated}), " for t, mask, negated in body)
        number_source = number if isinstance(number, Source) else rule.name_constant(number)
        rule.add_line(
            f"add(Clause({rule.name_constant(kind)}, {rule.quote(term)}, {rule.quote(value)}, ({literals}),"
            f" {index}, {rule.quote(label)}, {instance}, {number_source}))"
        )
        return rule.compile(add=self._add, Clause=Clause, **names)

    def _translate_body(self, rule: RuleInstantiator, body: Body) -> list[tuple[Part, Part, bool]]:
        """Translate the literals that become literals of the clause: those of neither sorts nor facts."""
        return [
            self.atoms.translate_literal(rule, literal)
            for literal in body
            if isinstance(literal, Literal)
            and not self.signature.is_sort(literal)
            and literal.term.name not in self._facts
        ]


def _find_all_variables(parts: Iterable[Expression]) -> set[str]:
    return {variable.name for part in parts for variable in iter_variables(part)}


def _write_tuple(names: Iterable[str]) -> Source:
    return Source("(" + "".join(f"v_{name}, " for name in names) + ")")


def _compute_number(rule: RuleInstantiator, number: Expression) -> Source:
    """Write the source of a pr-atom's number that depends on variables; equal values share one fraction."""
    names = sorted(_find_all_variables([number]))
    known: dict[tuple[Value, ...], Fraction] = {}

    def compute(values: tuple[Value, ...]) -> Fraction:
        result = known[values] = evaluate_number(number, dict(zip(names, map(str, values), strict=True)))
        return result

    name = rule.name_constant(None)
    rule.add_line(f"{name} = {rule.name_constant(known.get)}(k := {_write_tuple(names)})")
    rule.add_line(f"if {name} is None: {name} = {rule.name_constant(compute)}(k)")
    return name
