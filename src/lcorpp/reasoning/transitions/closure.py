"""Compilation, step 2: the closure of implications between atoms, in the bits of a state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """Replaces the bits of rules that a step satisfied by the closure of what they imply.

    n_atoms: the atoms before and after the step are numbered 0, 1, ...
    sources: (bit, body, head): the implication that the bit represents; the body is -1 for a fact.
    initial: (body, head): implications without condition.
    facts: (atom, bit) for the frontier after the step. pairs: (body, head, bit).
    mask: the bits of `sources`.
    """

    n_atoms: int
    sources: Sequence[tuple[int, int, int]]
    initial: Sequence[tuple[int, int]]
    facts: Sequence[tuple[int, int]]
    pairs: Sequence[tuple[int, int, int]]
    mask: int
    _known: dict[int, int] = field(default_factory=dict)

    def apply(self, state: int) -> int:
        """Return the state after the step."""
        own = state & self.mask
        closed = self._known.get(own)
        if closed is None:
            closed = self._known[own] = self._close(own)
        return (state ^ own) | closed

    def _close(self, state: int) -> int:
        follows = [0] * self.n_atoms  # atom -> mask of the atoms that follow from it
        true = 0
        for body, head in self.initial:
            if body < 0:
                true |= 1 << head
            else:
                follows[body] |= 1 << head
        for bit, body, head in self.sources:
            if state & bit:
                if body < 0:
                    true |= 1 << head
                else:
                    follows[body] |= 1 << head
        for middle in range(self.n_atoms):
            reached = follows[middle]
            for body in range(self.n_atoms):
                if follows[body] >> middle & 1:
                    follows[body] |= reached
        for body in range(self.n_atoms):
            if true >> body & 1:
                true |= follows[body]
        closed = 0
        for atom, bit in self.facts:
            if true >> atom & 1:
                closed |= bit
        for body, head, bit in self.pairs:
            # what is true needs no reason, and what follows from it is true
            if follows[body] >> head & 1 and not (true >> body | true >> head) & 1:
                closed |= bit
        return closed
