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
from itertools import product
from typing import TYPE_CHECKING

from lcorpp.errors import ProgramError
from lcorpp.reasoning.grounding.binding_table import BindingTable, Key, Memo, Part
from lcorpp.reasoning.grounding.ground_program import (
    ASSIGN,
    DERIVE,
    FORBID,
    RANGE,
    SELECT,
    Clause,
    ClauseKind,
    GroundLiteral,
    GroundProgram,
    make_full_mask,
)
from lcorpp.reasoning.grounding.relation import Relation
from lcorpp.reasoning.grounding.rule_instantiator import Atoms, RuleInstantiator, Source
from lcorpp.reasoning.grounding.strong_components import find_strongly_connected_components
from lcorpp.reasoning.grounding.term_table import TermTable
from lcorpp.reasoning.language.arithmetic import (
    Value,
    as_value,
    canonical_text,
    evaluate_number,
    find_variables,
    split_record,
)
from lcorpp.reasoning.language.facts import Fact
from lcorpp.reasoning.language.issues import SourceIssue
from lcorpp.reasoning.language.program import Program
from lcorpp.reasoning.language.syntax import (
    Body,
    Expression,
    Formula,
    Intervention,
    Literal,
    Observation,
    Probability,
    Rule,
    Selection,
    Variable,
)
from lcorpp.reasoning.language.traversal import iter_expressions, list_expressions
from lcorpp.reasoning.questions import QUERY_TERM, is_joint, list_terms, list_values

if TYPE_CHECKING:
    from lcorpp.reasoning.grounding.path_rules import PathRule


def ground_program(
    program: Program,
    do: Mapping[str, str],
    observed: Iterable[Formula] = (),
    asked: Formula = (),
    queried: Iterable[str] = (),
) -> GroundProgram:
    """Ground a program.

    Args:
        do: interventions besides those in the program, term -> value.
        observed: formulas that are true in every world, besides the observations in the program.
        asked: the formula that defines the term `QUERY_TERM`.
        queried: names of terms; the joints among them are defined.

    Raises:
        ProgramError: arithmetic is undefined.
        TooLargeError: a joint has too many values.
    """
    try:
        return _Grounder(program, do).run(observed, asked, queried)
    except SourceIssue as issue:
        raise ProgramError(str(issue)) from None


