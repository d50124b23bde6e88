"""The local distribution of a component, given the clauses whose bodies are true.

A term is derived by rules, selected at random from its dynamic range, set by an intervention, or has no
value. This module has the distribution of one term that does not depend on itself; `conditions` computes the
probabilities of random values.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Protocol

from lcorpp.reasoning.conditions import (
    ConditionViolation,
    compute_probabilities,
    list_applicable,
    list_dynamic_range,
)
from lcorpp.reasoning.grounding.ground_program import DERIVE, SELECT, Clause, GroundLiteral, GroundProgram
from lcorpp.reasoning.transitions.rule_templates import RuleTemplate

ONE = Fraction(1)

ProbabilityCache = dict[object, list[Fraction]]
"""The probabilities computed so far, by dynamic range and pr-atoms; shared by all terms of a program."""


GuardedClause = tuple[int, Clause, Sequence[GroundLiteral]]
"""A clause of a component: (bit, clause, body).

bit: the state bit that is set if the literals about other components are satisfied; 0 if they always are.
clause: the clause, for its head.
body: the literals about the component itself.
"""


@dataclass(slots=True)
class Outcome:
    """An outcome of a component.

    values: the outcome of each term, an index into its values or their number if it has no value; a sequence
        that may be computed lazily.
    weight: the product of the probabilities of the terms that are random.
    violation: the condition of P-log that a world with this outcome breaks, None if there is none.
    """

    values: Sequence[int]
    weight: Fraction
    violation: ConditionViolation | None = None


class LocalDistribution(Protocol):
    """The outcomes of a component, given the bits of its clauses."""

    def list_outcomes(self, states: Iterable[int]) -> Mapping[int, list[Outcome]]:
        """Return the outcomes for each state of the bits; an empty list if the state has no world."""


class AcyclicTermDistribution:
    """The local distribution of one term that does not depend on itself.

    Args:
        bits: the bits in the slots of the template.
        cache: the outcomes computed so far, by the true clause groups; shared by all terms with the template.
    """

    __slots__ = ("_cache", "_group_of_bit", "_probabilities", "_program", "_template")

    def __init__(
        self,
        program: GroundProgram,
        template: RuleTemplate,
        bits: Sequence[int],
        cache: dict[tuple[int, ...], list[Outcome]],
        probabilities: ProbabilityCache,
    ) -> None:
        self._program, self._template = program, template
        self._cache, self._probabilities = cache, probabilities
        self._group_of_bit = {
            bits[group.satisfied_slot]: index
            for index, group in enumerate(template.clause_groups)
            if group.satisfied_slot
        }

    def list_outcomes(self, states: Iterable[int]) -> Mapping[int, list[Outcome]]:
        """Return the outcomes of the term for each state of the bits."""
        by_state = {}
        cache = self._cache
        for state in states:
            true_groups = self._list_true_groups(state)
            outcomes = cache.get(true_groups)
            if outcomes is None:
                outcomes = cache[true_groups] = self._compute_outcomes(true_groups)
            by_state[state] = outcomes
        return by_state

    def _list_true_groups(self, state: int) -> tuple[int, ...]:
        """The clause groups whose bits are set; a term may have thousands of groups of which few are true."""
        group_of_bit = self._group_of_bit
        if state in group_of_bit:  # one bit: usual, and faster
            return (group_of_bit[state],)
        groups = []
        while state:
            lowest = state & -state
            groups.append(group_of_bit[lowest])
            state ^= lowest
        return tuple(sorted(groups))

    def _compute_outcomes(self, true_groups: Iterable[int]) -> list[Outcome]:
        groups = self._template.clause_groups
        indexes = sorted((*self._template.always_true, *true_groups))
        clauses = [groups[i].clause for i in indexes]
        if len(clauses) == 1 and clauses[0].kind is DERIVE and not self._program.do:  # usual, and faster
            return _derive_outcome(clauses[0].value)
        outcomes = enumerate_outcomes(self._program, self._template.terms[0], clauses, self._probabilities)
        return [Outcome((value,), weight, violation) for value, weight, violation in outcomes]


@lru_cache(4096)
def _derive_outcome(value: int) -> list[Outcome]:
    """Return the outcome of a term with one rule whose body is true; equal ones share memory."""
    return [Outcome((value,), ONE)]


def enumerate_outcomes(
    program: GroundProgram, term: int, clauses: Sequence[Clause], cache: ProbabilityCache
) -> list[tuple[int, Fraction, ConditionViolation | None]]:
    """Enumerate the outcomes of a term.

    Args:
        clauses: the clauses about the term whose bodies are true.

    Returns:
        (outcome, probability, violated condition) for each outcome; an empty list if there is no world.
    """
    do = program.do.get(term)
    derived = {clause.value for clause in clauses if clause.kind is DERIVE}
    if do is not None and program.do_is_fact:
        return [(do, ONE, None)] if derived <= {do} else []
    if len(derived) > 1:
        return []
    selections = [clause for clause in clauses if clause.kind is SELECT]
    if not selections:
        no_value = len(program.values[term])
        return [(next(iter(derived), no_value), ONE, None)]
    possible = list_dynamic_range(program.source, program.values[term], selections, clauses)
    if do is not None:
        return [(do, ONE, None)] if do in possible and derived <= {do} else []
    taken = [value for value in possible if derived <= {value}]
    if not taken:
        return []
    try:
        atoms = list_applicable(program.source, selections, clauses)
        # the clauses of a statement share their number, so its id, which compares fast, identifies it
        key = (tuple(possible), tuple([(c.value, id(c.number), c.statement) for c in atoms]))
        probabilities = cache.get(key)
        if probabilities is None:
            probabilities = compute_probabilities(program.source, program.values[term], possible, atoms)
            cache[key] = probabilities
    except ConditionViolation as found:
        return [(value, ONE, found) for value in taken]
    if not derived:
        return [(value, number, None) for value, number in zip(possible, probabilities, strict=True)]
    return [(value, probabilities[possible.index(value)], None) for value in taken]
