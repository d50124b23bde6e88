"""What deciding a component does to the state.

A state says of the clauses that are touched but not finished whether their bodies can still be true. It has
two kinds of bits: *denied*, for a body of which some literal was found false, and *true*, for a body, or
one of several bodies that say the same, that was found true. Two ways that lead to the same bits have the
same future, and are one state from there on; so it does not matter which die showed the six, or which block
stands where.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence

from lcorpp.reasoning.transitions.rule_groups import ClauseGroup, Conditions, Dependency
from lcorpp.reasoning.transitions.selection import LocalDistribution

Effect = tuple[int, int, int, Mapping[int, int]]
"""What an outcome does to a state: bits that it sets, denied bits without which there is no world, the denied
bits of the bodies that are finished by it, and the bit to set for each of them that is not denied."""

MAX_ABSORBED_GROUPS = 64
"""How many groups of clauses a step looks through for bits that no longer matter; beyond, states may be
told apart needlessly, which costs time and changes no answer."""

_Touched = tuple[int, bool, int]
"""A body that an outcome does not deny: its bit for *denied* (0 if it needs none), whether it is finished,
and the bit for *true*, 0 for a constraint."""


class Transition:
    """The decision of one component, or of several that look the same, and what it does to the state.

    Args:
        count: how many terms are decided.
        mask: the bits of their clauses.
        touched: what later heads have to do with it, each with the bits in its slots.
        keep: the bits that are needed afterwards.

    absorb: pairs (true, denied): once a body of a group is true, whether the others are denied is no matter.
    again: whether more than one position of the plan has this step.
    """

    __slots__ = ("_effects", "_met", "_open", "_touching", "_watched", "absorb", "again", "decision", "keep",
                 "mask")  # fmt: skip

    def __init__(
        self,
        count: int,
        decision: LocalDistribution,
        mask: int,
        touched: Sequence[tuple[Dependency, Sequence[int]]],
        keep: int,
    ) -> None:
        self.decision, self.mask, self.keep, self.again = decision, mask, keep, False
        self.absorb = _absorbed(touched)
        self._open = 0
        self._effects: dict[object, Effect | None] = {}
        self._met: defaultdict[int, list[_Touched]] = defaultdict(list)
        self._touching: list[tuple[Conditions, _Touched]] = []
        self._watched: tuple[int, ...] | None = None
        for stage, bits in touched:
            for conditions, denied, closes, true in stage.touches:
                body = bits[denied], closes, bits[true]
                if not closes:
                    self._open |= body[0]
                if count > 1:
                    self._touching.append((conditions, body))
                    continue
                allowed = conditions[0][1]
                while allowed:
                    lowest = allowed & -allowed
                    self._met[lowest.bit_length() - 1].append(body)
                    allowed ^= lowest
        if count > 1:
            self._watched = tuple(sorted({i for conditions, _ in self._touching for i, _ in conditions}))

    def effect(self, values: Sequence[int]) -> Effect | None:
        """What an outcome does to a state; None if a constraint forbids it."""
        if self._watched is None:
            value = values[0]
            if value not in self._effects:
                self._effects[value] = self._effect(self._met.get(value, ()))
            return self._effects[value]
        key = tuple([values[i] for i in self._watched])
        if key not in self._effects:
            has = dict(zip(self._watched, key, strict=True))
            self._effects[key] = self._effect(
                [
                    body
                    for conditions, body in self._touching
                    if all(allowed >> has[i] & 1 for i, allowed in conditions)
                ]
            )
        return self._effects[key]

    def _effect(self, met: Iterable[_Touched]) -> Effect | None:
        sets, must, finished = self._open, 0, 0
        true_of: dict[int, int] = {}
        for denied, closes, true in met:
            if not closes:
                sets &= ~denied
            elif not true:
                if not denied:
                    return None
                must |= denied
            elif not denied:
                sets |= true
            else:
                finished |= denied
                true_of[denied] = true
        return sets, must, finished, true_of


def _absorbed(touched: Sequence[tuple[Dependency, Sequence[int]]]) -> list[tuple[int, int]]:
    """For the groups that a step touches: the bits of bodies still open, which a true body makes idle."""
    begun = [(g, stage.rank, bits) for stage, bits in touched for g in stage.groups if bits[g.true]]
    if len(begun) > MAX_ABSORBED_GROUPS:
        return []
    pairs = [(bits[group.true], _idle(group, rank, bits)) for group, rank, bits in begun]
    return [pair for pair in pairs if pair[1]]


def _idle(group: ClauseGroup, rank: int, bits: Sequence[int]) -> int:
    idle = 0
    for body in group.bodies:
        if body.first <= rank < body.last:
            idle |= bits[body.denied]
    return idle
