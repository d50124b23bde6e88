"""Step 2e: build the transitions of all components in elimination order.

Each component gets its rule group, each slot of a rule group a bit of the state for as long as it is needed,
as in register allocation. Components with the same rule group, bits and dependents share one `Transition`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from heapq import heappop, heappush
from typing import Any

from lcorpp.reasoning.grounding.ground_program import Clause, GroundProgram
from lcorpp.reasoning.transitions.recursive_components import build_component
from lcorpp.reasoning.transitions.rule_groups import Dependency, RuleGroup, describe_structure
from lcorpp.reasoning.transitions.selection import AcyclicTerm, LocalDistribution
from lcorpp.reasoning.transitions.transition import Transition

_Dependents = list[tuple[RuleGroup, Dependency, list[int]]]
"""The later rule groups that depend on a step, each with its dependency and the bits in its slots."""


def build_transitions(
    program: GroundProgram,
    clauses: Sequence[Clause],
    outcomes: Sequence[int],
    order: Sequence[tuple[int, ...]],
    queried: set[int],
) -> list[Transition]:
    """Build the transitions of the components in their order.

    Args:
        clauses, outcomes: the results of `simplify`.
        order: the terms of each component.
        queried: the terms whose outcomes queries read.
    """
    return _TransitionBuilder(program, clauses, outcomes, order).build(queried)


class _TransitionBuilder:
    def __init__(
        self,
        program: GroundProgram,
        clauses: Sequence[Clause],
        outcomes: Sequence[int],
        order: Sequence[tuple[int, ...]],
    ) -> None:
        self._program, self._outcomes, self._order = program, outcomes, order
        self._step_of = [0] * len(outcomes)  # term -> the step that decides it
        own_clauses: list[list[Clause]] = [[] for _ in order]
        for step, terms in enumerate(order):
            for term in terms:
                self._step_of[term] = step
        # term -> its index in a component of several terms
        self._index_of = {term: i for terms in order if len(terms) > 1 for i, term in enumerate(terms)}
        self._groups: dict[object, RuleGroup] = {}
        self._dependents: list[_Dependents] = [[] for _ in order]
        constraints: dict[tuple[int, ...], list[Clause]] = {}
        for clause in clauses:
            if clause.term < 0:
                constraints.setdefault(tuple([literal[0] for literal in clause.body]), []).append(clause)
            else:
                own_clauses[self._step_of[clause.term]].append(clause)
        sizes = Counter(map(len, own_clauses))
        self._rule_groups = [
            self._find_group(terms, own, sizes[len(own)] > 1)
            for terms, own in zip(order, own_clauses, strict=True)
        ]
        sizes = Counter(map(len, constraints.values()))
        for own in constraints.values():
            self._find_group((), own, sizes[len(own)] > 1)

    def _find_group(
        self, terms: tuple[int, ...], clauses: Sequence[Clause], may_repeat: bool
    ) -> tuple[RuleGroup, list[int]]:
        """Return the rule group of a component or of constraints, and a list for the bits of its slots.

        Args:
            may_repeat: whether another component has the same number of clauses.
        """
        structure: list[object] | None = None
        needed: Collection[int]
        if may_repeat and len(terms) < 2:
            term = terms[0] if terms else -1
            structure, needed = describe_structure(self._program, term, clauses, self._outcomes)
        else:
            inner = set(terms)
            needed = dict.fromkeys([x[0] for clause in clauses for x in clause.body if x[0] not in inner])
        step_of, index_of = self._step_of, self._index_of
        ranks: Sequence[int] = (0,)
        steps = [step_of[term] for term in needed]
        if len(steps) > 1:
            unsorted, steps = steps, sorted(set(steps))
            rank_of = {step: rank for rank, step in enumerate(steps)}
            ranks = tuple([rank_of[step] for step in unsorted])
        key = group = None
        if structure is not None and not (index_of and any(term in index_of for term in needed)):
            structure.append(ranks)
            key = tuple(structure)
            group = self._groups.get(key)
        if group is None:
            places = {term: (rank, index_of.get(term, 0)) for term, rank in zip(needed, ranks, strict=False)}
            group = RuleGroup.from_clauses(terms, clauses, places, self._outcomes)
            if key is not None:
                self._groups[key] = group
        else:
            group.is_shared = True
        bits = [0] * (group.n_slots + 1)  # the last entry is for slot -1: no bit
        for dependency in group.dependencies:
            self._dependents[steps[dependency.rank]].append((group, dependency, bits))
        return group, bits

    def build(self, queried: set[int]) -> list[Transition]:
        """Allocate the bits step by step and build the transitions."""
        allocator = _BitAllocator()
        cache: dict[object, Any] = {}
        known: dict[object, Transition] = {}
        slots_of: dict[Dependency, list[int]] = {}
        transitions: list[Transition] = []
        for (group, own_bits), dependents, terms in zip(
            self._rule_groups, self._dependents, self._order, strict=True
        ):
            may_repeat = group.is_shared
            for other, dependency, bits in dependents:
                may_repeat = may_repeat and other.is_shared
                for slot in dependency.allocates:
                    bits[slot] = allocator.allocate()
            input_mask = sum(own_bits)  # all bodies of the component have ended: these are satisfied bits
            allocator.release(own_bits)
            for _, dependency, bits in dependents:
                if dependency.releases:
                    allocator.release([bits[slot] for slot in dependency.releases])
            key = transition = None
            if may_repeat:
                parts: list[object] = [group, allocator.live_mask, *own_bits]
                for _, dependency, bits in dependents:
                    if dependency not in slots_of:
                        slots_of[dependency] = dependency.list_slots()
                    parts.append(dependency)
                    parts += [bits[slot] for slot in slots_of[dependency]]
                key = tuple(parts)
                transition = known.get(key)
            if transition is None:
                distribution = self._build_distribution(group, own_bits, dependents, terms, queried, cache)
                updates = [(dependency, bits) for _, dependency, bits in dependents]
                transition = Transition(len(terms), distribution, input_mask, updates, allocator.live_mask)
                if key is not None:
                    known[key] = transition
            else:
                transition.is_shared = True
            transitions.append(transition)
            for _, dependency, bits in dependents:
                for slot in dependency.releases:
                    bits[slot] = 0
        return transitions

    def _build_distribution(
        self,
        group: RuleGroup,
        bits: list[int],
        dependents: _Dependents,
        terms: tuple[int, ...],
        queried: set[int],
        cache: dict[object, Any],
    ) -> LocalDistribution:
        if not group.recursive:
            return AcyclicTerm(self._program, group, bits, cache)
        read = queried.intersection(terms) if len(terms) > 1 else set(group.terms)
        for _, dependency, _ in dependents:
            read.update([group.terms[i] for update in dependency.updates for i, _ in update[0]])
        clauses = [(bits[g.satisfied], g.clause) for g in group.groups]
        return build_component(self._program, group.terms, clauses, cache, read)


class _BitAllocator:
    """Allocates the lowest free bits of the state, so that equal components get equal bits."""

    def __init__(self) -> None:
        self.live_mask, self._free, self._next = 0, [], 1  # type: int, list[int], int

    def allocate(self) -> int:
        """Return a bit that is not in use."""
        if self._free:
            bit = heappop(self._free)
        else:
            bit, self._next = self._next, self._next << 1
        self.live_mask |= bit
        return bit

    def release(self, bits: Iterable[int]) -> None:
        """Free bits; 0 is not a bit and is ignored."""
        for bit in bits:
            if bit:
                self.live_mask ^= bit
                heappush(self._free, bit)
