"""Compilation, step 2: transitions, the effect of deciding one component on the state.

The state is an integer. It describes the bodies whose terms are partly decided, by two kinds of bits:
*falsified* (a literal of the body is false) and *satisfied* (this body, or one of several bodies with the
same head, is true). Partial worlds with equal bits have the same future and become one state; so it does not
matter which die shows the six, or which block is where.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence

from lcorpp.reasoning.transitions.rule_groups import ClauseGroup, Conditions, Dependency
from lcorpp.reasoning.transitions.selection import LocalDistribution

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

_Completion = tuple[int, bool, int]
"""A body that an outcome does not falsify: its falsified bit (0 if none), whether this is its last step, and
its satisfied bit (0 for a constraint)."""


class Transition:
    """The outcomes of a component and their effect on the state.

    Components with equal structure and bits share one transition.

    Args:
        n_terms: the number of terms in the component.
        distribution: the local distribution of the component.
        input_mask: the bits of the component's clauses, on which the distribution depends.
        dependents: the dependencies of later rule groups on this step, each with the bits in its bit slots.
        live_mask: the bits that later steps need.

    absorptions: pairs (satisfied, falsified bits): once a body of a group is satisfied, the others are
        irrelevant.
    is_shared: whether several steps of the system have this transition.
    """

    __slots__ = ("_all_updates", "_completions", "_effects", "_open", "_relevant", "absorptions",
                 "distribution", "input_mask", "is_shared", "live_mask")  # fmt: skip

    def __init__(
        self,
        n_terms: int,
        distribution: LocalDistribution,
        input_mask: int,
        dependents: Sequence[tuple[Dependency, Sequence[int]]],
        live_mask: int,
    ) -> None:
        self.distribution, self.is_shared = distribution, False
        self.input_mask, self.live_mask = input_mask, live_mask
        self.absorptions = _find_absorptions(dependents)
        self._open = 0  # the falsified bits of the bodies that continue
        self._effects: dict[object, Effect | None] = {}
        # one term: outcome -> the bodies it does not falsify; several terms: all bodies with their conditions
        self._completions: defaultdict[int, list[_Completion]] = defaultdict(list)
        self._all_updates: list[tuple[Conditions, _Completion]] = []
        self._relevant: tuple[int, ...] | None = None
        for dependency, bits in dependents:
            for conditions, falsified, is_last, satisfied in dependency.updates:
                body = bits[falsified], is_last, bits[satisfied]  # bits[NO_SLOT] is 0
                if not is_last:
                    self._open |= body[0]
                if n_terms > 1:
                    self._all_updates.append((conditions, body))
                    continue
                mask = conditions[0][1]
                while mask:
                    lowest = mask & -mask
                    self._completions[lowest.bit_length() - 1].append(body)
                    mask ^= lowest
        if n_terms > 1:
            self._relevant = tuple(sorted({i for conditions, _ in self._all_updates for i, _ in conditions}))

    def find_effect(self, values: Sequence[int]) -> Effect | None:
        """Return the effect of an outcome; None if a constraint forbids the outcome in all states.

        Args:
            values: the outcome of each term of the component.
        """
        if self._relevant is None:
            value = values[0]
            if value not in self._effects:
                self._effects[value] = self._compute_effect(self._completions.get(value, ()))
            return self._effects[value]
        key = tuple([values[i] for i in self._relevant])
        if key not in self._effects:
            value_of = dict(zip(self._relevant, key, strict=True))
            self._effects[key] = self._compute_effect(
                [
                    body
                    for conditions, body in self._all_updates
                    if all(mask >> value_of[i] & 1 for i, mask in conditions)
                ]
            )
        return self._effects[key]

    def _compute_effect(self, bodies: Iterable[_Completion]) -> Effect | None:
        sets, requires, completes = self._open, 0, 0
        satisfied_of: dict[int, int] = {}
        for falsified, is_last, satisfied in bodies:
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


def _find_absorptions(dependents: Sequence[tuple[Dependency, Sequence[int]]]) -> list[tuple[int, int]]:
    """Pair the satisfied bit of each clause group with the falsified bits of its partly decided bodies."""
    begun = [
        (group, dependency.rank, bits)
        for dependency, bits in dependents
        for group in dependency.clause_groups
        if bits[group.satisfied]
    ]
    if len(begun) > MAX_ABSORBING_GROUPS:
        return []
    pairs = [(bits[group.satisfied], _find_open_bits(group, rank, bits)) for group, rank, bits in begun]
    return [pair for pair in pairs if pair[1]]


def _find_open_bits(group: ClauseGroup, rank: int, bits: Sequence[int]) -> int:
    """Compute the mask of the falsified bits of the bodies that the step of this rank leaves undecided."""
    mask = 0
    for body in group.bodies:
        if body.first <= rank < body.last:
            mask |= bits[body.falsified]
    return mask
