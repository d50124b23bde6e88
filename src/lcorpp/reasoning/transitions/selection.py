"""What may come of deciding one term, given the clauses about it whose bodies are true."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol

from lcorpp.reasoning.grounding.ground_program import Clause, ClauseKind, GroundProgram
from lcorpp.reasoning.language.syntax import Probability, Selection, Statement
from lcorpp.reasoning.transitions.rule_groups import RuleGroup

PrAtom = tuple[int, Fraction, int]
"""What one pr-atom says: the value, its number, and the position of the statement."""


class ConditionViolation(Exception):
    """A condition of the language is broken; in which world is not known yet, and statements are positions.

    Args:
        statement: the one that breaks it.
        message: how, in parts between which the name of the term stands: terms of which the same is said
            share their violations.
        other: where another statement has part in it, it stands between `message` and `after`.
    """

    def __init__(
        self, statement: int, message: tuple[str, ...], other: int | None = None, after: str = ""
    ) -> None:
        self.statement, self.message, self.other, self.after = statement, message, other, after
        self.which = 0
        """Which of the terms of its step it is about."""
        super().__init__(statement)

    def told(self, statements: Sequence[Statement], names: Sequence[str]) -> str:
        """The message with the places of the statements and the name of its term, one of those of a step."""
        place = "" if self.other is None else f" {statements[self.other].at}"
        return f"{statements[self.statement].at}: {names[self.which].join(self.message)}{place}{self.after}"


def assign_probabilities(
    possible: Sequence[int], spoken: Sequence[PrAtom], values: Sequence[str]
) -> list[Fraction]:
    """The probability of each possible value, in their order.

    Args:
        possible: the dynamic range.
        spoken: the pr-atoms that are about this selection.
        values: the whole range of the term, for messages.

    Raises:
        ConditionViolation: two pr-atoms for one value, one outside of the range, or no probabilities.
    """
    numbers: dict[int, Fraction] = {}
    by: dict[int, int] = {}
    for value, number, statement in spoken:
        if not 0 <= number <= 1:
            raise ConditionViolation(statement, (f"the probability {number} is not between 0 and 1",))
        if value in numbers:
            same = by[value] == statement
            raise ConditionViolation(
                statement,
                ("Condition 2: ", f"={values[value]} also has a pr-atom at"),
                by[value],
                " with other values of its variables" if same else "",
            )
        if value not in possible:
            shown = ", ".join(values[v] for v in possible)
            raise ConditionViolation(
                statement,
                (
                    "Condition 3: ",
                    f"={values[value]} has a pr-atom outside of its dynamic range {{{shown}}}",
                ),
            )
        numbers[value], by[value] = number, statement
    if not numbers:
        return [Fraction(1, len(possible))] * len(possible)
    total = sum(numbers.values(), Fraction(0))
    rest = len(possible) - len(numbers)
    if total > 1 or (total != 1 and not rest):
        raise ConditionViolation(
            min(by.values()),
            ("not unitary: the probabilities of ", f" sum to {total}, not {'at most ' if rest else ''}1"),
        )
    share = (1 - total) / rest if rest else Fraction(0)
    return [numbers.get(value, share) for value in possible]


GuardedClause = tuple[int, Clause]
"""A clause and its bit, which is set where its body is true; bit 0 stands for a body that is always true."""


@dataclass(slots=True)
class Outcome:
    """What may come of a step.

    values: the outcome of each term of the step; a sequence that may be worked out when it is looked at.
    weight: its probability, where terms are truly random.
    violation: the condition of the language that it breaks, if it does.
    """

    values: Sequence[int]
    weight: Fraction
    violation: ConditionViolation | None = None


class LocalDistribution(Protocol):
    """Knows what may come of a step, given the bits of its clauses."""

    def outcomes(self, many: Iterable[int]) -> Mapping[int, list[Outcome]]:
        """For each of many states of the bits all outcomes; none if there is no world."""


ONE = Fraction(1)


def enumerate_outcomes(
    ground: GroundProgram,
    term: int,
    derived: set[int],
    selected: Sequence[Clause],
    ranged: Sequence[Clause],
    spoken: Sequence[Clause],
    shared: dict[object, Any],
) -> list[tuple[int, Fraction, ConditionViolation | None]]:
    """The outcomes of a term, given the clauses about it whose bodies are true.

    Args:
        derived: the values that rules give it.
        selected, ranged, spoken: the clauses of kind SELECT, RANGE, ASSIGN.
        shared: the distributions met so far, by what they depend on.
    """
    do = ground.do.get(term)
    if do is not None and ground.do_is_fact:
        return [(do, ONE, None)] if derived <= {do} else []
    if len(derived) > 1:
        return []
    if not selected:
        return [(next(iter(derived)) if derived else len(ground.values[term]), ONE, None)]
    possible = _possible(ground, term, selected, ranged)
    if do is not None:
        return [(do, ONE, None)] if do in possible and derived <= {do} else []
    violation = _condition_1(ground, derived, selected) if derived or len(selected) > 1 else None
    taken = [value for value in possible if value in derived] if derived else possible
    if not taken:
        return []
    if violation is not None:
        return [(value, ONE, violation) for value in taken]
    about = [clause for clause in spoken if applies_to(ground, clause, selected[0])]
    # clauses of a statement share their number, so that its identity, quick to compare, is enough
    key = (tuple(possible), tuple([(c.value, id(c.number), c.statement) for c in about]))
    numbers = shared.get(key)
    if numbers is None:
        said: list[PrAtom] = [(c.value, c.number or Fraction(0), c.statement) for c in about]
        try:
            numbers = assign_probabilities(possible, said, ground.values[term])
        except ConditionViolation as found:
            return [(value, ONE, found) for value in taken]
        shared[key] = numbers
    if not derived:
        return [(value, number, None) for value, number in zip(possible, numbers, strict=True)]
    return [(value, numbers[possible.index(value)], None) for value in taken]


def _possible(
    ground: GroundProgram, term: int, selected: Sequence[Clause], ranged: Sequence[Clause]
) -> list[int]:
    """The dynamic range, in the order of the declaration; that of all selections, should there be several."""
    possible = list(range(len(ground.values[term])))
    for clause in selected:
        statement = ground.source.statements[clause.statement]
        assert isinstance(statement, Selection)
        if statement.range:
            own = {
                r.value for r in ranged if (r.statement, r.instance) == (clause.statement, clause.instance)
            }
            possible = [value for value in possible if value in own]
    return possible


def _condition_1(
    ground: GroundProgram, derived: set[int], selected: Sequence[Clause]
) -> ConditionViolation | None:
    """Whether more than one selection applies to a term, or (2018) a rule gives a value to a random term."""
    statements = ground.source.statements
    modern = not ground.do_is_fact
    first = selected[0]
    for clause in selected[1:]:
        here, there = statements[first.statement], statements[clause.statement]
        assert isinstance(here, Selection)
        assert isinstance(there, Selection)
        alike = (first.instance, first.label) == (clause.instance, clause.label)
        named = [statement.label.name if statement.label else "" for statement in (here, there)]
        # 2018: random(label, term, range) is an atom, so that rules which give the same one are one selection
        if alike and (here is there or (modern and named[0] == named[1] and here.range == there.range)):
            continue
        again = " with other values of its variables" if here is there else ""
        return ConditionViolation(
            clause.statement,
            ("Condition 1: ", " is also selected at random by the rule at"),
            first.statement,
            again,
        )
    if modern and derived:
        return ConditionViolation(
            first.statement,
            ("Condition 1: ", " is selected at random while a rule derives it"),
        )
    return None


def applies_to(ground: GroundProgram, atom: Clause, selected: Clause) -> bool:
    """Whether a pr-atom speaks of this selection: it has no label, or the label of the selection."""
    statements = ground.source.statements
    said, made = statements[atom.statement], statements[selected.statement]
    if isinstance(said, Probability) and said.label is None:
        return True
    assert isinstance(said, Probability)
    assert isinstance(made, Selection)
    if made.label is None or said.label is None or made.label.name != said.label.name:
        return False
    return not said.label.arguments or atom.label == selected.label


class AcyclicTerm:
    """Knows what may come of deciding one term, given the bits of its clauses.

    Args:
        head: that of the term, and of others of which the same is said.
        bits: the bits in its slots.
        shared: what terms have in common: distributions and, for terms with one head, whole outcomes.
    """

    __slots__ = ("_ground", "_head", "_numbers", "_shared")

    def __init__(
        self, ground: GroundProgram, head: RuleGroup, bits: Sequence[int], shared: dict[object, Any]
    ) -> None:
        self._ground, self._head, self._shared = ground, head, shared
        self._numbers = {bits[g.true]: number for number, g in enumerate(head.groups) if not g.always}

    def outcomes(self, many: Iterable[int]) -> Mapping[int, list[Outcome]]:
        """For each state of the bits, the outcomes of the term."""
        found = {}
        head, shared = self._head, self._shared
        for bits in many:
            true = self._true(bits)
            known = shared.get((head, true))
            if known is None:
                known = shared[head, true] = self._outcomes(true)
            found[bits] = known
        return found

    def _true(self, bits: int) -> tuple[int, ...]:
        """The clauses whose bits are set; there may be thousands, and few of them true."""
        numbers = self._numbers
        if bits in numbers:
            return (numbers[bits],)
        true = []
        while bits:
            lowest = bits & -bits
            true.append(numbers[lowest])
            bits ^= lowest
        true.sort()
        return tuple(true)

    def _outcomes(self, true: Iterable[int]) -> list[Outcome]:
        derived: set[int] = set()
        selected: list[Clause] = []
        ranged: list[Clause] = []
        spoken: list[Clause] = []
        groups = self._head.groups
        for number in sorted((*self._head.always, *true)):
            clause = groups[number].clause
            kind = clause.kind
            if kind is ClauseKind.DERIVE:
                derived.add(clause.value)
            elif kind is ClauseKind.SELECT:
                selected.append(clause)
            elif kind is ClauseKind.RANGE:
                ranged.append(clause)
            else:
                spoken.append(clause)
        found = enumerate_outcomes(
            self._ground, self._head.terms[0], derived, selected, ranged, spoken, self._shared
        )
        return [Outcome((value,), weight, violation) for value, weight, violation in found]
