"""Compilation, step 1: ground a program: one clause for each admissible binding of a statement's variables.

Unlike ASP grounding, it keeps the probabilities. Literals of fact attributes, which depend on no world (ASP:
domain predicates), are evaluated here and are not part of the clauses. The other, independent way from a
program to its worlds is `enumeration.asp_translation`; tests compare the two.

Source: the reducts of Baral, Gelfond and Rushton, TPLP 9(1), 2009, section 3; semantics 2018: Balai, Gelfond
and Zhang, 2019, section 3.1.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

from lcorpp.errors import ProgramError
from lcorpp.reasoning.gc_pause import pause_gc
from lcorpp.reasoning.grounding.generated_function import Part, Source
from lcorpp.reasoning.grounding.ground_program import (
    QUERY_TERM,
    Clause,
    ClauseKind,
    GroundLiteral,
    GroundProgram,
    make_full_mask,
)
from lcorpp.reasoning.grounding.patterns import split_record
from lcorpp.reasoning.grounding.rule_instantiator import Facts, RuleInstantiator
from lcorpp.reasoning.grounding.term_table import TermTable, make_key
from lcorpp.reasoning.language.arithmetic import (
    Value,
    as_value,
    canonical_text,
    evaluate_number,
    find_variables,
)
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import (
    Body,
    Expression,
    Intervention,
    Literal,
    Number,
    Observation,
    Probability,
    Rule,
    Selection,
)
from lcorpp.reasoning.language.traversal import get_body, iter_expressions, list_expressions

_EMPTY_TUPLE = Source("()")


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
        self.terms = TermTable(self.result)
        self._add = self.result.clauses.append
        self._sorts: dict[str, Mapping[Value, None]] = {}
        self._do = dict(do)
        self._contradictory: set[str] = set()  # terms that interventions set to two values
        for statement in program.statements:
            if isinstance(statement, Intervention):
                term, value = canonical_text(statement.term), canonical_text(statement.value)
                if self._do.setdefault(term, value) != value:
                    self._contradictory.add(term)
        self._facts = self._evaluate_facts()

    def run(self, observed: Iterable[Literal], asked: Sequence[Literal]) -> GroundProgram:
        """Add the clauses of all statements and of a query."""
        for term, value in self._do.items():
            name, arguments = split_record(term)
            number = self.terms.number_term(name, make_key([as_value(argument) for argument in arguments]))
            self.result.do[number] = self.signature.attributes[name].values.index(value)
        if self._contradictory and self.result.do_is_fact:  # no world satisfies both interventions
            self._forbid(())
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
        if self._contradictory and not self.result.do_is_fact:  # nor a world in which the term is selected
            names = self.result.names
            for clause in list(self.result.clauses):
                if clause.kind is ClauseKind.SELECT and names[clause.term] in self._contradictory:
                    self._forbid(clause.body, clause.statement)
        if asked:
            body = tuple([self.terms.translate_ground_literal(literal) for literal in asked])
            self._add(Clause(ClauseKind.DERIVE, len(self.result.names), 0, body))
            self.result.names.append(QUERY_TERM)
            self.result.values.append(("true",))
        return self.result

    # facts

    def _evaluate_facts(self) -> Facts:
        """Evaluate the attributes whose rules have only sorts and comparisons in their bodies."""
        uncertain = {split_record(term)[0] for term in self._do}
        rules_of: dict[str, list[Rule]] = {}
        for statement in self.program.statements:
            if isinstance(statement, Selection):
                uncertain.add(statement.term.name)
            elif isinstance(statement, Rule) and statement.head:
                rules_of.setdefault(statement.head.term.name, []).append(statement)
                if any(isinstance(x, Literal) and not self.signature.is_sort(x) for x in statement.body):
                    uncertain.add(statement.head.term.name)
        facts: dict[str, Mapping[tuple[Value, ...], Value]] = {}
        for name, rules in rules_of.items():
            if name not in uncertain:
                table: dict[tuple[Value, ...], Value] = {}
                for rule in rules:
                    self._evaluate_fact(rule, table)
                facts[name] = table
        return facts

    def _evaluate_fact(self, fact: Rule, table: dict[tuple[Value, ...], Value]) -> None:
        assert fact.head
        code = self._instantiate(fact, {})
        arguments = [code.translate(argument) for argument in fact.head.term.arguments]
        value = code.translate(fact.head.value)
        if code.is_ground:
            table[tuple(arguments)] = value
            return
        key = "".join(f"{code.quote(argument)}, " for argument in arguments)
        code.add_line(f"table[({key})] = {code.quote(value)}")
        code.compile(table=table)()

    # statements

    def _instantiate(self, statement: Rule | Selection | Probability, facts: Facts) -> RuleInstantiator:
        slots, scope = list(self.signature.iter_slots(statement)), list_expressions(statement)
        return RuleInstantiator(self.signature, self._list_members, slots, scope, get_body(statement), facts)

    def _list_members(self, sort: str) -> Mapping[Value, None]:
        if sort not in self._sorts:
            self._sorts[sort] = {as_value(text): None for text in self.signature.sorts[sort]}
        return self._sorts[sort]

    def _ground_rule(self, index: int, rule: Rule) -> None:
        code = self._instantiate(rule, self._facts)
        if rule.head:
            term = self.terms.translate_term(code, rule.head.term)
            value = self.terms.translate_value(code, rule.head.term, rule.head.value)
            self._emit(code, ClauseKind.DERIVE, term, value, rule.body, index)
        else:
            self._emit(code, ClauseKind.FORBID, -1, 0, rule.body, index)

    def _ground_selection(self, index: int, selection: Selection) -> None:
        """Add the clauses of a selection, and those of its dynamic range for each of its instances.

        An instance is a binding of the variables that the body shares with term, label and dynamic range:
        that of X for ``random(f(X) : {Y : p(X,Y)}) :- q(X,Z).``
        """
        code, dynamic_range = self._instantiate(selection, self._facts), selection.range
        condition = dynamic_range.condition if dynamic_range else ()
        used = [selection.term, *(selection.label.arguments if selection.label else ())]
        used.extend(iter_expressions(condition))
        shared = sorted(find_variables(*used) & find_variables(*list_expressions(selection)))
        instance = _write_tuple(shared)
        instances: dict[tuple[Value, ...], int] = {}  # instance -> number of the selected term
        term = self.terms.translate_term(code, selection.term)
        if dynamic_range:
            code.add_line(f"instances[{instance}] = {code.quote(term)}")
        label = self.terms.translate_label(code, selection.label)
        self._emit(
            code, ClauseKind.SELECT, term, 0, selection.body, index, label, instance, instances=instances
        )
        if dynamic_range:
            slots = list(self.signature.iter_range_slots(selection))
            scope = [dynamic_range.variable, *iter_expressions(condition)]
            code = RuleInstantiator(
                self.signature, self._list_members, slots, scope, condition, self._facts, shared
            )
            term = Source(f"instances[{instance}]")
            value = self.terms.translate_value(code, selection.term, dynamic_range.variable)
            self._emit(
                code, ClauseKind.RANGE, term, value, condition, index, "", instance,
                instances=instances, calls=list(instances),
            )  # fmt: skip

    def _ground_pr_atom(self, index: int, atom: Probability) -> None:
        code = self._instantiate(atom, self._facts)
        term = self.terms.translate_term(code, atom.term)
        value = self.terms.translate_value(code, atom.term, atom.value)
        number = atom.number.value if isinstance(atom.number, Number) else _write_number(code, atom.number)
        label = self.terms.translate_label(code, atom.label)
        self._emit(code, ClauseKind.ASSIGN, term, value, atom.condition, index, label, number=number)

    def _observe(self, literal: Literal) -> None:
        """Forbid the worlds in which a ground literal is false."""
        term, mask, negated = self.terms.translate_ground_literal(literal)
        full_mask = make_full_mask(len(self.result.values[term]))
        self._forbid(((term, full_mask & ~mask, not negated),))

    # clauses

    def _forbid(self, body: tuple[GroundLiteral, ...], statement: int = -1) -> None:
        self._add(Clause(ClauseKind.FORBID, -1, 0, body, statement))

    def _emit(
        self,
        code: RuleInstantiator,
        kind: ClauseKind,
        term: Part,
        value: Part,
        body: Body,
        index: int,
        label: Part = "",
        instance: Source = _EMPTY_TUPLE,
        number: Source | Fraction | None = None,
        instances: Mapping[tuple[Value, ...], int] | None = None,
        calls: Iterable[tuple[Value, ...]] = ((),),
    ) -> None:
        """Add one clause for each binding of the variables of a statement.

        Args:
            term, value, label, instance, number: the parts of the clauses, see `Clause`.
            body: its literals of neither sorts nor facts become literals of the clauses.
            instances: values of the shared variables -> term, for the source that names `instances`.
            calls: the arguments of each call of the generated function.
        """
        literals = [
            self.terms.translate_literal(code, literal)
            for literal in body
            if isinstance(literal, Literal)
            and not self.signature.is_sort(literal)
            and literal.term.name not in self._facts
        ]
        parts = (term, value, label, number, *(part for literal in literals for part in literal))
        if code.is_ground and not any(isinstance(part, Source) for part in parts):
            self._add(Clause(kind, term, value, tuple(literals), index, label, (), number))  # type: ignore[arg-type]
            return
        quoted = "".join(
            f"({code.quote(t)}, {code.quote(mask)}, {negated}), " for t, mask, negated in literals
        )
        number_source = number if isinstance(number, Source) else code.name_constant(number)
        code.add_line(
            f"add(Clause({code.name_constant(kind)}, {code.quote(term)}, {code.quote(value)}, ({quoted}),"
            f" {index}, {code.quote(label)}, {instance}, {number_source}))"
        )
        run = code.compile(add=self._add, Clause=Clause, instances=instances)
        for arguments in calls:
            run(*arguments)


def _write_tuple(names: Iterable[str]) -> Source:
    return Source("(" + "".join(f"v_{name}, " for name in names) + ")")


def _write_number(code: RuleInstantiator, number: Expression) -> Source:
    """Write the source of a pr-atom's number that depends on variables; equal values share one fraction."""
    names = sorted(find_variables(number))

    def compute(values: tuple[Value, ...]) -> Fraction:
        return evaluate_number(number, dict(zip(names, map(str, values), strict=True)))

    return code.add_lookup({}, _write_tuple(names), compute)
