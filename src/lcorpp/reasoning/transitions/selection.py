"""The local distribution of one term: its outcomes and probabilities, given the clauses whose bodies are
true.

A term is derived by rules, selected at random from its dynamic range, set by an intervention, or has no
value. A random value has the probability that a pr-atom assigns; the values without a pr-atom share the rest
evenly.

Source: Baral, Gelfond and Rushton, TPLP 9(1), 2009, section 3.2, equations 3 to 5, Conditions 1 to 3; section
5.1 for unitarity. Condition 1 of 2018: Balai, Gelfond and Zhang, 2019, section 3.2.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol

from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundProgram
from lcorpp.reasoning.language.syntax import Probability, Selection, Statement
from lcorpp.reasoning.transitions.rule_groups import RuleGroup

ONE = Fraction(1)

PrAtom = tuple[int, Fraction, int]
"""A pr-atom that applies: the value, its probability, and the index of the statement."""

GuardedClause = tuple[int, Clause]
"""(bit, clause): a mask with one set bit, or 0. The literals of the clause's body about other components are
satisfied if the bit is set in the state, or if it is 0."""


class ConditionViolation(Exception):
    """A world breaks a condition of P-log; `trellis` finds the world.

    Args:
        statement: the index of the statement that breaks the condition.
        message: the parts of the message; the name of the term goes between them, as terms with the same rule
            group share their violations.
        other: the index of the other statement involved; its place goes between `message` and `after`.
    """

    def __init__(
        self, statement: int, message: tuple[str, ...], other: int | None = None, after: str = ""
    ) -> None:
        self.statement, self.message, self.other, self.after = statement, message, other, after
        self.term_index = 0
        """The index of the term in its component."""
        super().__init__(statement)

    def format(self, statements: Sequence[Statement], names: Sequence[str]) -> str:
        """Return the message.

        Args:
            names: the terms of the component.
        """
        place = "" if self.other is None else f" {statements[self.other].at}"
        text = names[self.term_index].join(self.message)
        return f"{statements[self.statement].at}: {text}{place}{self.after}"


@dataclass(slots=True)
class Outcome:
    """An outcome of a component.

    values: the outcome of each term; a sequence that may be computed lazily.
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


class AcyclicTerm:
    """The local distribution of one term that does not depend on itself.

    Args:
        group: the rule group of the term.
        bits: the bits in the bit slots of the rule group.
        cache: shared by all terms of a program: probabilities, and the outcomes of terms with one rule group.
    """

    __slots__ = ("_cache", "_clause_numbers", "_group", "_program")

    def __init__(
        self, program: GroundProgram, group: RuleGroup, bits: Sequence[int], cache: dict[object, Any]
    ) -> None:
        self._program, self._group, self._cache = program, group, cache
        self._clause_numbers = {
            bits[g.satisfied]: number for number, g in enumerate(group.clause_groups) if not g.always
        }

    def list_outcomes(self, states: Iterable[int]) -> Mapping[int, list[Outcome]]:
        """Return the outcomes of the term for each state of the bits."""
        by_state = {}
        group, cache = self._group, self._cache
        for state in states:
            true = self._list_true_groups(state)
            outcomes = cache.get((group, true))
            if outcomes is None:
                outcomes = cache[group, true] = self._compute_outcomes(true)
            by_state[state] = outcomes
        return by_state

    def _list_true_groups(self, state: int) -> tuple[int, ...]:
        """The clause groups whose bits are set; a term may have thousands of groups of which few are true."""
        numbers = self._clause_numbers
        if state in numbers:
            return (numbers[state],)
        true = []
        while state:
            lowest = state & -state
            true.append(numbers[lowest])
            state ^= lowest
        true.sort()
        return tuple(true)

    def _compute_outcomes(self, true: Iterable[int]) -> list[Outcome]:
        derived: set[int] = set()
        selections: list[Clause] = []
        range_members: list[Clause] = []
        pr_atoms: list[Clause] = []
        groups = self._group.clause_groups
        for number in sorted((*self._group.always, *true)):
            clause = groups[number].clause
            kind = clause.kind
            if kind is ClauseKind.DERIVE:
                derived.add(clause.value)
            elif kind is ClauseKind.SELECT:
                selections.append(clause)
            elif kind is ClauseKind.RANGE:
                range_members.append(clause)
            else:
                pr_atoms.append(clause)
        term = self._group.terms[0]
        outcomes = enumerate_outcomes(
            self._program, term, derived, selections, range_members, pr_atoms, self._cache
        )
        return [Outcome((value,), weight, violation) for value, weight, violation in outcomes]


