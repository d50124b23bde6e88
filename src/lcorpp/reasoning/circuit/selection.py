"""What may come of deciding one term, given the clauses about it whose bodies are true."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Protocol

from lcorpp.reasoning.circuit.choice import Breach, Spoken, choice
from lcorpp.reasoning.grounding.ground_program import Clause, Ground
from lcorpp.reasoning.language.syntax import Probability, Selection

Entry = tuple[int, Clause]
"""A clause and its bit, which is set where its body is true; bit 0 stands for a body that is always true."""


@dataclass(slots=True)
class Outcome:
    """What may come of a step.

    values: the outcome of each term of the step; a sequence that may be worked out when it is looked at.
    weight: its probability, where terms are truly random.
    breach: the condition of the language that it breaks, if it does.
    """

    values: Sequence[int]
    weight: Fraction
    breach: Breach | None = None


class Decision(Protocol):
    """Knows what may come of a step, given the bits of its clauses."""

    def outcomes(self, many: Iterable[int]) -> Mapping[int, list[Outcome]]:
        """For each of many states of the bits all outcomes; none if there is no world."""


ONE = Fraction(1)


def decide(
    ground: Ground,
    term: int,
    derived: set[int],
    selected: Sequence[Clause],
    ranged: Sequence[Clause],
    spoken: Sequence[Clause],
    shared: dict[object, Any],
) -> list[tuple[int, Fraction, Breach | None]]:
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
    breach = _condition_1(ground, derived, selected) if derived or len(selected) > 1 else None
    taken = [value for value in possible if value in derived] if derived else possible
    if not taken:
        return []
    if breach is not None:
        return [(value, ONE, breach) for value in taken]
    about = [clause for clause in spoken if is_about(ground, clause, selected[0])]
    # clauses of a statement share their number, so that its identity, quick to compare, is enough
    key = (tuple(possible), tuple([(c.value, id(c.number), c.statement) for c in about]))
    numbers = shared.get(key)
    if numbers is None:
        said: list[Spoken] = [(c.value, c.number or Fraction(0), c.statement) for c in about]
        try:
            numbers = choice(possible, said, ground.values[term])
        except Breach as found:
            return [(value, ONE, found) for value in taken]
        shared[key] = numbers
    if not derived:
        return [(value, number, None) for value, number in zip(possible, numbers, strict=True)]
    return [(value, numbers[possible.index(value)], None) for value in taken]


def _possible(ground: Ground, term: int, selected: Sequence[Clause], ranged: Sequence[Clause]) -> list[int]:
    """The dynamic range, in the order of the declaration; that of all selections, should there be several."""
    possible = list(range(len(ground.values[term])))
    for clause in selected:
        statement = ground.program.statements[clause.statement]
        assert isinstance(statement, Selection)
        if statement.range:
            own = {
                r.value for r in ranged if (r.statement, r.instance) == (clause.statement, clause.instance)
            }
            possible = [value for value in possible if value in own]
    return possible


def _condition_1(ground: Ground, derived: set[int], selected: Sequence[Clause]) -> Breach | None:
    """Whether more than one selection applies to a term, or (2018) a rule gives a value to a random term."""
    statements = ground.program.statements
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
        return Breach(
            clause.statement,
            ("Condition 1: ", " is also selected at random by the rule at"),
            first.statement,
            again,
        )
    if modern and derived:
        return Breach(
            first.statement,
            ("Condition 1: ", " is selected at random while a rule derives it"),
        )
    return None


def is_about(ground: Ground, atom: Clause, selected: Clause) -> bool:
    """Whether a pr-atom speaks of this selection: it has no label, or the label of the selection."""
    statements = ground.program.statements
    said, made = statements[atom.statement], statements[selected.statement]
    if isinstance(said, Probability) and said.label is None:
        return True
    assert isinstance(said, Probability)
    assert isinstance(made, Selection)
    if made.label is None or said.label is None or made.label.name != said.label.name:
        return False
    return not said.label.arguments or atom.label == selected.label
