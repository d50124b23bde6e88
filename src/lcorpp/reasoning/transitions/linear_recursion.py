"""Compilation, step 2: recursive components with linear rules, such as reachability on an uncertain map.

    reach(q) :- reach(r), open(r, q).      reach(r) :- reach(q), open(r, q).

The component {reach(...)} depends on all doors. Of the doors decided so far, only this matters: which atoms
are true, and which would follow from which other, among the atoms of the *frontier*: those that undecided
rules may still make true (heads) and those that undecided or other rules still use (bodies). So the state
has one bit for each atom still used, "is true", and one for each pair of an atom that may become true and an
atom still used, "follows from", closed under transitivity. If doors open both ways, these are the partitions
of the frontier. The number of states then depends on the frontier, not on the number of doors.

Source: the frontier method for network reliability, Hardy, Lucet and Limnios, IEEE Trans. Reliability 56,
2007; closed under implication instead of partitions, as rules have a direction.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import accumulate

from lcorpp.reasoning.grounding.ground_program import DERIVE, Atom, Clause, GroundLiteral, GroundProgram
from lcorpp.reasoning.transitions.closure import ALWAYS, Closure
from lcorpp.reasoning.transitions.local_distribution import GuardedClause
from lcorpp.reasoning.transitions.rule_templates import ClauseGroup, RuleTemplate

MAX_FRONTIER = 24
"""Components with a larger frontier are decided as a whole."""

Edge = tuple[Atom | None, Atom]
"""(body, head): the head follows from the body, or from nothing if the body is None."""


class LinearRecursion:
    """The frontier of a recursive component with linear rules.

    Args:
        template: the clauses of the component.
        step: the step that decides the component.
        steps: rank -> the step that decides terms of the bodies.
        read_terms: the terms that other rules or queries read.

    finished: rank of a step -> the slots that no later step uses, as the bits of the frontier replace them.
    width: the largest number of frontier atoms, 0 if all rules are without conditions.
    """

    def __init__(
        self,
        program: GroundProgram,
        template: RuleTemplate,
        step: int,
        steps: Sequence[int],
        read_terms: Collection[int],
    ) -> None:
        groups, self._n_slots = template.clause_groups, template.n_slots
        self._groups_at: dict[int, list[ClauseGroup]] = {}  # step -> the groups of which it decides bodies
        self._edges_of = {
            id(group): find_edges(program, group.clause, group.own_literals) for group in groups
        }
        self._always = [group for group in groups if not group.bodies]
        self._first: dict[Atom, int] = {}  # atom -> the first step that decides a rule about it
        self._last_head: dict[Atom, int] = {}  # atom -> the last step that decides a rule with it as head
        self._last_body: dict[Atom, int] = {}  # the same in the body; the last of all steps if it is kept
        self.finished: dict[int, list[int]] = {}
        for group in groups:
            ranks = sorted({body[-1][0] for body in group.bodies})
            if ranks:
                self.finished.setdefault(ranks[-1], []).append(group.satisfied_slot)
            for at in [steps[rank] for rank in ranks]:
                self._groups_at.setdefault(at, []).append(group)
                for body, head in self._edges_of[id(group)] or ():
                    self._extend(body, head, at)
        start = min(self._groups_at, default=step)
        for atom in self._find_kept(groups, read_terms):
            self._first.setdefault(atom, start)
            self._last_body[atom] = step
        fixed = [edge for group in self._always for edge in self._edges_of[id(group)] or ()]
        self._fixed = _close_over(fixed, self._first)
        for body, head in self._fixed:
            self._extend(body, head, max(self._first[head], self._first[body] if body else -1))
        self._frontier: list[Atom] = []
        self._bit_of: dict[Edge, int] = {}
        self._starting: dict[int, list[Atom]] = {}  # step -> the atoms of which it is the first
        growth: Counter[int] = Counter()  # step -> the change of the number of frontier atoms
        for atom, first in self._first.items():
            self._starting.setdefault(first, []).append(atom)
            growth[first] += 1
            growth[self._find_last(atom) + 1] -= 1
        sizes = accumulate([growth[at] for at in sorted(growth)])
        self.width = max(sizes) if self._groups_at else 0

    def _extend(self, body: Atom | None, head: Atom, step: int) -> None:
        """Keep two atoms on the frontier until a step that decides a rule about them."""
        for atom, last in ((head, self._last_head), (body, self._last_body)):
            if atom is not None:
                last[atom] = max(last.get(atom, step), step)
                self._first[atom] = min(self._first.get(atom, step), step)

    def _find_last(self, atom: Atom) -> int:
        return max(self._last_head.get(atom, -1), self._last_body.get(atom, -1))

    def _find_kept(self, groups: Sequence[ClauseGroup], read_terms: Collection[int]) -> Iterator[Atom]:
        """Find the atoms that the last step decides: of terms that are read or that may have two values."""
        heads: dict[int, set[int]] = {}
        for group in groups:
            for _, (term, value) in self._edges_of[id(group)] or ():
                heads.setdefault(term, set()).add(value)
        kept = {term for term, values in heads.items() if len(values) > 1 or term in read_terms}
        for group in groups:
            if not self._edges_of[id(group)]:  # a default: it must exclude what the rules derive
                satisfying = -1
                for _, mask, _ in group.own_literals:
                    satisfying &= mask
                term = group.clause.term
                if any(satisfying >> value & 1 for value in heads.get(term, ())):
                    kept.add(term)
        return ((term, value) for term in kept for value in heads[term])

    def is_touched_at(self, step: int) -> bool:
        """Whether a step decides bodies of the rules."""
        return step in self._groups_at

    def advance(self, step: int, bits: list[int], live: int) -> tuple[Closure, int]:
        """Move the frontier over a step that decides bodies of the rules.

        Args:
            bits: slot -> bit, for the component's template, and the bits of the frontier, which are replaced.
            live: the mask of all bits in use.

        Returns:
            (closure, live): how the step changes the bits, and the bits in use then.
        """
        atoms = [*self._frontier, *self._starting.get(step, ())]
        number_of: dict[Atom | None, int] = {None: 0}
        for i, atom in enumerate(atoms, start=1):
            number_of[atom] = i
        closed = [(bit, number_of[body], number_of[head]) for (body, head), bit in self._bit_of.items()]
        new = [
            (ALWAYS, edge)
            for edge in self._fixed
            if max([self._first[atom] for atom in edge if atom]) == step
        ]
        for group in self._groups_at[step]:
            new += [(bits[group.satisfied_slot], edge) for edge in self._edges_of[id(group)] or ()]
        added = [(bit, number_of[body], number_of[head]) for bit, (body, head) in new]
        self._frontier = [atom for atom in atoms if self._find_last(atom) > step]
        bodies = [atom for atom in self._frontier if self._last_head.get(atom, -1) > step]  # may become true
        heads = [atom for atom in self._frontier if self._last_body.get(atom, -1) > step]  # are used later
        wanted: dict[Edge, None] = dict.fromkeys(
            [(body, head) for head in heads for body in (None, *bodies) if body != head]
        )
        live ^= sum([bit for edge, bit in self._bit_of.items() if edge not in wanted])
        before, self._bit_of = self._bit_of, {}
        for edge in wanted:
            self._bit_of[edge] = before.get(edge) or ~live & (live + 1)
            live |= self._bit_of[edge]
        bits[self._n_slots :] = self._bit_of.values()
        targets = [(bit, number_of[body], number_of[head]) for (body, head), bit in self._bit_of.items()]
        return Closure(len(number_of), closed, added, targets), live

    def list_clauses(self) -> list[GuardedClause]:
        """List the clauses that decide the kept terms after the last step, each with its bit."""
        clauses: list[GuardedClause] = [(0, group.clause, group.own_literals) for group in self._always]
        for (body, (term, value)), bit in self._bit_of.items():
            literals = () if body is None else ((body[0], 1 << body[1], False),)
            clauses.append((bit, Clause(DERIVE, term, value, literals), literals))
        return clauses


def find_edges(
    program: GroundProgram, clause: Clause, own_literals: Sequence[GroundLiteral]
) -> list[Edge] | None:
    """Find the edges of a clause by its literals about the component.

    Returns:
        The edges, none for a default such as ``p=false :- not p``; None if the rule is not linear.
    """
    if clause.kind is not DERIVE:
        return None
    head = clause.term, clause.value
    if any(negated for _, _, negated in own_literals):
        is_default = all(negated and term == clause.term for term, _, negated in own_literals)
        return [] if is_default else None
    if not own_literals:
        return [(None, head)]
    if len(own_literals) > 1:
        return None
    term, mask, _ = own_literals[0]
    return [((term, value), head) for value in range(len(program.values[term])) if mask >> value & 1]


def find_linear_components(
    program: GroundProgram, components: Iterable[tuple[int, ...]], clauses: Iterable[Clause]
) -> dict[tuple[int, ...], list[Clause]]:
    """Find the components of several terms with linear rules; return them with their rules."""
    recursive = [terms for terms in components if len(terms) > 1]
    rules_of: dict[int, list[Clause]] = {}  # term -> the rules of its component
    for terms in recursive:
        shared: list[Clause] = []
        rules_of.update(dict.fromkeys(terms, shared))
    for clause in clauses if rules_of else ():
        if clause.term in rules_of:
            rules_of[clause.term].append(clause)
    return {own: rules_of[own[0]] for own in recursive if _is_linear(program, set(own), rules_of[own[0]])}


def _is_linear(program: GroundProgram, own: set[int], clauses: Iterable[Clause]) -> bool:
    """Whether a component has linear rules, and defaults without conditions that no rule of it uses."""
    bodies, defaults = set[Atom](), set[Atom]()
    if not own.isdisjoint(program.do):
        return False
    for clause in clauses:
        literals = [literal for literal in clause.body if literal[0] in own]
        edges = find_edges(program, clause, literals)
        if edges is None or (not edges and len(literals) < len(clause.body)):
            return False
        if not edges:
            defaults.add((clause.term, clause.value))
        bodies.update([body for body, _ in edges if body is not None])
    return defaults.isdisjoint(bodies)


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
