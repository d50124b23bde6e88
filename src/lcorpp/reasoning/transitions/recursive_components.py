"""Compilation, step 2: the local distribution of a recursive component, by the stable models of its clauses.

A component is recursive if its terms depend on each other or on themselves. The cheapest method applies:

- a single term (`p = false :- not p`): test each outcome against its own reduct;
- no selections, and stratified negation (e.g. reachability): least fixed points for all states at once
  (`stratified`);
- otherwise clingo enumerates the stable models for each state. This covers components that are dynamically
  causally ordered although they are not statically, and even loops with several stable models for one
  selection.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from lcorpp.errors import ProgramError
from lcorpp.notebook import join_some
from lcorpp.reasoning.conditions import ConditionViolation, has_dynamic_range
from lcorpp.reasoning.grounding.ground_program import (
    ASSIGN,
    DERIVE,
    RANGE,
    SELECT,
    Clause,
    GroundLiteral,
    GroundProgram,
)
from lcorpp.reasoning.questions import QUERY_TERM
from lcorpp.reasoning.transitions.local_distribution import (
    ONE,
    GuardedClause,
    Outcome,
    ProbabilityCache,
    enumerate_outcomes,
)
from lcorpp.reasoning.transitions.stratified import Stratified

LOG = logging.getLogger("lcorpp.reasoning")

MAX_MODELS = 200_000
"""A component has at most this many stable models in one state."""


def build_component(
    program: GroundProgram,
    terms: tuple[int, ...],
    clauses: Sequence[GuardedClause],
    probabilities: ProbabilityCache,
    read_terms: Collection[int],
) -> RecursiveComponent | Stratified:
    """Choose the cheapest local distribution for a recursive component.

    Args:
        program: the ground program; its clauses are not used.
        terms: the terms of the component.
        clauses: the clauses about them.
        read_terms: the terms whose outcomes other rules or queries read.
    """
    is_random = any(clause.kind is SELECT for _, clause, _ in clauses)
    stratified = None if is_random else Stratified.from_clauses(program, terms, clauses, read_terms)
    return stratified or RecursiveComponent(program, terms, clauses, probabilities)


@dataclass(slots=True, eq=False)
class RecursiveComponent:
    """The local distribution of a recursive component by enumeration of its stable models.

    program, terms, clauses, probabilities: as in `build_component`.
    logged: whether the log already reports the use of clingo.
    """

    program: GroundProgram
    terms: tuple[int, ...]
    clauses: Sequence[GuardedClause]
    probabilities: ProbabilityCache
    logged: bool = False

    def list_outcomes(self, states: Iterable[int]) -> Mapping[int, list[Outcome]]:
        """Return the joint outcomes of the terms for each state of the bits."""
        return {state: self._compute_outcomes(state) for state in states}

    def _compute_outcomes(self, state: int) -> list[Outcome]:
        clauses = [guarded for guarded in self.clauses if not guarded[0] or state & guarded[0]]
        models = (
            self._enumerate_single_term_models(clauses)
            if len(self.terms) == 1
            else self._enumerate_clingo_models(clauses)
        )
        return [outcome for model in models if (outcome := self._weigh(model, clauses))]

    def _enumerate_single_term_models(self, clauses: Sequence[GuardedClause]) -> Iterator[dict[int, int]]:
        """Enumerate the stable models of one term: each outcome that is the least model of its own reduct.

        `mask >> outcome & 1` is 1 if the outcome satisfies the literal with this mask.
        """
        term = self.terms[0]
        no_value = len(self.program.values[term])
        do_value = self.program.do.get(term)  # None without an intervention
        for guess in range(no_value + 1):
            # the clauses whose negated literals the guess satisfies
            reduct = [c for c in clauses if not c[2] or all(not n or m >> guess & 1 for _, m, n in c[2])]
            values = {do_value} if do_value is not None and self.program.do_is_fact else set()
            grown = True
            while grown and len(values) < 2:
                before = set(values)
                for _, clause, body in reduct:
                    if not body or all(n or any(mask >> v & 1 for v in values) for _, mask, n in body):
                        if clause.kind is DERIVE:
                            values.add(clause.value)
                        elif clause.kind is SELECT and do_value is not None:
                            values.add(do_value)
                        elif clause.kind is SELECT and guess < no_value:
                            values.add(guess)  # other selected values are tested by their own guess
                        elif clause.kind is SELECT:
                            values |= {0, 1}  # contradicts the guess that the term has no value
                grown = values != before
            if values == ({guess} if guess < no_value else set()):
                yield {term: guess}

    def _enumerate_clingo_models(self, clauses: Sequence[GuardedClause]) -> Iterator[dict[int, int]]:
        import clingo  # here, as few programs need it

        file = self.program.source.file
        all_names = [self.program.names[term] for term in self.terms]
        names = join_some([name for name in all_names if not name.startswith(QUERY_TERM)])
        if not self.logged:
            self.logged = True
            LOG.info("%s: %s depend on each other: clingo enumerates their values", file, names)
        control: Any = clingo.Control(["--models=0", "--warn=none"])
        control.add("base", [], "\n".join(self._translate(clauses)))
        control.ground([("base", [])])
        with control.solve(yield_=True) as models:
            for count, model in enumerate(models):
                if count == MAX_MODELS:
                    raise ProgramError(f"{file}: more than {MAX_MODELS} stable models of {names}")
                outcomes = {term: len(self.program.values[term]) for term in self.terms}
                atoms = [atom.arguments for atom in model.symbols(shown=True)]
                yield outcomes | {term.number: value.number for term, value in atoms}

    def _translate(self, clauses: Sequence[GuardedClause]) -> Iterator[str]:
        """Translate the component to an answer set program.

        h(term, value): the term has the value; sel(selection): the body of the selection is true;
        pos(selection, term, value): the value is in the dynamic range; in(term, number): the outcome of the
        term is in the set of outcomes with this number.
        """
        yield "#show h/2. #defined h/2. #defined pos/3. :- h(T,V), h(T,W), V < W."
        do = self.program.do
        outcome_sets: dict[tuple[int, int], str] = {}
        selections: dict[tuple[int, tuple[int | str, ...]], int] = {}
        for term in self.terms:
            if term in do and self.program.do_is_fact:
                yield f"h({term},{do[term]})."
        for _, clause, body in clauses:
            if clause.kind is ASSIGN:  # pr-atoms do not change the models, only their weights
                continue
            condition, term = self._translate_body(body, outcome_sets), clause.term
            if clause.kind is DERIVE:
                yield f"h({term},{clause.value}) :- {condition}."
                continue
            selection = selections.setdefault((clause.statement, clause.instance), len(selections))
            if clause.kind is RANGE:
                yield f"pos({selection},{term},{clause.value}) :- {condition}."
            elif not (term in do and self.program.do_is_fact):
                last = len(self.program.values[term]) - 1
                chosen = f"h({term},{do[term]})" if term in do else f"1 {{ h({term},0..{last}) }} 1"
                yield f"sel({selection}) :- {condition}. {chosen} :- sel({selection})."
                if has_dynamic_range(self.program.source, clause.statement):
                    yield f":- sel({selection}), h({term},V), not pos({selection},{term},V)."
        for (term, mask), name in outcome_sets.items():
            for value in range(len(self.program.values[term])):
                if mask >> value & 1:
                    yield f"{name} :- h({term},{value})."

    def _translate_body(self, body: Sequence[GroundLiteral], outcome_sets: dict[tuple[int, int], str]) -> str:
        parts = []
        for term, mask, negated in body:
            every_outcome = (1 << len(self.program.values[term]) + 1) - 1
            # the mask of a negated literal covers the outcomes for which the inner literal is false
            inner = every_outcome & ~mask if negated else mask
            name = outcome_sets.setdefault((term, inner), f"in({term},{len(outcome_sets)})")
            parts.append(f"not {name}" if negated else name)
        return ", ".join(parts) or "#true"

    def _weigh(self, model: dict[int, int], clauses: Sequence[GuardedClause]) -> Outcome | None:
        """Weigh a stable model by the probabilities of its random terms; None if it is not a world."""
        true_clauses: dict[int, list[Clause]] = {term: [] for term in self.terms}
        for _, clause, body in clauses:
            if not body or all(mask >> model[term] & 1 for term, mask, _ in body):
                true_clauses[clause.term].append(clause)
        weight: Fraction = ONE
        violation: ConditionViolation | None = None
        for index, (term, own) in enumerate(true_clauses.items()):
            outcomes = enumerate_outcomes(self.program, term, own, self.probabilities)
            outcome = next((outcome for outcome in outcomes if outcome[0] == model[term]), None)
            if outcome is None:
                return None
            _, probability, term_violation = outcome
            weight = probability if weight is ONE else weight * probability
            if term_violation and not violation:
                violation = term_violation  # a new object of each call, not shared
                violation.term_index = index
        return Outcome(tuple(model.values()), weight, violation)
