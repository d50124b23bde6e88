"""Compilation, step 2: the bits of a state about a linear recursion.

Of the rules decided so far, only this matters: which atoms are true, and which would follow from which other,
among the atoms of the *frontier*: those that undecided rules may still make true (heads) and those that
undecided rules still use (bodies). So the state has one bit for each atom still used, "is true", and one for
each pair of an atom that may become true and an atom still used, "follows from", closed under transitivity.
If doors open both ways, these are the partitions of the frontier. The number of states then depends on the
frontier, not on the number of doors.

If an atom is guessed to be true, one of the atoms from which it follows must become true: they imply a
*goal*. If it is guessed to be false, none of them may: they imply a contradiction.

Source: the frontier method for network reliability, Hardy, Lucet and Limnios, IEEE Trans. Reliability 56,
2007; closed under implication instead of partitions, as rules have a direction.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from itertools import count
from math import comb, inf

from lcorpp.reasoning.grounding.ground_program import Atom, GroundProgram
from lcorpp.reasoning.transitions.closure import ALWAYS, TRUE, Closure
from lcorpp.reasoning.transitions.linear_recursion import Edge, find_edges
from lcorpp.reasoning.transitions.rule_templates import RuleTemplate

Claim = tuple[int, int, Atom, bool]
"""What a guess demands: (step, slot, atom, whether rules must derive it)."""

_CONTRADICTION: Atom = (-1, 0)
"""In place of an atom, as the head of an edge."""


class RecursionFrontier:
    """The frontier of a linear recursion.

    Args:
        template, bits: of the rules: slot -> bit. steps: rank in the template -> step, for inputs.
        claims: of the guesses.

    bits: of the frontier.
    steps: those that change it.
    finished: rank of a step -> the slots that no later step uses, as the bits of the frontier replace them.
    """

    def __init__(
        self,
        program: GroundProgram,
        template: RuleTemplate,
        bits: Sequence[int],
        steps: Sequence[int],
        claims: Iterable[Claim],
    ) -> None:
        self._bit_in = bits
        self._groups_at: defaultdict[int, list[tuple[int, list[Edge]]]] = defaultdict(list)
        self._claims_at: defaultdict[int, list[Claim]] = defaultdict(list)
        self._first: dict[Atom, int] = {}  # atom -> the first step that decides a rule about it
        self._last_head: dict[Atom, int] = {}  # atom -> the last step that decides a rule with it as head
        self._last_body: dict[Atom, int] = {}  # the same in the body, or that guesses it
        self.finished: dict[int, list[int]] = {}
        fixed: list[Edge] = []
        for group in template.clause_groups:
            edges = find_edges(program, group.clause, group.own_literals) or []
            ranks = sorted({body[-1][0] for body in group.bodies})
            if ranks:
                self.finished.setdefault(ranks[-1], []).append(group.satisfied_slot)
            else:
                fixed += edges
            for at in [steps[rank] for rank in ranks]:
                self._groups_at[at].append((group.satisfied_slot, edges))
                for body, head in edges:
                    self._extend(body, head, at)
        guessed_at = {}
        for claim in claims:
            at, _, atom, _ = claim
            self._claims_at[at].append(claim)
            self._extend(atom, None, at)
            guessed_at[atom] = at
        # a head that is guessed before the body starts does not depend on the body itself, see `_find_needs`
        self._fixed = [
            (body, head)
            for body, head in _close_over(fixed, self._first)
            if body is None or self._first[body] <= guessed_at.get(head, inf)
        ]
        for body, head in self._fixed:
            self._extend(body, head, max(self._first[head], self._first[body] if body else -1))
        self.steps = self._groups_at.keys() | self._claims_at.keys()
        self._first_guess = min(self._claims_at, default=inf)
        self._frontier: list[Atom] = []
        self._starting: defaultdict[int, list[Atom]] = defaultdict(list)  # step -> the atoms that it adds
        for atom, first in self._first.items():
            self._starting[first].append(atom)
        self._bit_of: dict[Edge, int] = {}
        self._goals: list[dict[Atom, int]] = []  # for each goal the bits of the atoms that imply it
        self.bits: list[int] = []

    def _extend(self, body: Atom | None, head: Atom | None, step: int) -> None:
        """Keep two atoms on the frontier until a step that decides a rule about them."""
        for atom, last in ((head, self._last_head), (body, self._last_body)):
            if atom is not None:
                last[atom] = max(last.get(atom, step), step)
                self._first[atom] = min(self._first.get(atom, step), step)

    def advance(self, step: int, live: int) -> tuple[Closure, int]:
        """Move the frontier over a step that decides bodies of the rules, or guesses.

        Args:
            live: the mask of all bits in use.

        Returns:
            (closure, live): how the step changes the bits, and the bits in use then.
        """
        atoms = [*self._frontier, *self._starting[step]]
        number_of: dict[Atom | None, int] = {None: TRUE}
        for number, atom in enumerate(atoms, start=len(number_of)):
            number_of[atom] = number
        false = number_of[_CONTRADICTION] = len(number_of)
        closed = [(bit, number_of[body], number_of[head]) for (body, head), bit in self._bit_of.items()]
        goal = false + 1
        for own in self._goals:
            closed += [(bit, number_of[atom], goal) for atom, bit in own.items()]
            goal += 1
        added = [
            (ALWAYS, number_of[body], number_of[head])
            for body, head in self._fixed
            if max(self._first[head], self._first[body] if body else -1) == step
        ]
        for slot, edges in self._groups_at[step]:
            added += [(self._bit_in[slot], number_of[body], number_of[head]) for body, head in edges]
        for _, slot, atom, is_derived in self._claims_at[step]:
            added.append((self._bit_in[slot], number_of[atom], goal if is_derived else false))
            goal += is_derived
        last_head, last_body = self._last_head, self._last_body
        self._frontier = [x for x in atoms if max(last_head.get(x, -1), last_body.get(x, -1)) > step]
        bodies = [x for x in self._frontier if last_head.get(x, -1) > step]  # may become true
        heads = [x for x in self._frontier if last_body.get(x, -1) > step]  # are used later
        wanted = [(body, head) for head in heads for body in (None, *bodies) if body != head]
        if step >= self._first_guess:
            wanted += [(body, _CONTRADICTION) for body in bodies]
        # no goal follows from another, so there are at most so many (Sperner)
        n_goals = min(goal - false - 1, comb(len(bodies), len(bodies) // 2)) if bodies else 0
        live ^= sum(self.bits)
        free = (bit for bit in map((1).__lshift__, count()) if not live & bit)
        self._bit_of = dict(zip(wanted, free, strict=False))
        self._goals = [dict(zip(bodies, free, strict=False)) for _ in range(n_goals)]
        self.bits[:] = [*self._bit_of.values(), *[bit for own in self._goals for bit in own.values()]]
        live |= sum(self.bits)
        targets = [(bit, number_of[body], number_of[head]) for (body, head), bit in self._bit_of.items()]
        goals = [{number_of[atom]: bit for atom, bit in own.items()} for own in self._goals]
        return Closure(closed, added, targets, false, goal, goals), live


def _close_over(edges: Iterable[Edge], atoms: Collection[Atom]) -> list[Edge]:
    """Find the edges between some atoms that follow from edges between all."""
    heads_of: dict[Atom | None, list[Atom]] = {}
    for body, head in edges:
        heads_of.setdefault(body, []).append(head)
    closed: list[Edge] = []
    for start in (None, *atoms):
        if start not in heads_of:
            continue
        reached: set[Atom] = set()
        stack: list[Atom | None] = [start]
        while stack:
            for head in heads_of.get(stack.pop(), ()):
                if head not in reached:
                    reached.add(head)
                    stack.append(head)
        closed.extend((start, atom) for atom in reached if atom in atoms and atom != start)
    return closed
