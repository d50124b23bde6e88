"""Compilation, step 2: the one stable model of stratified rules, for many states at once.

The truth of an atom in n states is one integer of n bits, so a rule costs a few integer operations whatever n
is. With three states and p true in states 0 and 2, q in state 2: ``r :- p, not q`` gives 0b101 & ~0b100 =
0b001.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from lcorpp.reasoning.grounding.ground_program import DERIVE, Atom, Clause, GroundLiteral, GroundProgram
from lcorpp.reasoning.grounding.strong_components import find_strongly_connected_components
from lcorpp.reasoning.transitions.local_distribution import ONE, GuardedClause, Outcome

_Rule = tuple[int, int, tuple[tuple[int, ...], ...], tuple[int, ...]]
"""A rule over numbered atoms: (head, bit, positive, negative).

bit: the bit of the clause in the state, 0 if the rule applies in each state.
positive: for each positive literal the atoms of which one must be true.
negative: atoms that must be false.
"""


@dataclass(slots=True, eq=False)
class Stratified:
    """The local distribution of a recursive component with stratified rules and no selections.

    atoms: the atoms in the heads of rules. strata: the rules, in the order of evaluation.
    decided: the terms whose outcomes are computed; the others have no value, see `derive_values`.
    """

    program: GroundProgram
    terms: tuple[int, ...]
    atoms: Sequence[Atom]
    strata: Sequence[Sequence[_Rule]]
    decided: Sequence[int]

    @classmethod
    def from_clauses(
        cls,
        program: GroundProgram,
        terms: tuple[int, ...],
        clauses: Sequence[GuardedClause],
        decided: Collection[int],
    ) -> Stratified | None:
        """Stratify the clauses of a component; None if an atom depends on its own negation."""
        derivations = [guarded for guarded in clauses if guarded[1].kind is DERIVE]
        for term in program.do.keys() & set(terms) if program.do_is_fact else ():
            derivations.append((0, Clause(DERIVE, term, program.do[term], ()), ()))
        number_of: dict[Atom, int] = {}
        for _, clause, _ in derivations:
            number_of.setdefault((clause.term, clause.value), len(number_of))
        rules: list[_Rule] = []
        needs: dict[int, set[int]] = {number: set() for number in number_of.values()}
        negations: list[tuple[int, int]] = []  # (head, negated atom)
        atoms_of: dict[GroundLiteral, tuple[int, ...]] = {}
        for bit, clause, body in derivations:
            head = number_of[clause.term, clause.value]
            positive: list[tuple[int, ...]] = []
            negative: list[int] = []
            for literal in body:
                atoms = atoms_of.get(literal)
                if atoms is None:
                    term, mask, negated = literal
                    values = [v for v in range(len(program.values[term])) if (mask >> v & 1) != negated]
                    atoms = tuple([number_of[term, v] for v in values if (term, v) in number_of])
                    atoms_of[literal] = atoms
                needs[head].update(atoms)
                if literal[2]:
                    negative.extend(atoms)
                    negations.extend((head, n) for n in atoms)
                else:
                    positive.append(atoms)
            rules.append((head, bit, tuple(positive), tuple(negative)))
        order = find_strongly_connected_components(needs)
        stratum_of = {atom: i for i, own in enumerate(order) for atom in own}
        if any(stratum_of[head] == stratum_of[atom] for head, atom in negations):
            return None
        strata: list[list[_Rule]] = [[] for _ in order]
        for rule in rules:
            strata[stratum_of[rule[0]]].append(rule)
        return cls(program, terms, tuple(number_of), strata, [term for term in terms if term in decided])

    def list_outcomes(self, states: Iterable[int]) -> Mapping[int, list[Outcome]]:
        """Return for each state the one outcome, or none if a term would have two values."""
        rows = list(states)
        truth, contradictory = self._compute_fixed_points(rows)
        columns = [self._decode_values(term, truth, len(rows)) for term in self.decided]
        no_value = {term: len(self.program.values[term]) for term in self.terms}
        known: dict[tuple[int, ...], list[Outcome]] = {}
        outcomes: dict[int, list[Outcome]] = {}
        for row, state in enumerate(rows):
            key = tuple([column[row] for column in columns])
            if key not in known:
                values = no_value | dict(zip(self.decided, key, strict=True))
                known[key] = [Outcome(tuple(values.values()), ONE)]
            outcomes[state] = known[key]
        for row in _list_set_bits(contradictory):
            outcomes[rows[row]] = []
        return outcomes

    def _compute_fixed_points(self, states: Sequence[int]) -> tuple[dict[Atom, int], int]:
        """Compute (atom -> mask of the states in which it is true, mask of the contradictory states)."""
        applies = _transpose(states, {bit for rules in self.strata for _, bit, _, _ in rules if bit})
        applies[0] = (1 << len(states)) - 1
        truth = [0] * len(self.atoms)
        for rules in self.strata:
            grown = True
            while grown:
                grown = False
                for head, bit, positive, negative in rules:
                    value = applies[bit]
                    for atoms in positive:
                        if len(atoms) == 1:  # usual, and faster
                            value &= truth[atoms[0]]
                        else:
                            either = 0
                            for atom in atoms:
                                either |= truth[atom]
                            value &= either
                    for atom in negative:
                        value &= ~truth[atom]
                    if value & ~truth[head]:
                        truth[head] |= value
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


def derive_values(
    program: GroundProgram, terms: tuple[int, ...], clauses: Iterable[Clause], outcome_of: Mapping[int, int]
) -> dict[int, int]:
    """Compute the outcomes of a component with stratified rules in one world.

    Args:
        outcome_of: other term -> its outcome in the world.
    """
    own = set(terms)
    true: list[GuardedClause] = []
    for clause in clauses:
        if all(mask >> outcome_of[term] & 1 for term, mask, _ in clause.body if term not in own):
            true.append((0, clause, [literal for literal in clause.body if literal[0] in own]))
    if not any(own_literals for _, _, own_literals in true):  # usual, and faster
        outcomes = {term: len(program.values[term]) for term in terms}
        return outcomes | {clause.term: clause.value for _, clause, _ in true}
    component = Stratified.from_clauses(program, terms, true, own)
    assert component, "each component whose values are derived is stratified"
    return dict(zip(terms, component.list_outcomes([0])[0][0].values, strict=True))


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
