"""The decision of one term that does not depend on itself."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from lcorpp.reasoning.circuit.rule_groups import Head
from lcorpp.reasoning.circuit.selection import Outcome, decide
from lcorpp.reasoning.grounding.ground_program import Clause, Ground, Kind


class SingleTerm:
    """Knows what may come of deciding one term, given the bits of its clauses.

    Args:
        head: that of the term, and of others of which the same is said.
        bits: the bits in its slots.
        shared: what terms have in common: distributions and, for terms with one head, whole outcomes.
    """

    __slots__ = ("_ground", "_head", "_numbers", "_shared")

    def __init__(self, ground: Ground, head: Head, bits: Sequence[int], shared: dict[object, Any]) -> None:
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
            if kind is Kind.DERIVE:
                derived.add(clause.value)
            elif kind is Kind.SELECT:
                selected.append(clause)
            elif kind is Kind.RANGE:
                ranged.append(clause)
            else:
                spoken.append(clause)
        found = decide(self._ground, self._head.terms[0], derived, selected, ranged, spoken, self._shared)
        return [Outcome((value,), weight, breach) for value, weight, breach in found]
