"""Compilation, step 2: the closure of implications between atoms, in the bits of a state."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import reduce
from operator import or_

Implication = tuple[int, int, int]
"""(bit, body, head): the implication that a bit represents."""

ALWAYS = 0
"""In place of a bit: the implication has no condition."""

TRUE = 0
"""The atom that is true."""


@dataclass(slots=True, eq=False)
class Closure:
    """Replaces the bits of rules that a step satisfied by the closure of what they imply.

    Atoms are numbered: 0 is `TRUE`, then follow those before and after the step, then the contradiction
    (`false`), and then *goals*, which must become true; nothing follows from these. Only the atoms from which
    a goal would follow matter, so a goal is redundant if each atom that implies some other goal implies it.

    closed: the implications before the step, which are closed. added: those that the step adds.
    targets: the implications after the step, without goals.
    false, n_atoms: the number of the contradiction, and of all atoms.
    goals: for each goal after the step, the bits of the implications of which it is the head: body -> bit.
    """

    closed: Sequence[Implication]
    added: Sequence[Implication]
    targets: Sequence[Implication]
    false: int
    n_atoms: int
    goals: Sequence[dict[int, int]]
    _mask: int = field(init=False)
    _targets_of: dict[int, list[tuple[int, int]]] = field(init=False)  # body -> (bit, mask of the head)
    _known: dict[int, int | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._mask = sum({bit for bit, _, _ in (*self.closed, *self.added)})
        self._targets_of = {}
        for bit, body, head in self.targets:
            self._targets_of.setdefault(body, []).append((bit, 1 << head))

    def apply(self, state: int) -> int | None:
        """Return the state after the step; None if there is a contradiction, or a goal cannot be reached."""
        own = state & self._mask
        if own not in self._known:
            self._known[own] = self._close(own)
        closed = self._known[own]
        return None if closed is None else (state ^ own) | closed

    def _close(self, state: int) -> int | None:
        false = self.false
        follows = [1 << atom for atom in range(false)]  # atom -> mask of the atoms that follow from it
        for bit, body, head in self.closed:
            if state & bit:
                follows[body] |= 1 << head
        for bit, body, head in self.added:
            if (bit == ALWAYS or state & bit) and not (follows[TRUE] | follows[body]) >> head & 1:
                reached = follows[head] if head < false else 1 << head
                for atom, own in enumerate(follows):
                    if own >> body & 1:
                        follows[atom] = own | reached
        true = follows[TRUE]
        if true >> false & 1:
            return None
        result = self._reduce_goals(follows) if self.n_atoms > false + 1 else 0
        if result is None:
            return None
        for body, targets in self._targets_of.items():
            own = follows[body]
            if body != TRUE:
                # what is true needs no other reason, what follows from it is true; the false has no effect
                own = 0 if true >> body & 1 else 1 << false if own >> false & 1 else own & ~true
            for bit, head in targets if own else ():
                if own & head:
                    result |= bit
        return result

    def _reduce_goals(self, follows: Sequence[int]) -> int | None:
        """Return the bits of the goals that are not yet reached; None if one cannot be reached."""
        possible: Iterable[int] = self.goals[0] if self.goals else ()  # the atoms that may become true
        masks: set[int] = set()
        open_goals = reduce(or_, follows) & ~follows[TRUE]
        for goal in range(self.false + 1, self.n_atoms):
            if open_goals >> goal & 1:
                masks.add(
                    sum([1 << x for x in possible if follows[x] >> goal & ~follows[x] >> self.false & 1])
                )
        if 0 in masks:
            return None
        smallest: list[int] = []
        for mask in sorted(masks, key=int.bit_count):
            if not any(own & mask == own for own in smallest):
                smallest.append(mask)
        bits = [
            bit
            for mask, bit_of in zip(sorted(smallest), self.goals, strict=False)
            for atom, bit in bit_of.items()
            if mask >> atom & 1
        ]
        return sum(bits)
