"""Compilation, step 2: the closure of implications between atoms, in the bits of a state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

Implication = tuple[int, int, int]
"""(bit, body, head): the implication that a bit represents."""


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """Replaces the bits of rules that a step satisfied by the closure of what they imply.

    n_atoms: atom 0 is true; the other atoms before and after the step are numbered 1, 2, ...
    sources, targets: the implications before and after the step.
    initial: (body, head): implications without condition.
    mask: the bits of `sources`.
    """

    n_atoms: int
    sources: Sequence[Implication]
    targets: Sequence[Implication]
    initial: Sequence[tuple[int, int]]
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
        for body, head in self.initial:
            follows[body] |= 1 << head
        for bit, body, head in self.sources:
            if state & bit:
                follows[body] |= 1 << head
        for middle, reached in enumerate(follows):
            if reached:
                for body in range(self.n_atoms):
                    if follows[body] >> middle & 1:
                        follows[body] |= reached
        true = follows[0]
        closed = 0
        for bit, body, head in self.targets:
            # what is true needs no other reason, and what follows from it is true
            if follows[body] >> head & 1 and not (body and (true >> body | true >> head) & 1):
                closed |= bit
        return closed
