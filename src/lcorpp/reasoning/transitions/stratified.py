"""Compilation, step 2: the one stable model of stratified rules, for many states at once.

The truth of an atom in n states is one integer of n bits, so a rule costs a few integer operations whatever n
is. With three states and p true in states 0 and 2, q in state 2: ``r :- p, not q`` gives 0b101 & ~0b100 =
0b001.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from lcorpp.reasoning.grounding.ground_program import GroundProgram
from lcorpp.reasoning.grounding.strong_components import find_strongly_connected_components
from lcorpp.reasoning.transitions.local_distribution import ONE, GuardedClause, Outcome
from lcorpp.reasoning.transitions.rule_templates import DERIVE

Atom = tuple[int, int]
"""(term, value)"""


@dataclass(slots=True, eq=False)
class _Rule:
    """A rule over numbered atoms.

    head: the atom that the rule derives.
    bit: the bit of the clause in the state, 0 if the rule applies in each state.
    positive: for each positive literal the atoms of which one must be true.
    negative: atoms that must be false.
    """

    head: int
    bit: int
    positive: tuple[tuple[int, ...], ...]
    negative: tuple[int, ...]


class _LazyValues(Sequence[int]):
    """The outcomes of all terms of a component; others than the queried ones are computed on access."""

    __slots__ = ("_component", "_known", "_state")

    def __init__(self, component: Stratified, state: int, known: dict[int, int]) -> None:
        self._component, self._state, self._known = component, state, known

    def __len__(self) -> int:
        return len(self._component.terms)

    def __getitem__(self, i):  # type: ignore[no-untyped-def]
        if not 0 <= i < len(self._component.terms):
            raise IndexError(i)
        if i not in self._known:
            self._known = self._component.evaluate(self._state)
        return self._known[i]


@dataclass(slots=True, eq=False)
class Stratified:
    """The local distribution of a recursive component with stratified rules and no selections.

    atoms: the atoms in the heads of rules. strata: the rules, in the order of evaluation.
    queried: the indexes (in `terms`) of the terms whose outcomes are computed at once.
    """

    program: GroundProgram
    terms: tuple[int, ...]
    atoms: Sequence[Atom]
    strata: Sequence[Sequence[_Rule]]
    queried: tuple[int, ...]

    @classmethod
    def from_clauses(
        cls,
        program: GroundProgram,
        terms: tuple[int, ...],
        clauses: Sequence[GuardedClause],
        queried: Iterable[int],
    ) -> Stratified | None:
        """Stratify the clauses of a component; None if an atom depends on its own negation."""
        derivations = [guarded for guarded in clauses if guarded[1].kind is DERIVE]
        number_of: dict[Atom, int] = {}
        for _, clause, _ in derivations:
            number_of.setdefault((clause.term, clause.value), len(number_of))
        rules: list[_Rule] = []
        needs: dict[int, set[int]] = {number: set() for number in number_of.values()}
        negations: list[tuple[int, int]] = []  # (head, negated atom)
        for bit, clause, body in derivations:
            head = number_of[clause.term, clause.value]
            positive: list[tuple[int, ...]] = []
            negative: list[int] = []
            for term, mask, negated in body:
                atoms = tuple(
                    [n for v in range(len(program.values[term])) if (mask >> v & 1) != negated
                     and (n := number_of.get((term, v), -1)) >= 0]
                )  # fmt: skip
                needs[head].update(atoms)
                if negated:
                    negative.extend(atoms)
                    negations.extend((head, n) for n in atoms)
                else:
                    positive.append(atoms)
            rules.append(_Rule(head, bit, tuple(positive), tuple(negative)))
        order = find_strongly_connected_components(needs)
        stratum_of = {atom: i for i, atoms in enumerate(order) for atom in atoms}
        if any(stratum_of[head] == stratum_of[atom] for head, atom in negations):
            return None
        strata: list[list[_Rule]] = [[] for _ in order]
        for rule in rules:
            strata[stratum_of[rule.head]].append(rule)
        queried = set(queried)
        indexes = tuple([i for i, term in enumerate(terms) if term in queried])
        return cls(program, terms, tuple(number_of), [rules for rules in strata if rules], indexes)

    def list_outcomes(self, states: Iterable[int]) -> Mapping[int, list[Outcome]]:
        """Return for each state the one outcome, or none if a term would have two values."""
        rows = list(states)
        if not rows:
            return {}
        truth, contradictory = self._compute_fixed_points(rows)
        columns = {i: self._decode_values(self.terms[i], truth, len(rows)) for i in self.queried}
        outcomes: dict[int, list[Outcome]] = {}
        for row, state in enumerate(rows):
            known = {i: column[row] for i, column in columns.items()}
            outcomes[state] = [Outcome(_LazyValues(self, state, known), ONE)]
        for row in _list_set_bits(contradictory):
            outcomes[rows[row]] = []
        return outcomes

    def evaluate(self, state: int) -> dict[int, int]:
        """Compute the outcomes of all terms in one state: index of the term -> outcome."""
        truth, _ = self._compute_fixed_points([state])
        return {i: self._decode_values(term, truth, 1)[0] for i, term in enumerate(self.terms)}

    def _compute_fixed_points(self, states: Sequence[int]) -> tuple[dict[Atom, int], int]:
        """Compute (atom -> mask of the states in which it is true, mask of the contradictory states)."""
        applies = _transpose(states, {rule.bit for rules in self.strata for rule in rules if rule.bit})
        applies[0] = (1 << len(states)) - 1
        truth = [0] * len(self.atoms)
        for rules in self.strata:
            grown = True
            while grown:
                grown = False
                for rule in rules:
                    value = applies[rule.bit]
                    for atoms in rule.positive:
                        if len(atoms) == 1:  # usual, and faster
                            value &= truth[atoms[0]]
                        else:
                            either = 0
                            for atom in atoms:
                                either |= truth[atom]
                            value &= either
                    for atom in rule.negative:
                        value &= ~truth[atom]
                    before = truth[rule.head]
                    after = before | value
                    if after != before:
                        truth[rule.head] = after
                        grown = True
        by_atom = dict(zip(self.atoms, truth, strict=True))
        has_value: defaultdict[int, int] = defaultdict(int)
        contradictory = 0
        for (term, _), value in by_atom.items():
            contradictory |= has_value[term] & value
            has_value[term] |= value
        return by_atom, contradictory

    def _decode_values(self, term: int, truth: Mapping[Atom, int], n_states: int) -> list[int]:
        """The outcome of a term in each state."""
        column = [len(self.program.values[term])] * n_states
        for value in range(len(self.program.values[term])):
            for row in _list_set_bits(truth.get((term, value), 0)):
                column[row] = value
        return column


def _list_set_bits(number: int) -> list[int]:
    """The positions of the bits that are set, highest first."""
    text = bin(number)
    last = len(text) - 1
    return [last - i for i, digit in enumerate(text) if digit == "1"]


def _transpose(states: Sequence[int], bits: Iterable[int]) -> dict[int, int]:
    """Convert states to columns: bit -> the mask of the states in which it is set."""
    positions = [bit.bit_length() - 1 for bit in bits]
    if not positions:
        return {}
    width = max(positions) + 1
    # one string with the binary digits of all states: the digits of one bit are `width` apart
    digits = "".join([f"{state & (1 << width) - 1:0{width}b}" for state in reversed(states)])
    return {1 << position: int(digits[width - 1 - position :: width], 2) for position in positions}