class _Grounder:
    def __init__(self, program: Program, do: Mapping[str, str]) -> None:
        self.program, self.signature = program, program.signature
        self.result = GroundProgram(program)
        self.terms = TermTable(self.result)
        self._do = dict(do)
        self._contradictory: set[str] = set()  # terms that interventions set to two values
        self._instantiator = RuleInstantiator(self.signature)
        self._tables: dict[int, BindingTable] = {}  # index of a rule or selection -> its bindings
        # attribute -> the rules and selections that may give it a value, with their indexes
        self._clauses: dict[str, list[tuple[int, Rule | Selection]]] = {
            name: [] for name in self.signature.attributes
        }
        for index, statement in enumerate(program.statements):
            if isinstance(statement, Intervention):
                term, value = canonical_text(statement.term), canonical_text(statement.value)
                if self._do.setdefault(term, value) != value:
                    self._contradictory.add(term)
            elif isinstance(statement, Fact):
                self._clauses[statement.name].append((index, statement))
            elif isinstance(statement, Rule | Selection) and (head := statement.head):
                self._clauses[head.term.name].append((index, statement))
        self._find_atoms()

    def run(self, observed: Iterable[Formula], asked: Formula, queried: Iterable[str]) -> GroundProgram:
        """Add the clauses of all statements and of a query."""
        for term, value in self._do.items():
            name, arguments = self._split_term(term)
            number = self.terms.number_term(name, arguments)
            self.result.do[number] = self.terms.indexes[name][as_value(value)]
        for index, statement in enumerate(self.program.statements):
            if isinstance(statement, Rule):
                self._ground_rule(index, statement)
            elif isinstance(statement, Selection):
                self._ground_selection(index, statement)
            elif isinstance(statement, Probability):
                self._ground_pr_atom(index, statement)
            elif isinstance(statement, Observation):
                self._observe(statement.formula)
        for formula in observed:
            self._observe(formula)
        if (
            self._contradictory
        ):  # no world, or none in which the term is selected, satisfies both interventions
            selections = [x for x in self.result.clauses if x.kind is SELECT]
            bodies = [x.body for x in selections if self.result.names[x.term] in self._contradictory]
            for body in [()] if self.result.do_is_fact else bodies:
                self._forbid(body)
        if asked:
            self.result.define(
                QUERY_TERM, ("true",), [(0, tuple(map(self._translate, case))) for case in asked]
            )
        for name in filter(is_joint, queried):
            self._define_joint(name)
        return self.result

    # atoms

    def _find_atoms(self) -> None:
        """Instantiate the rules and selections, those first on which others depend, and find their atoms.

        Negated literals count, too: those of attributes that are certain are tested here. The literals of
        attributes that depend on each other do not restrict the bindings of their rules.
        """
        literals = {
            name: [x for _, clause in clauses for x in clause.body if isinstance(x, Literal)]
            for name, clauses in self._clauses.items()
        }
        facts_first = sorted(literals, key=lambda name: len(literals[name]) > 0)
        needs = {
            name: [x.term.name for x in literals[name] if x.term.name in literals] for name in facts_first
        }
        for component in find_strongly_connected_components(needs):
            positive = {
                name: [x.term.name for x in literals[name] if not x.negated and x.term.name in component]
                for name in component
            }
            for names in find_strongly_connected_components(positive):
                self._instantiator.atoms.update([(name, self._instantiate_all(name)) for name in names])

    def _instantiate_all(self, name: str) -> Atoms:
        """Instantiate the rules and selections of an attribute, and return its atoms."""
        clauses, arity = self._clauses[name], len(self.signature.attributes[name].arguments)
        rows = dict.fromkeys(
            arguments for other, arguments in map(self._split_term, self._do) if other == name
        )
        is_certain = not rows and all(
            isinstance(clause, Rule) and not self._list_uncertain(clause.body) for _, clause in clauses
        )
        width = arity + is_certain
        paths: dict[int, PathRule] = {}
        stages = [clauses]
        if arity > 1:  # a path has two ends
            from lcorpp.reasoning.grounding.path_rules import stage_clauses

            paths, stages = stage_clauses(clauses, self.signature)
        for stage in stages:
            steps = Relation.from_rows(rows if paths else (), arity)
            for index, clause in stage:
                if isinstance(clause, Fact):
                    rows[clause.values[:width]] = None
                elif head := clause.head:
                    sources = [(paths[index].step, steps)] if index in paths else ()
                    table = self._tables[index] = self._instantiate(clause, clause.body, sources)
                    parts = (*head.term.arguments, head.value)[:width]
                    rows.update(dict.fromkeys(table.iter_rows(list(map(table.evaluate, parts)))))
        return Atoms(Relation.from_rows(rows, width), arity, is_certain)

    def _instantiate(
        self, statement: Rule | Selection | Probability, body: Body, sources: Sequence[Source] = ()
    ) -> BindingTable:
        slots, scope = self.signature.iter_slots(statement), list_expressions(statement)
        return self._instantiator.instantiate(slots, scope, body, statement.at, sources=sources)

    def _list_uncertain(self, body: Body) -> list[Literal]:
        """List the literals that become literals of clauses: those of neither sorts nor facts."""
        atoms = self._instantiator.atoms
        return [
            literal
            for literal in body
            if isinstance(literal, Literal)
            and not self.signature.is_sort(literal)
            and not (literal.term.name in atoms and atoms[literal.term.name].is_certain)
        ]

    # statements

    def _ground_rule(self, index: int, rule: Rule) -> None:
        if isinstance(rule, Fact):
            term = self.terms.number_term(rule.name, rule.values[:-1])
            value = self.terms.indexes[rule.name][rule.values[-1]]
            self.result.clauses.append(Clause(DERIVE, term, value, (), index))
        elif rule.head:
            table, head = self._tables.pop(index), rule.head
            numbers = self.terms.number_terms(table, head.term)
            values = self.terms.index_values(table, head.term, head.value)
            self._emit(table, DERIVE, numbers, values, rule.body, index)
        else:
            self._emit(self._instantiate(rule, rule.body), FORBID, -1, 0, rule.body, index)

    def _ground_selection(self, index: int, selection: Selection) -> None:
        """Add the clauses of a selection, and those of its dynamic range for each of its instances.

        An instance is a binding of the variables that the body shares with term, label and dynamic range:
        that of X for ``random(f(X) : {Y : p(X,Y)}) :- q(X,Z).``
        """
        table, dynamic_range = self._tables.pop(index), selection.range
        condition = dynamic_range.condition if dynamic_range else ()
        used = [selection.term, *(selection.label.arguments if selection.label else ())]
        used.extend(iter_expressions(condition))
        shared = sorted(find_variables(*used) & find_variables(*list_expressions(selection)))
        label = table.evaluate_all(selection.label.arguments if selection.label else ())
        variables = list(map(Variable, shared))
        instances = table.evaluate_all(variables)
        number = self.terms.number_terms(table, selection.term)
        self._emit(table, SELECT, number, 0, selection.body, index, label, instances)
        if dynamic_range:
            term_of = dict(zip(table.iterate(instances), table.iterate(number), strict=True))
            bindings = Relation.from_rows(table.iter_rows([table.columns[x] for x in shared]), len(shared))
            slots = self.signature.iter_range_slots(selection)
            scope = [dynamic_range.variable, *iter_expressions(condition)]
            sources = [(variables, bindings)]
            table = self._instantiator.instantiate(slots, scope, condition, selection.at, sources)
            instances = table.evaluate_all(variables)
            terms = [term_of[instance] for instance in table.iterate(instances)]
            value = self.terms.index_values(table, selection.term, dynamic_range.variable)
            self._emit(table, RANGE, terms, value, condition, index, (), instances)

    def _ground_pr_atom(self, index: int, atom: Probability) -> None:
        table = self._instantiate(atom, (*atom.body, atom.head))
        term = self.terms.number_terms(table, atom.term)
        value = self.terms.index_values(table, atom.term, atom.value)
        label = table.evaluate_all(atom.label.arguments if atom.label else ())
        number = _evaluate_numbers(table, atom.number)
        self._emit(table, ASSIGN, term, value, atom.body, index, label, number=number)

    def _observe(self, formula: Formula) -> None:
        """Forbid the worlds in which a formula is false; a disjunction becomes a term of its own."""
        cases = [tuple(map(self._translate, case)) for case in formula]
        if len(cases) > 1:
            number = len(self.result.names)
            self.result.define(f"{QUERY_TERM}{number}", ("true",), [(0, case) for case in cases])
            cases = [((number, 1, False),)]
        for term, mask, negated in cases[0]:
            full_mask = make_full_mask(len(self.result.values[term]))
            self._forbid(((term, full_mask & ~mask, not negated),))

    def _define_joint(self, name: str) -> None:
        """Define the joint of some terms; it has no value if one of them has none."""
        values = list_values(self.program, name)
        terms = [self.terms.number_term(*self._split_term(term)) for term in list_terms(name)]
        literals = [[(term, 1 << i, False) for i in range(len(self.result.values[term]))] for term in terms]
        self.result.define(name, values, enumerate(product(*literals)))

    def _translate(self, literal: Literal) -> GroundLiteral:
        return self.terms.translate(BindingTable(literal.at), literal)  # type: ignore[return-value]  # no column

    # clauses

    def _split_term(self, term: str) -> tuple[str, tuple[Value, ...]]:
        """Split a ground term into its attribute and its arguments."""
        return self.signature.find_attribute(term).name, tuple(map(as_value, split_record(term)[1]))

    def _forbid(self, body: tuple[GroundLiteral, ...]) -> None:
        self.result.clauses.append(Clause(FORBID, -1, 0, body))

    def _emit(
        self,
        table: BindingTable,
        kind: ClauseKind,
        term: Part[int],
        value: Part[int],
        body: Body,
        index: int,
        label: Part[Key] = (),
        instance: Part[Key] = (),
        number: Part[Fraction] | None = None,
    ) -> None:
        """Add one clause for each binding of the variables of a statement; its parts as in `Clause`."""
        literals = self._list_uncertain(body)
        bodies = table.zip([self.terms.translate(table, literal) for literal in literals])
        parts = (kind, term, value, bodies, index, label, instance, number)
        clauses: Iterable[Clause] = map(Clause, *map(table.iterate, parts))
        if kind in (DERIVE, FORBID) and self._may_repeat(index, literals, table):
            clauses = {(c.term, c.value, frozenset(c.body)): c for c in clauses}.values()
        self.result.clauses.extend(clauses)

    def _may_repeat(self, index: int, literals: Sequence[Literal], table: BindingTable) -> bool:
        """Whether clauses of a rule may be equal: literals are interchangeable, or lack a variable."""
        head = self.program.statements[index].head  # type: ignore[attr-defined]
        kinds = {(literal.term.name, literal.relation, literal.negated) for literal in literals}
        used = find_variables(*iter_expressions([*literals, head] if head else literals))
        return len(kinds) < len(literals) or not table.columns.keys() <= used


def _evaluate_numbers(table: BindingTable, number: Expression) -> Part[Fraction]:
    """Evaluate the number of a pr-atom in each binding; equal values share one fraction."""
    names = sorted(find_variables(number))

    def evaluate(values: tuple[Value, ...]) -> Fraction:
        return evaluate_number(number, dict(zip(names, map(str, values), strict=True)))

    return table.look_up(Memo(evaluate), table.zip([table.columns[name] for name in names]))
