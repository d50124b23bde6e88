"""The steps of a plan: each component gets its head, each head its bits, and what comes out the same is one
step.
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

_Touched = list[tuple[RuleGroup, Dependency, list[int]]]


def build_transitions(
    ground: GroundProgram,
    clauses: Sequence[Clause],
    outcomes: Sequence[int],
    order: Sequence[tuple[int, ...]],
    wanted: set[int],
) -> list[Transition]:
    """The steps that decide the components of a program in their order.

    Args:
        clauses, outcomes: as `simplified` gives them.
        wanted: the terms whose outcomes will be asked for.
    """
    return _TransitionBuilder(ground, clauses, outcomes, order).steps(wanted)


class _TransitionBuilder:
    def __init__(
        self,
        ground: GroundProgram,
        clauses: Sequence[Clause],
        outcomes: Sequence[int],
        order: Sequence[tuple[int, ...]],
    ) -> None:
        self._ground, self._outcomes, self._order = ground, outcomes, order
        self._place = [0] * len(outcomes)
        own: list[list[Clause]] = [[] for _ in order]
        for position, terms in enumerate(order):
            for term in terms:
                self._place[term] = position
        self._which = {term: i for terms in order if len(terms) > 1 for i, term in enumerate(terms)}
        self._known: dict[object, RuleGroup] = {}
        self._touched: list[_Touched] = [[] for _ in order]
        constraints: dict[tuple[int, ...], list[Clause]] = {}
        for clause in clauses:
            if clause.term < 0:
                constraints.setdefault(tuple([literal[0] for literal in clause.body]), []).append(clause)
            else:
                own[self._place[clause.term]].append(clause)
        sizes = Counter(map(len, own))
        self._heads = [
            self._head(terms, said, sizes[len(said)] > 1) for terms, said in zip(order, own, strict=True)
        ]
        sizes = Counter(map(len, constraints.values()))
        for said in constraints.values():
            self._head((), said, sizes[len(said)] > 1)

    def _head(
        self, terms: tuple[int, ...], clauses: Sequence[Clause], compared: bool
    ) -> tuple[RuleGroup, list[int]]:
        """The head of a component or of constraints, and its slots.

        Args:
            compared: whether other heads may be the same.
        """
        seen: list[object] | None = None
        asked: Collection[int]
        if compared and len(terms) < 2:
            seen, asked = describe_structure(self._ground, terms[0] if terms else -1, clauses, self._outcomes)
        else:
            inner = set(terms)
            asked = dict.fromkeys([x[0] for clause in clauses for x in clause.body if x[0] not in inner])
        place, which = self._place, self._which
        ranks: Sequence[int] = (0,)
        places = [place[need] for need in asked]
        if len(places) > 1:
            unsorted, places = places, sorted(set(places))
            number = {position: rank for rank, position in enumerate(places)}
            ranks = tuple([number[position] for position in unsorted])
        key = head = None
        if seen is not None and not (which and any(need in which for need in asked)):
            seen.append(ranks)
            key = tuple(seen)
            head = self._known.get(key)
        if head is None:
            stages = {need: (rank, which.get(need, 0)) for need, rank in zip(asked, ranks, strict=False)}
            head = RuleGroup.of(terms, clauses, stages, self._outcomes)
            if key is not None:
                self._known[key] = head
        else:
            head.again = True
        bits = [0] * (head.slots + 1)  # the last is that of slot -1, for what needs no bit
        for stage in head.stages:
            self._touched[places[stage.rank]].append((head, stage, bits))
        return head, bits

    def steps(self, wanted: set[int]) -> list[Transition]:
        """The steps, in which those terms are asked for."""
        bits = _BitAllocator()
        shared: dict[object, Any] = {}
        known: dict[object, Transition] = {}
        slots: dict[Dependency, list[int]] = {}
        found: list[Transition] = []
        for (head, own), here, terms in zip(self._heads, self._touched, self._order, strict=True):
            again = head.again
            for other, stage, its in here:
                again = again and other.again
                for slot in stage.takes:
                    its[slot] = bits.take()
            mask = sum(own)  # its bodies are finished, and the bits of their groups are all that is left
            bits.free(own)
            for _, stage, its in here:
                if stage.frees:
                    bits.free([its[slot] for slot in stage.frees])
            key = step = None
            if again:  # otherwise it is like no other
                parts: list[object] = [head, bits.live, *own]
                for _, stage, its in here:
                    if stage not in slots:
                        slots[stage] = stage.slots()
                    parts.append(stage)
                    parts += [its[slot] for slot in slots[stage]]
                key = tuple(parts)
                step = known.get(key)
            if step is None:
                touched = [(stage, its) for _, stage, its in here]
                decision: LocalDistribution
                if head.circular:
                    asked = wanted.intersection(terms) if len(terms) > 1 else set(head.terms)
                    for _, stage, _ in here:
                        asked.update([head.terms[i] for touch in stage.touches for i, _ in touch[0]])
                    entries = [(own[group.true], group.clause) for group in head.groups]
                    decision = build_component(self._ground, head.terms, entries, shared, asked)
                else:
                    decision = AcyclicTerm(self._ground, head, own, shared)
                step = Transition(len(terms), decision, mask, touched, bits.live)
                if key is not None:
                    known[key] = step
            else:
                step.again = True
            found.append(step)
            for _, stage, its in here:
                for slot in stage.frees:
                    its[slot] = 0
        return found


class _BitAllocator:
    """Which bits of a state are in use; the lowest free one comes next, so that steps come out the same."""

    def __init__(self) -> None:
        self.live, self._free, self._next = 0, [], 1  # type: int, list[int], int

    def take(self) -> int:
        """A bit that is not in use."""
        if self._free:
            bit = heappop(self._free)
        else:
            bit, self._next = self._next, self._next << 1
        self.live |= bit
        return bit

    def free(self, bits: Iterable[int]) -> None:
        """Bits that are no longer needed; 0 is none."""
        for bit in bits:
            if bit:
                self.live ^= bit
                heappush(self._free, bit)