def enumerate_outcomes(
    program: GroundProgram,
    term: int,
    derived: set[int],
    selections: Sequence[Clause],
    range_members: Sequence[Clause],
    pr_atoms: Sequence[Clause],
    cache: dict[object, Any],
) -> list[tuple[int, Fraction, ConditionViolation | None]]:
    """Enumerate the outcomes of a term from the clauses about it whose bodies are true.

    Args:
        derived: the values that rules derive.
        selections, range_members, pr_atoms: the clauses of kind SELECT, RANGE and ASSIGN.
        cache: the probabilities computed so far, by the range and the pr-atoms.

    Returns:
        (outcome, probability, violated condition) for each outcome; an empty list if there is no world.
    """
    do = program.do.get(term)
    if do is not None and program.do_is_fact:
        return [(do, ONE, None)] if derived <= {do} else []
    if len(derived) > 1:
        return []
    if not selections:
        return [(next(iter(derived)) if derived else len(program.values[term]), ONE, None)]
    possible = _list_dynamic_range(program, term, selections, range_members)
    if do is not None:
        return [(do, ONE, None)] if do in possible and derived <= {do} else []
    violation = _check_condition_1(program, derived, selections) if derived or len(selections) > 1 else None
    taken = [value for value in possible if value in derived] if derived else possible
    if not taken:
        return []
    if violation is not None:
        return [(value, ONE, violation) for value in taken]
    atoms = [clause for clause in pr_atoms if applies_to(program, clause, selections[0])]
    # the clauses of a statement share their number, so its id, which compares fast, identifies it
    key = (tuple(possible), tuple([(c.value, id(c.number), c.statement) for c in atoms]))
    probabilities = cache.get(key)
    if probabilities is None:
        assigned: list[PrAtom] = [(c.value, c.number or Fraction(0), c.statement) for c in atoms]
        try:
            probabilities = assign_probabilities(possible, assigned, program.values[term])
        except ConditionViolation as found:
            return [(value, ONE, found) for value in taken]
        cache[key] = probabilities
    if not derived:
        return [(value, number, None) for value, number in zip(possible, probabilities, strict=True)]
    return [(value, probabilities[possible.index(value)], None) for value in taken]


def _list_dynamic_range(
    program: GroundProgram, term: int, selections: Sequence[Clause], range_members: Sequence[Clause]
) -> list[int]:
    """List the dynamic range in the order of the declaration; of several selections, the intersection."""
    possible = list(range(len(program.values[term])))
    for clause in selections:
        if program.has_dynamic_range(clause.statement):
            members = {
                member.value
                for member in range_members
                if (member.statement, member.instance) == (clause.statement, clause.instance)
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
        message = "Condition 1: ", " is also selected at random by the rule at"
        return ConditionViolation(clause.statement, message, first.statement, after)
    if is_2018 and derived:
        message = "Condition 1: ", " is selected at random while a rule derives it"
        return ConditionViolation(first.statement, message)
    return None


def applies_to(program: GroundProgram, atom: Clause, selection: Clause) -> bool:
    """Whether a pr-atom applies to a selection: it has no label, or the label of the selection."""
    statements = program.source.statements
    assigned, selected = statements[atom.statement], statements[selection.statement]
    if isinstance(assigned, Probability) and assigned.label is None:
        return True
    assert isinstance(assigned, Probability)
    assert isinstance(selected, Selection)
    if selected.label is None or assigned.label is None or selected.label.name != assigned.label.name:
        return False
    return not assigned.label.arguments or atom.label == selection.label


def assign_probabilities(
    possible: Sequence[int], atoms: Sequence[PrAtom], values: Sequence[str]
) -> list[Fraction]:
    """Compute the probability of each possible value, in their order.

    Args:
        possible: the dynamic range.
        atoms: the pr-atoms that apply to this selection.
        values: the range of the term, for messages.

    Raises:
        ConditionViolation: Condition 2 or 3 is broken, or the probabilities are not unitary.
    """
    numbers: dict[int, Fraction] = {}
    statement_of: dict[int, int] = {}
    for value, number, statement in atoms:
        if not 0 <= number <= 1:
            raise ConditionViolation(statement, (f"the probability {number} is not between 0 and 1",))
        if value in numbers:
            same = statement_of[value] == statement
            message = "Condition 2: ", f"={values[value]} also has a pr-atom at"
            after = " with other values of its variables" if same else ""
            raise ConditionViolation(statement, message, statement_of[value], after)
        if value not in possible:
            members = ", ".join(values[v] for v in possible)
            outside = f"={values[value]} has a pr-atom outside of its dynamic range {{{members}}}"
            raise ConditionViolation(statement, ("Condition 3: ", outside))
        numbers[value], statement_of[value] = number, statement
    if not numbers:
        return [Fraction(1, len(possible))] * len(possible)
    total = sum(numbers.values(), Fraction(0))
    n_unassigned = len(possible) - len(numbers)
    if total > 1 or (total != 1 and not n_unassigned):
        bound = "at most " if n_unassigned else ""
        message = "not unitary: the probabilities of ", f" sum to {total}, not {bound}1"
        raise ConditionViolation(min(statement_of.values()), message)
    share = (1 - total) / n_unassigned if n_unassigned else Fraction(0)
    return [numbers.get(value, share) for value in possible]
