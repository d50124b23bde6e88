"""The local distribution of a component, given the clauses whose bodies are true.

A term is derived by rules, selected at random from its dynamic range, set by an intervention, or has no
value. A random value has the probability that a pr-atom assigns; the values without a pr-atom share the rest
evenly. This module has the distribution of one term that does not depend on itself.

Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, section 3.2, equations 3 to 5, Conditions 1 to 3; section
5.1 for unitarity. Condition 1 of 2018: Balai, Gelfond and Zhang, 2019, section 3.2.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

from lcorpp.reasoning.grounding.ground_program import Clause, GroundLiteral, GroundProgram
from lcorpp.reasoning.language.syntax import Probability, Selection, Statement
from lcorpp.reasoning.transitions.rule_templates import ASSIGN, DERIVE, RANGE, SELECT, RuleTemplate

ONE = Fraction(1)

ProbabilityCache = dict[object, list[Fraction]]
"""The probabilities computed so far, by dynamic range and pr-atoms; shared by all terms of a program."""


GuardedClause = tuple[int, Clause, Sequence[GroundLiteral]]
"""A clause of a component: (bit, clause, body).

bit: the state bit that is set if the literals about other components are satisfied; 0 if they always are.
clause: the clause, for its head.
body: the literals about the component itself.
"""


class ConditionViolation(Exception):
    """A world breaks a condition of P-log; `decision_diagram` finds the world.

    Args:
        statement: the index of the statement that breaks the condition.
        message: with "{term}" for the name of the term, as terms with the same template share violations.

    term_index: the index of the term in its component.
    """

    def __init__(self, statement: int, message: str) -> None:
        super().__init__(statement, message)
        self.statement, self.message, self.term_index = statement, message, 0

    def format(self, statements: Sequence[Statement], names: Sequence[str]) -> str:
        """Return the message; `names` are the terms of the component."""
        return f"{statements[self.statement].at}: {self.message.replace('{term}', names[self.term_index])}"


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
        outcomes = enumerate_outcomes(
            self._program, self._template.terms[0], [groups[i].clause for i in indexes], self._probabilities
        )
        return [Outcome((value,), weight, violation) for value, weight, violation in outcomes]


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
    possible = _list_dynamic_range(program, term, selections, clauses)
    if do is not None:
        return [(do, ONE, None)] if do in possible and derived <= {do} else []
    taken = [value for value in possible if value in derived] if derived else possible
    if not taken:
        return []
    if derived or len(selections) > 1:
        violation = _check_condition_1(program, derived, selections)
        if violation is not None:
            return [(value, ONE, violation) for value in taken]
    atoms = [c for c in clauses if c.kind is ASSIGN and _applies_to(program, c, selections[0])]
    # the clauses of a statement share their number, so its id, which compares fast, identifies it
    key = (tuple(possible), tuple([(c.value, id(c.number), c.statement) for c in atoms]))
    probabilities = cache.get(key)
    if probabilities is None:
        try:
            probabilities = cache[key] = _assign_probabilities(program, term, possible, atoms)
        except ConditionViolation as found:
            return [(value, ONE, found) for value in taken]
    if not derived:
        return [(value, number, None) for value, number in zip(possible, probabilities, strict=True)]
    return [(value, probabilities[possible.index(value)], None) for value in taken]


def _list_dynamic_range(
    program: GroundProgram, term: int, selections: Sequence[Clause], clauses: Sequence[Clause]
) -> list[int]:
    """List the dynamic range in the order of the declaration; of several selections, the intersection."""
    possible = list(range(len(program.values[term])))
    for selection in selections:
        if program.has_dynamic_range(selection.statement):
            members = {
                member.value
                for member in clauses
                if member.kind is RANGE
                and (member.statement, member.instance) == (selection.statement, selection.instance)
            }
            possible = [value for value in possible if value in members]
    return possible


def _check_condition_1(
    program: GroundProgram, derived: set[int], selections: Sequence[Clause]
) -> ConditionViolation | None:
    """Check that one selection applies to a term, and (2018) that no rule derives a value of it."""
    statements = program.source.statements
    is_2018 = not program.do_is_fact
    first = selections[0]
    for clause in selections[1:]:
        here, there = statements[first.statement], statements[clause.statement]
        assert isinstance(here, Selection)
        assert isinstance(there, Selection)
        alike = (first.instance, first.label) == (clause.instance, clause.label)
        labels = [statement.label.name if statement.label else "" for statement in (here, there)]
        # 2018: random(label, term, range) is an atom, so rules with the same atom are one selection
        if alike and (here is there or (is_2018 and labels[0] == labels[1] and here.range == there.range)):
            continue
        after = " with other values of its variables" if here is there else ""
        message = f"Condition 1: {{term}} is also selected at random by the rule at {here.at}{after}"
        return ConditionViolation(clause.statement, message)
    if is_2018 and derived:
        message = "Condition 1: {term} is selected at random while a rule derives it"
        return ConditionViolation(first.statement, message)
    return None


def _applies_to(program: GroundProgram, atom: Clause, selection: Clause) -> bool:
    """Whether a pr-atom applies to a selection: it has no label, or the label of the selection."""
    statements = program.source.statements
    assigned, selected = statements[atom.statement], statements[selection.statement]
    assert isinstance(assigned, Probability)
    assert isinstance(selected, Selection)
    if assigned.label is None:
        return True
    if selected.label is None or selected.label.name != assigned.label.name:
        return False
    return not assigned.label.arguments or atom.label == selection.label


def _assign_probabilities(
    program: GroundProgram, term: int, possible: Sequence[int], atoms: Sequence[Clause]
) -> list[Fraction]:
    """Compute the probability of each value of the dynamic range, in its order.

    Args:
        atoms: the pr-atoms that apply to the selection.

    Raises:
        ConditionViolation: Condition 2 or 3 is broken, or the probabilities are not unitary.
    """
    values = program.values[term]
    numbers: dict[int, Fraction] = {}
    statement_of: dict[int, int] = {}
    for atom in atoms:
        value, number, statement = atom.value, atom.number, atom.statement
        assert number is not None
        if not 0 <= number <= 1:
            raise ConditionViolation(statement, f"the probability {number} is not between 0 and 1")
        if value in numbers:
            other = statement_of[value]
            raise ConditionViolation(
                statement,
                f"Condition 2: {{term}}={values[value]} also has a pr-atom at"
                f" {program.source.statements[other].at}"
                f"{' with other values of its variables' if other == statement else ''}",
            )
        if value not in possible:
            members = ", ".join(values[v] for v in possible)
            message = f"{{term}}={values[value]} has a pr-atom outside of its dynamic range {{{members}}}"
            raise ConditionViolation(statement, f"Condition 3: {message}")
        numbers[value], statement_of[value] = number, statement
    total = sum(numbers.values(), Fraction(0))
    n_unassigned = len(possible) - len(numbers)
    if total > 1 or (total != 1 and not n_unassigned):
        bound = "at most " if n_unassigned else ""
        message = f"not unitary: the probabilities of {{term}} sum to {total}, not {bound}1"
        raise ConditionViolation(min(statement_of.values()), message)
    share = (1 - total) / n_unassigned if n_unassigned else Fraction(0)
    return [numbers.get(value, share) for value in possible]
