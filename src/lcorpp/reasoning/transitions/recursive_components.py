"""Terms that depend on each other in a circle are decided together, by the stable models of their clauses
alone.

Three kinds of circles, the cheapest way for each: one term that speaks of itself (`p = false :- not p`),
tried value by value; circles without selections whose `not` can be stratified, such as reachability, by
least fixed points, for all states at once; any other is left to clingo, state by state. Choices that are
ordered in each world though not on paper are counted rightly there, and so are even loops, where one choice
of values has two stable models.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from lcorpp.errors import ProgramError
from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundProgram, Literal
from lcorpp.reasoning.transitions.selection import (
    ONE,
    ConditionViolation,
    GuardedClause,
    Outcome,
    enumerate_outcomes,
)
from lcorpp.reasoning.transitions.stratified import Stratified

LOG = logging.getLogger("lcorpp.reasoning")

MAX_MODELS = 200_000
"""How many stable models a circle may have in one state."""


@dataclass(slots=True, eq=False)
class RecursiveComponent:
    """The decision of terms that depend on each other.

    entries: their clauses with their bits; the bodies hold only literals of these terms.
    """

    ground: GroundProgram
    terms: tuple[int, ...]
    entries: Sequence[GuardedClause]
    shared: dict[object, Any]
    said: bool = False

    def outcomes(self, many: Iterable[int]) -> Mapping[int, list[Outcome]]:
        """For each state of the bits, the joint outcomes of the terms."""
        return {bits: self._outcomes(bits) for bits in many}

    def _outcomes(self, bits: int) -> list[Outcome]:
        clauses = [clause for bit, clause in self.entries if not bit or bits & bit]
        models = self._self_models(clauses) if len(self.terms) == 1 else self._models(clauses)
        return [outcome for model in models if (outcome := self._measured(model, clauses))]

    def _self_models(self, clauses: Sequence[Clause]) -> Iterator[dict[int, int]]:
        """The stable models of one term: each outcome that its own reduct gives back."""
        term = self.terms[0]
        none = len(self.ground.values[term])
        do = self.ground.do.get(term)
        for guess in range(none + 1):
            kept = [c for c in clauses if all(not n or allowed >> guess & 1 for _, allowed, n in c.body)]
            given = {do} if do is not None and self.ground.do_is_fact else set()
            grown = True
            while grown and len(given) < 2:
                before = set(given)
                for clause in kept:
                    if all(n or any(allowed >> v & 1 for v in given) for _, allowed, n in clause.body):
                        if clause.kind is ClauseKind.DERIVE:
                            given.add(clause.value)
                        elif clause.kind is ClauseKind.SELECT and do is not None:
                            given.add(do)
                        elif clause.kind is ClauseKind.SELECT and guess < none:
                            given.add(guess)  # a value is chosen; were it another, it would be another guess
                        elif clause.kind is ClauseKind.SELECT:
                            given |= {0, 1}  # a selection leaves no term without a value
                grown = given != before
            if given == ({guess} if guess < none else set()):
                yield {term: guess}

    def _models(self, clauses: Sequence[Clause]) -> Iterator[dict[int, int]]:
        if not self.said:
            self.said = True
            LOG.info(
                "%s: %s depend on each other: their values are found by enumeration",
                self.ground.source.file,
                self._shown(),
            )
        for count, atoms in enumerate(stable_models("\n".join(self._text(clauses)))):
            if count == MAX_MODELS:
                raise ProgramError(
                    f"{self.ground.source.file}: more than {MAX_MODELS} ways to decide {self._shown()}"
                )
            has = {term: len(self.ground.values[term]) for term in self.terms}
            has.update(atoms)
            yield has

    def _shown(self) -> str:
        names = ", ".join(self.ground.names[term] for term in self.terms[:5])
        return f"{names}{', ...' if len(self.terms) > 5 else ''}"

    def _text(self, clauses: Sequence[Clause]) -> Iterator[str]:
        """The circle as an answer set program: h(term, value), sel(selection), pos(selection, ...)."""
        yield "#show h/2. #defined h/2. #defined pos/3. :- h(T,V), h(T,W), V < W."
        do = self.ground.do
        sets: dict[tuple[int, int], str] = {}
        keys: dict[tuple[int, tuple[int | str, ...]], int] = {}
        for term in self.terms:
            if term in do and self.ground.do_is_fact:
                yield f"h({term},{do[term]})."
        for clause in clauses:
            if clause.kind is ClauseKind.ASSIGN:
                continue
            condition, term = self._condition(clause.body, sets), clause.term
            if clause.kind is ClauseKind.DERIVE:
                yield f"h({term},{clause.value}) :- {condition}."
                continue
            key = keys.setdefault((clause.statement, clause.instance), len(keys))
            if clause.kind is ClauseKind.RANGE:
                yield f"pos({key},{term},{clause.value}) :- {condition}."
            elif not (term in do and self.ground.do_is_fact):
                last = len(self.ground.values[term]) - 1
                chosen = f"h({term},{do[term]})" if term in do else f"1 {{ h({term},0..{last}) }} 1"
                yield f"sel({key}) :- {condition}. {chosen} :- sel({key})."
                if self.ground.has_dynamic_range(clause.statement):
                    yield f":- sel({key}), h({term},V), not pos({key},{term},V)."
        for (term, allowed), name in sets.items():
            for value in range(len(self.ground.values[term])):
                if allowed >> value & 1:
                    yield f"{name} :- h({term},{value})."

    def _condition(self, body: Sequence[Literal], sets: dict[tuple[int, int], str]) -> str:
        parts = []
        for term, allowed, negated in body:
            everything = (1 << len(self.ground.values[term]) + 1) - 1
            # `not l` holds for the outcomes in which l does not
            wanted = everything & ~allowed if negated else allowed
            name = sets.setdefault((term, wanted), f"in({term},{len(sets)})")
            parts.append(f"not {name}" if negated else name)
        return ", ".join(parts) or "#true"

    def _measured(self, model: dict[int, int], clauses: Sequence[Clause]) -> Outcome | None:
        """The outcome that a stable model is, with the product of the probabilities of its random terms."""
        about: dict[int, dict[ClauseKind, list[Clause]]] = {
            term: {kind: [] for kind in ClauseKind} for term in self.terms
        }
        for clause in clauses:
            if all(allowed >> model[term] & 1 for term, allowed, _ in clause.body):
                about[clause.term][clause.kind].append(clause)
        weight: Fraction = ONE
        violation: ConditionViolation | None = None
        for which, term in enumerate(self.terms):
            kinds = about[term]
            derived = {clause.value for clause in kinds[ClauseKind.DERIVE]}
            select, ranged, assign = (
                kinds[ClauseKind.SELECT],
                kinds[ClauseKind.RANGE],
                kinds[ClauseKind.ASSIGN],
            )
            found = enumerate_outcomes(self.ground, term, derived, select, ranged, assign, self.shared)
            here = next((o for o in found if o[0] == model[term]), None)
            if here is None:
                return None
            weight *= here[1]
            if here[2] and not violation:
                violation = here[2]
                violation.which = which
        return Outcome(tuple([model[term] for term in self.terms]), weight, violation)


def build_component(
    ground: GroundProgram,
    terms: tuple[int, ...],
    entries: Sequence[GuardedClause],
    shared: dict[object, Any],
    wanted: Iterable[int],
) -> RecursiveComponent | Stratified:
    """The cheapest way to decide a circle.

    Args:
        wanted: the terms whose outcomes will be asked for at once; the others may be worked out later.
    """
    selected = any(clause.kind is ClauseKind.SELECT for _, clause in entries)
    if not selected and not any(term in ground.do for term in terms):
        found = Stratified.of(ground, terms, entries, wanted)
        if found:
            return found
    return RecursiveComponent(ground, terms, entries, shared)


def stable_models(text: str) -> Iterator[dict[int, int]]:
    """The stable models of a program whose shown atoms are h(term, value), both numbers: term -> value."""
    import clingo  # here, as few programs need it

    control: Any = clingo.Control(["--models=0", "--warn=none"])
    control.add("base", [], text)
    control.ground([("base", [])])
    with control.solve(yield_=True) as found:
        for model in found:
            yield {a.arguments[0].number: a.arguments[1].number for a in model.symbols(shown=True)}
