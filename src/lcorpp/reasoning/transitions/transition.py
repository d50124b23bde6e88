"""Compilation, step 2: transitions, the effect of deciding one component on the state.

The state is an integer. Its bits describe the bodies whose terms are partly decided: *pending* (the literals
decided so far are true) and *satisfied* (one of the bodies with a certain head is true). Partial worlds with
equal bits have the same future and become one state; so it does not matter which die shows the six, or which
block is where. `_diagram` advances states in C++, as bytes.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from lcorpp.reasoning._diagram import CompiledTransition
from lcorpp.reasoning.transitions.local_distribution import LocalDistribution
from lcorpp.reasoning.transitions.rule_templates import Child, Conditions

if TYPE_CHECKING:  # few programs are recursive
    from lcorpp.reasoning.transitions.closure import Closure


class Effect(NamedTuple):
    """The effect of an outcome on a state.

    number: in the compiled transition.
    sets: bits to set.
    forbids: bits with one of which the world is impossible (constraints).
    moves: pending bits of bodies of which the outcome satisfies a further part.
    targets_of: if a bit of `moves` is set in the state, the bits to set.
    """

    number: int
    sets: int
    forbids: int
    moves: int
    targets_of: Mapping[int, int]


MAX_ABSORBING_GROUPS = 64
"""A transition looks for redundant bits in at most this many clause groups. Beyond, equivalent states may
remain distinct, which costs time and does not change answers."""

_Updates = Iterable[int]
"""For each body of which an outcome satisfies a part two numbers: its pending bit, 0 if it begins at this
step; and the bit to set, 0 for a constraint, which is then violated. Pairs would be many small objects."""


class Transition:
    """The outcomes of a component and their effect on the state.

    Components with equal structure and bits share one transition.

    Args:
        n_terms: the number of terms in the component.
        distribution: the local distribution of the component.
        input_mask: the bits of the component's clauses, on which the distribution depends.
        children: the components and constraints whose bodies the step updates.
        live_masks: the bits that each branch after the step needs.
        closures: of the recursive components of which the step decides rules.

    absorptions: pairs (satisfied, pending bits): once a body of a group is satisfied, the others are
        irrelevant.
    is_shared: whether several steps of the system have this transition.
    n_words: the number of words of 64 bits of a state, the same for all transitions of a system.
    """

    def __init__(
        self,
        n_terms: int,
        distribution: LocalDistribution,
        input_mask: int,
        children: Sequence[Child],
        live_masks: tuple[int, ...],
        closures: Sequence[Closure],
    ) -> None:
        self.distribution, self.is_shared = distribution, False
        self.input_mask, self.live_masks, self.closures = input_mask, live_masks, closures
        self.n_words = 1
        self.absorptions = _find_absorptions(children)
        self._effects: dict[object, Effect | None] = {}
        # one term: outcome -> the bodies of which it satisfies a part; several: all, with their conditions
        self._updates_of: defaultdict[int, list[int]] = defaultdict(list)
        self._conditional_updates: list[tuple[Conditions, tuple[int, int]]] = []
        self._relevant: list[int] | None = (
            None  # indexes of the terms in conditions, if there are several terms
        )
        for _, parent, bits in children:
            for conditions, pending_slot, target_slot in parent.updates:
                update = bits[pending_slot], bits[target_slot]
                if n_terms > 1:
                    self._conditional_updates.append((conditions, update))
                    continue
                mask = conditions[0][1]
                while mask:
                    lowest = mask & -mask
                    self._updates_of[lowest.bit_length() - 1] += update
                    mask ^= lowest
        if n_terms > 1:
            self._relevant = sorted({i for conditions, _ in self._conditional_updates for i, _ in conditions})

    def find_effect(self, values: Sequence[int]) -> Effect | None:
        """Return the effect of an outcome; None if a constraint forbids the outcome in all states.

        Args:
            values: the outcome of each term of the component.
        """
        if self._relevant is None:
            value = values[0]
            if value not in self._effects:
                self._effects[value] = self._compute_effect(self._updates_of.get(value, ()))
            return self._effects[value]
        key = tuple([values[i] for i in self._relevant])
        if key not in self._effects:
            value_of = dict(zip(self._relevant, key, strict=True))
            self._effects[key] = self._compute_effect(
                bit
                for conditions, update in self._conditional_updates
                if all(mask >> value_of[i] & 1 for i, mask in conditions)
                for bit in update
            )
        return self._effects[key]

    @cached_property
    def compiled(self) -> CompiledTransition:
        """The transition in C++, with the effects found so far."""
        absorptions = [(self.pack(satisfied), self.pack(pending)) for satisfied, pending in self.absorptions]
        live_masks = [self.pack(mask) for mask in self.live_masks]
        compiled = CompiledTransition(self.n_words, self.pack(self.input_mask), live_masks, absorptions)
        for closure in self.closures:
            closure.compile_into(compiled)
        return compiled

    def advance(self, state: int, effect: Effect) -> int | None:
        """Return the state after an outcome, for all branches; None if the outcome is impossible in it."""
        after = self.compiled.advance(self.pack(state), effect.number)
        return None if after is None else int.from_bytes(after, "little")

    def pack(self, bits: int) -> bytes:
        """Return the bits of a state as bytes."""
        return bits.to_bytes(8 * self.n_words, "little")

    def _compute_effect(self, updates: _Updates) -> Effect | None:
        sets, forbids, moves = 0, 0, 0
        targets_of: dict[int, int] = {}
        bits = iter(updates)
        for pending, target in zip(bits, bits, strict=True):
            if not pending:
                if not target:
                    return None
                sets |= target
            elif not target:
                forbids |= pending
            else:
                moves |= pending
                targets_of[pending] = targets_of.get(pending, 0) | target
        size = 8 * self.n_words
        targets = b"".join([targets_of[bit].to_bytes(size, "little") for bit in sorted(targets_of)])
        masks = [mask.to_bytes(size, "little") for mask in (sets, forbids, moves)]
        number = self.compiled.add_effect(masks[0], masks[1], masks[2], targets)
        return Effect(number, sets, forbids, moves, targets_of)


def _find_absorptions(children: Sequence[Child]) -> list[tuple[int, int]]:
    """Pair the satisfied bit of each clause group with the pending bits of its partly decided bodies."""
    begun = [
        (group, parent.rank, bits)
        for _, parent, bits in children
        for group in parent.clause_groups
        if bits[group.satisfied_slot]
    ]
    if len(begun) > MAX_ABSORBING_GROUPS:
        return []
    pairs = []
    for group, rank, bits in begun:
        # different bits, so their sum is their union
        pending = sum([bits[slot] for slot, first, last in group.pending if first <= rank < last])
        if pending:
            pairs.append((bits[group.satisfied_slot], pending))
    return pairs
