"""Compilation, step 2: transitions, the effect of deciding one component on the state.

The state is an integer. It describes the bodies whose terms are partly decided, by two kinds of bits:
*falsified* (a literal of the body is false) and *satisfied* (this body, or one of several bodies with the
same head, is true). Partial worlds with equal bits have the same future and become one state; so it does not
matter which die shows the six, or which block is where.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence

from lcorpp.reasoning.transitions.local_distribution import LocalDistribution
from lcorpp.reasoning.transitions.rule_templates import Child, Conditions

Effect = tuple[int, int, int, Mapping[int, int]]
"""The effect of an outcome on a state: (sets, requires, completes, satisfied_of).

sets: bits to set.
requires: falsified bits without which the world is impossible (constraints).
completes: the falsified bits of the bodies whose last step this is.
satisfied_of: if a bit in completes is not set in the state, set the bit to which this maps it.
"""

MAX_ABSORBING_GROUPS = 64
"""A transition looks for redundant bits in at most this many clause groups. Beyond, equivalent states may
remain distinct, which costs time and does not change answers."""

_Update = tuple[int, bool, int]
"""A body that an outcome does not falsify: its falsified bit (0 if none), whether this is its last step, and
its satisfied bit (0 for a constraint)."""


class Transition:
    """The outcomes of a component and their effect on the state.

    Components with equal structure and bits share one transition.

    Args:
        n_terms: the number of terms in the component.
        distribution: the local distribution of the component.
        input_mask: the bits of the component's clauses, on which the distribution depends.
        children: the components and constraints whose bodies the step updates.
        live_masks: the bits that each branch after the step needs.

    absorptions: pairs (satisfied, falsified bits): once a body of a group is satisfied, the others are
        irrelevant.
    is_shared: whether several steps of the system have this transition.
    """

    __slots__ = ("_conditional_updates", "_effects", "_open_bits", "_relevant", "_updates_of", "absorptions",
                 "distribution", "input_mask", "is_shared", "live_masks")  # fmt: skip

    def __init__(
        self,
        n_terms: int,
        distribution: LocalDistribution,
        input_mask: int,
        children: Sequence[Child],
        live_masks: tuple[int, ...],
    ) -> None:
        self.distribution, self.is_shared = distribution, False
        self.input_mask, self.live_masks = input_mask, live_masks
        self.absorptions = _find_absorptions(children)
        self._open_bits = 0  # the falsified bits of the bodies that continue
        self._effects: dict[object, Effect | None] = {}
        # one term: outcome -> the bodies it does not falsify; several terms: all bodies with their conditions
        self._updates_of: defaultdict[int, list[_Update]] = defaultdict(list)
        self._conditional_updates: list[tuple[Conditions, _Update]] = []
        self._relevant: list[int] | None = (
            None  # indexes of the terms in conditions, if there are several terms
        )
        for _, parent, bits, _ in children:
            for conditions, falsified_slot, is_last, satisfied_slot in parent.updates:
                update = bits[falsified_slot], is_last, bits[satisfied_slot]
                if not is_last:
                    self._open_bits |= update[0]
                if n_terms > 1:
                    self._conditional_updates.append((conditions, update))
                    continue
                mask = conditions[0][1]
                while mask:
                    lowest = mask & -mask
                    self._updates_of[lowest.bit_length() - 1].append(update)
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
                update
                for conditions, update in self._conditional_updates
                if all(mask >> value_of[i] & 1 for i, mask in conditions)
            )
        return self._effects[key]

    def _compute_effect(self, updates: Iterable[_Update]) -> Effect | None:
        sets, requires, completes = self._open_bits, 0, 0
        satisfied_of: dict[int, int] = {}
        for falsified, is_last, satisfied in updates:
            if not is_last:
                sets &= ~falsified
            elif not satisfied:
                if not falsified:
                    return None
                requires |= falsified
            elif not falsified:
                sets |= satisfied
            else:
                completes |= falsified
                satisfied_of[falsified] = satisfied
        return sets, requires, completes, satisfied_of


def _find_absorptions(children: Sequence[Child]) -> list[tuple[int, int]]:
    """Pair the satisfied bit of each clause group with the falsified bits of its partly decided bodies."""
    begun = [
        (group, parent.rank, bits)
        for _, parent, bits, _ in children
        for group in parent.clause_groups
        if bits[group.satisfied_slot]
    ]
    if len(begun) > MAX_ABSORBING_GROUPS:
        return []
    pairs = []
    for group, rank, bits in begun:
        # different bits, so their sum is their union
        open_bits = sum([bits[b.falsified_slot] for b in group.bodies if b.first <= rank < b.last])
        if open_bits:
            pairs.append((bits[group.satisfied_slot], open_bits))
    return pairs
