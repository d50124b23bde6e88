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
from typing import Any

from lcorpp.errors import ProgramError
from lcorpp.reasoning.gc_pause import pause_gc
from lcorpp.reasoning.grounding.binding_table import BindingTable, Part
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
    Term,
)
from lcorpp.reasoning.language.traversal import get_body, iter_expressions, list_expressions, list_fact_values


def ground_program(
    program: Program,
    do: Mapping[str, str],
    observed: Iterable[Literal] = (),
    asked: Sequence[Literal] = (),
    queried: Iterable[str] = (),
) -> GroundProgram:
    """Ground a program.

    Args:
        do: interventions besides those in the program, term -> value.
        observed: ground literals that are true in every world, besides the observations in the program.
        asked: the ground literals that define the term `QUERY_TERM`.
        queried: names of terms; the joints among them are defined.

    Raises:
        ProgramError: arithmetic is undefined.
        TooLargeError: a joint has too many values.
    """
    try:
        with pause_gc():
            return _Grounder(program, do).run(observed, asked, queried)
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

    def run(
        self, observed: Iterable[Literal], asked: Sequence[Literal], queried: Iterable[str]
    ) -> GroundProgram:
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
        for name in queried:
            if name.startswith(QUERY_TERM) and name != QUERY_TERM:
                self.result.define_joint(name)
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
        values = list_fact_values(fact)
        if values:
            table[values[:-1]] = values[-1]
            return
        assert fact.head
        bindings = self._instantiate(fact, {})
        keys = bindings.list_rows([bindings.evaluate(argument) for argument in fact.head.term.arguments])
        table.update(zip(keys, bindings.iterate(bindings.evaluate(fact.head.value)), strict=True))

    # statements

    def _instantiate(self, statement: Rule | Selection | Probability, facts: Facts) -> BindingTable:
        slots, scope = list(self.signature.iter_slots(statement)), list_expressions(statement)
        body = get_body(statement)
        return RuleInstantiator(
            self.signature, self._list_members, slots, scope, body, facts, statement.at
        ).table

    def _list_members(self, sort: str) -> Mapping[Value, None]:
        if sort not in self._sorts:
            self._sorts[sort] = {as_value(text): None for text in self.signature.sorts[sort]}
        return self._sorts[sort]

    def _ground_rule(self, index: int, rule: Rule) -> None:
        values = list_fact_values(rule)
        if values and rule.head:
            number, outcome = self.terms.number_fact(rule.head.term.name, values)
            self._add(Clause(ClauseKind.DERIVE, number, outcome, (), index))
            return
        table = self._instantiate(rule, self._facts)
        if rule.head:
            value = self.terms.index_value(table, rule.head.term, rule.head.value)
            self._emit(table, ClauseKind.DERIVE, rule.head.term, value, rule.body, index)
        else:
            self._emit(table, ClauseKind.FORBID, -1, 0, rule.body, index)

    def _ground_selection(self, index: int, selection: Selection) -> None:
        """Add the clauses of a selection, and those of its dynamic range for each of its instances.

        An instance is a binding of the variables that the body shares with term, label and dynamic range:
        that of X for ``random(f(X) : {Y : p(X,Y)}) :- q(X,Z).``
        """
        table, dynamic_range = self._instantiate(selection, self._facts), selection.range
        condition = dynamic_range.condition if dynamic_range else ()
        used = [selection.term, *(selection.label.arguments if selection.label else ())]
        used.extend(iter_expressions(condition))
        shared = sorted(find_variables(*used) & find_variables(*list_expressions(selection)))
        label = self.terms.format_label(table, selection.label)
        instances = table.list_rows([table.columns[name] for name in shared])
        term = self._emit(
            table, ClauseKind.SELECT, selection.term, 0, selection.body, index, label, instances
        )
        if dynamic_range:
            term_of = dict(zip(instances, table.iterate(term), strict=True))
            slots = list(self.signature.iter_range_slots(selection))
            scope = [dynamic_range.variable, *iter_expressions(condition)]
            table = RuleInstantiator(
                self.signature, self._list_members, slots, scope, condition, self._facts, selection.at,
                shared, list(term_of),
            ).table  # fmt: skip
            instances = table.list_rows([table.columns[name] for name in shared])
            terms = [term_of[instance] for instance in instances]
            value = self.terms.index_value(table, selection.term, dynamic_range.variable)
            self._emit(table, ClauseKind.RANGE, terms, value, condition, index, "", instances)

    def _ground_pr_atom(self, index: int, atom: Probability) -> None:
        table = self._instantiate(atom, self._facts)
        value = self.terms.index_value(table, atom.term, atom.value)
        label = self.terms.format_label(table, atom.label)
        number = _evaluate_numbers(table, atom.number)
        self._emit(table, ClauseKind.ASSIGN, atom.term, value, atom.condition, index, label, number=number)

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
        table: BindingTable,
        kind: ClauseKind,
        term: Term | Part[int],
        value: Part[int],
        body: Body,
        index: int,
        label: Part[str] = "",
        instance: Part[tuple[Value, ...]] = (),
        number: Part[Fraction] | None = None,
    ) -> Part[int]:
        """Add one clause for each binding of the variables of a statement.

        Args:
            term, value, label, instance, number: the parts of the clauses, see `Clause`.
            body: its literals of neither sorts nor facts become literals of the clauses.

        Returns:
            The numbers of the term.
        """
        literals = [
            literal
            for literal in body
            if isinstance(literal, Literal)
            and not self.signature.is_sort(literal)
            and literal.term.name not in self._facts
        ]
        heads = [term] if isinstance(term, Term) else []
        numbers = self.terms.number_terms(table, (*heads, *(literal.term for literal in literals)))
        head = numbers.pop(0) if isinstance(term, Term) else term
        body_parts: list[list[Any]] = [
            [number, self.terms.make_mask(table, literal), literal.negated]
            for number, literal in zip(numbers, literals, strict=True)
        ]
        if table.is_ground:
            parts: Any = (kind, head, value, tuple(map(tuple, body_parts)), index, label, (), number)
            self._add(Clause(*parts))
            return head
        bodies = table.list_rows([table.list_rows(part) for part in body_parts])
        parts = (kind, head, value, bodies, index, label, instance, number)
        self.result.clauses.extend(map(Clause, *map(table.iterate, parts)))
        return head


def _evaluate_numbers(table: BindingTable, number: Expression) -> Part[Fraction]:
    """Evaluate the number of a pr-atom in each binding; equal values share one fraction."""
    if isinstance(number, Number):
        return number.value
    names = sorted(find_variables(number))

    def compute(values: tuple[Value, ...]) -> Fraction:
        return evaluate_number(number, dict(zip(names, map(str, values), strict=True)))

    results: dict[tuple[Value, ...], Fraction] = {}
    return table.look_up(results, table.list_rows([table.columns[name] for name in names]), compute)
