"""Circles of rules without chance: one stable model, found stratum by stratum, for many states in one go.

An atom's truth in n states is one integer of n bits, so that a rule is a few operations on integers,
whatever n is.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from lcorpp.reasoning.grounding.ground_program import ClauseKind, GroundProgram
from lcorpp.reasoning.transitions.elimination_order import strongly_connected_components
from lcorpp.reasoning.transitions.selection import ONE, GuardedClause, Outcome

Atom = tuple[int, int]
"""A term and one of its values."""


@dataclass(slots=True, eq=False)
class _Rule:
    """head :- body; a part of the body is true where one of its atoms is, or, if negated, where none is."""

    head: int
    bit: int
    parts: tuple[tuple[int, ...], ...]
    denied: tuple[int, ...]


class _Later(Sequence[int]):
    """The outcomes of all terms of a circle; what nobody asked for is worked out when it is looked at."""

    __slots__ = ("_circle", "_known", "_state")

    def __init__(self, circle: Stratified, state: int, known: dict[int, int]) -> None:
        self._circle, self._state, self._known = circle, state, known

    def __len__(self) -> int:
        return len(self._circle.terms)

    def __getitem__(self, i):  # type: ignore[no-untyped-def]
        if not 0 <= i < len(self._circle.terms):
            raise IndexError(i)
        if i not in self._known:
            self._known = self._circle.whole(self._state)
        return self._known[i]


@dataclass(slots=True, eq=False)
class Stratified:
    """The decision of terms that depend on each other by stratified rules alone.

    atoms: every atom that a rule may derive; strata: the rules in the order of evaluation.
    wanted: positions (in `terms`) of the terms whose outcomes are worked out at once.
    """

    ground: GroundProgram
    terms: tuple[int, ...]
    atoms: Sequence[Atom]
    strata: Sequence[Sequence[_Rule]]
    wanted: tuple[int, ...]

    @classmethod
    def of(
        cls,
        ground: GroundProgram,
        terms: tuple[int, ...],
        entries: Sequence[GuardedClause],
        wanted: Iterable[int],
    ) -> Stratified | None:
        """Prepare a circle; None if its `not` cannot be stratified."""
        derives = [(bit, clause) for bit, clause in entries if clause.kind is ClauseKind.DERIVE]
        number: dict[Atom, int] = {}
        for _, clause in derives:
            number.setdefault((clause.term, clause.value), len(number))
        rules: list[_Rule] = []
        needs: list[set[int]] = [set() for _ in number]
        denied_by: list[tuple[int, int]] = []
        for bit, clause in derives:
            head = number[clause.term, clause.value]
            parts: list[tuple[int, ...]] = []
            denied: list[int] = []
            for term, allowed, negated in clause.body:
                some = tuple(
                    [n for v in range(len(ground.values[term])) if (allowed >> v & 1) != negated
                     and (n := number.get((term, v), -1)) >= 0]
                )  # fmt: skip
                needs[head].update(some)
                if negated:
                    denied.extend(some)
                    denied_by.extend((head, n) for n in some)
                else:
                    parts.append(some)
            rules.append(_Rule(head, bit, tuple(parts), tuple(denied)))
        order = strongly_connected_components(needs)
        stratum = {atom: i for i, atoms in enumerate(order) for atom in atoms}
        if any(stratum[head] == stratum[atom] for head, atom in denied_by):
            return None
        strata: list[list[_Rule]] = [[] for _ in order]
        for rule in rules:
            strata[stratum[rule.head]].append(rule)
        asked = set(wanted)
        return cls(
            ground,
            terms,
            tuple(number),
            [rules for rules in strata if rules],
            tuple([i for i, term in enumerate(terms) if term in asked]),
        )

    def outcomes(self, many: Iterable[int]) -> Mapping[int, list[Outcome]]:
        """For each state of the bits the one outcome there is, or none where a term would have two values."""
        states = list(many)
        if not states:
            return {}
        truth, dead = self._truth(states)
        columns = {i: self._column(self.terms[i], truth, len(states)) for i in self.wanted}
        found: dict[int, list[Outcome]] = {}
        for row, state in enumerate(states):
            known = {i: column[row] for i, column in columns.items()}
            found[state] = [Outcome(_Later(self, state, known), ONE)]
        for row in _ones(dead):
            found[states[row]] = []
        return found

    def whole(self, state: int) -> dict[int, int]:
        """The outcome of every term, by its position, in one state."""
        truth, _ = self._truth([state])
        return {i: self._column(term, truth, 1)[0] for i, term in enumerate(self.terms)}

    def _truth(self, states: Sequence[int]) -> tuple[dict[Atom, int], int]:
        everywhere = (1 << len(states)) - 1
        where = _transposed(states, {rule.bit for rules in self.strata for rule in rules if rule.bit})
        where[0] = everywhere
        truth = [0] * len(self.atoms)
        for rules in self.strata:
            grown = True
            while grown:
                grown = False
                for rule in rules:
                    value = where[rule.bit]
                    for part in rule.parts:
                        if len(part) == 1:
                            value &= truth[part[0]]
                        else:
                            either = 0
                            for atom in part:
                                either |= truth[atom]
                            value &= either
                    for atom in rule.denied:
                        value &= ~truth[atom]
                    before = truth[rule.head]
                    after = before | value
                    if after != before:
                        truth[rule.head] = after
                        grown = True
        by_atom = dict(zip(self.atoms, truth, strict=True))
        taken: dict[int, int] = {}
        twice = 0
        for (term, _), value in by_atom.items():
            twice |= taken.get(term, 0) & value
            taken[term] = taken.get(term, 0) | value
        return by_atom, twice

    def _column(self, term: int, truth: Mapping[Atom, int], size: int) -> list[int]:
        column = [len(self.ground.values[term])] * size
        for value in range(len(self.ground.values[term])):
            for row in _ones(truth.get((term, value), 0)):
                column[row] = value
        return column


def _ones(number: int) -> list[int]:
    """The positions of the bits that are set, the lowest first."""
    text = bin(number)
    last = len(text) - 1
    return [last - i for i, digit in enumerate(text) if digit == "1"]


def _transposed(states: Sequence[int], bits: Iterable[int]) -> dict[int, int]:
    """For each bit the states that have it set, as an integer with one bit for each state."""
    wanted = [bit.bit_length() - 1 for bit in bits]
    if not wanted:
        return {}
    width = max(wanted) + 1
    # the digits of all states in one text: those of one bit stand `width` apart
    digits = "".join([f"{state & (1 << width) - 1:0{width}b}" for state in reversed(states)])
    return {1 << position: int(digits[width - 1 - position :: width], 2) for position in wanted}
