"""Compilation, step 2: build the transitions of all components in elimination order.

First each component gets its rule group (`_register_rule_group`), which names bit slots. Then, step by step,
each slot gets a bit of the state for as long as it is needed, as in register allocation (`build`). Components
with the same rule group, bits and dependents share one `Transition`. `transitions/__init__.py` defines these
terms.
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
"""The dependents of a step: (rule group, its dependency on the step, the bits in its bit slots)."""


def build_transitions(
    program: GroundProgram,
    clauses: Sequence[Clause],
    outcomes: Sequence[int],
    order: Sequence[tuple[int, ...]],
    queried: set[int],
) -> list[Transition]:
    """Build the transitions of the components in their order.

    Args:
        clauses: the simplified clauses.
        outcomes: the mask of the possible outcomes of each term.
        order: the terms of each component, in the order of elimination.
        queried: the terms whose outcomes queries read.
    """
    return _TransitionBuilder(program, clauses, outcomes, order).build(queried)


class _TransitionBuilder:
    """Builds the transitions; the arguments are those of `build_transitions`."""

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
        self._rule_group_of: dict[object, RuleGroup] = {}  # description of the structure -> rule group
        self._dependents: list[_Dependents] = [[] for _ in order]
        constraints: dict[tuple[int, ...], list[Clause]] = {}  # the terms of the body -> constraints
        for clause in clauses:
            if clause.term < 0:  # a constraint has no head
                constraints.setdefault(tuple([literal[0] for literal in clause.body]), []).append(clause)
            else:
                own_clauses[self._step_of[clause.term]].append(clause)
        n_equal_sized = Counter(map(len, own_clauses))
        self._rule_groups = [  # step -> (rule group, bits in its bit slots)
            self._register_rule_group(terms, own, n_equal_sized[len(own)] > 1)
            for terms, own in zip(order, own_clauses, strict=True)
        ]
        n_equal_sized = Counter(map(len, constraints.values()))
        for own in constraints.values():  # no step decides constraints: they are dependents only
            self._register_rule_group((), own, n_equal_sized[len(own)] > 1)

    def _register_rule_group(
        self, terms: tuple[int, ...], clauses: Sequence[Clause], has_equal_sized: bool
    ) -> tuple[RuleGroup, list[int]]:
        """Find or create the rule group of a component; make it a dependent of the steps that it depends on.

        Args:
            terms: the terms of the component; none for constraints.
            clauses: the clauses of the component, or constraints over the same terms.
            has_equal_sized: whether another component has the same number of clauses; only then can the rule
                group be shared.

        Returns:
            The rule group, and a list for the bits in its bit slots, whose last entry is for `NO_SLOT`: 0.
        """
        structure: list[object] | None = None
        needed: Collection[int]  # the terms of the bodies that earlier steps decide
        if has_equal_sized and len(terms) < 2:
            term = terms[0] if terms else -1
            structure, needed = describe_structure(self._program, term, clauses, self._outcomes)
        else:
            inner = set(terms)
            needed = dict.fromkeys([x[0] for clause in clauses for x in clause.body if x[0] not in inner])
        step_of, index_of = self._step_of, self._index_of
        steps = [step_of[term] for term in needed]  # below: without repetitions, in order
        ranks: tuple[int, ...] = (0,) * len(steps)  # of the step of each needed term in `steps`
        if len(steps) > 1:
            unsorted, steps = steps, sorted(set(steps))
            rank_of = {step: rank for rank, step in enumerate(steps)}
            ranks = tuple([rank_of[step] for step in unsorted])
        key = rule_group = None
        # the indexes of terms in their components are not in the structure: such rule groups are not shared
        if structure is not None and not (index_of and any(term in index_of for term in needed)):
            structure.append(ranks)
            key = tuple(structure)
            rule_group = self._rule_group_of.get(key)
        if rule_group is None:
            rank_and_index = {
                term: (rank, index_of.get(term, 0)) for term, rank in zip(needed, ranks, strict=True)
            }
            rule_group = RuleGroup.from_clauses(terms, clauses, rank_and_index, self._outcomes)
            if key is not None:
                self._rule_group_of[key] = rule_group
        else:
            rule_group.is_shared = True
        bits = [0] * (rule_group.n_bit_slots + 1)
        for dependency in rule_group.dependencies:
            self._dependents[steps[dependency.rank]].append((rule_group, dependency, bits))
        return rule_group, bits

    def build(self, queried: set[int]) -> list[Transition]:
        """Allocate the bits step by step and build the transitions."""
        allocator = _BitAllocator()
        cache: dict[object, Any] = {}
        transition_of: dict[object, Transition] = {}
        bit_slots_of: dict[Dependency, list[int]] = {}
        transitions: list[Transition] = []
        for (rule_group, own_bits), dependents, terms in zip(
            self._rule_groups, self._dependents, self._order, strict=True
        ):
            is_shareable = rule_group.is_shared
            for dependent, dependency, bits in dependents:
                is_shareable = is_shareable and dependent.is_shared
                for slot in dependency.allocates:
                    bits[slot] = allocator.allocate()
            # every body of the component is decided: only bits for *satisfied* are left
            input_mask = sum(own_bits)
            allocator.release(own_bits)
            for _, dependency, bits in dependents:
                if dependency.releases:
                    allocator.release([bits[slot] for slot in dependency.releases])
            key = transition = None
            if is_shareable:  # equal keys: equal rule group, bits and dependents
                parts: list[object] = [rule_group, allocator.live_mask, *own_bits]
                for _, dependency, bits in dependents:
                    if dependency not in bit_slots_of:
                        bit_slots_of[dependency] = dependency.list_bit_slots()
                    parts.append(dependency)
                    parts += [bits[slot] for slot in bit_slots_of[dependency]]
                key = tuple(parts)
                transition = transition_of.get(key)
            if transition is None:
                distribution = self._build_distribution(
                    rule_group, own_bits, dependents, terms, queried, cache
                )
                updates = [(dependency, bits) for _, dependency, bits in dependents]
                transition = Transition(len(terms), distribution, input_mask, updates, allocator.live_mask)
                if key is not None:
                    transition_of[key] = transition
            else:
                transition.is_shared = True
            transitions.append(transition)
            for _, dependency, bits in dependents:
                for slot in dependency.releases:
                    bits[slot] = 0
        return transitions

    def _build_distribution(
        self,
        rule_group: RuleGroup,
        bits: list[int],
        dependents: _Dependents,
        terms: tuple[int, ...],
        queried: set[int],
        cache: dict[object, Any],
    ) -> LocalDistribution:
        if not rule_group.recursive:
            return AcyclicTerm(self._program, rule_group, bits, cache)
        # the terms whose outcomes queries or dependents read
        read_terms = queried.intersection(terms) if len(terms) > 1 else set(rule_group.terms)
        for _, dependency, _ in dependents:
            read_terms.update(
                [rule_group.terms[i] for update in dependency.updates for i, _ in update.conditions]
            )
        clauses = [(bits[group.satisfied], group.clause) for group in rule_group.clause_groups]
        return build_component(self._program, rule_group.terms, clauses, cache, read_terms)


class _BitAllocator:
    """Allocates the lowest free bits of the state, so that equal components get equal bits.

    A bit is a mask with one set bit; live_mask has all bits in use.
    """

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
