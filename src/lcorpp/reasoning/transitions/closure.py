"""Compilation, step 2: the closure of implications between atoms, in the bits of a state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field


@dataclass(slots=True, eq=False)
class Closure:
    """Replaces the bits of rules that a step satisfied by the closure of what they imply.

    n_atoms: the atoms before and after the step are numbered 0, 1, ...
    closed: (bit, body, head): the implications before the step, which are closed; the body is -1 for a fact.
    added: (bit, body, head): those that the step adds; without condition if the bit is 0.
    facts: (atom, bit) for the frontier after the step. pairs: (body, head, bit).
    """

    n_atoms: int
    closed: Sequence[tuple[int, int, int]]
    added: Sequence[tuple[int, int, int]]
    facts: Sequence[tuple[int, int]]
    pairs: Sequence[tuple[int, int, int]]
    _mask: int = field(init=False)
    _known: dict[int, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._mask = sum({bit for bit, _, _ in (*self.closed, *self.added)})

    def apply(self, state: int) -> int:
        """Return the state after the step."""
        own = state & self._mask
        closed = self._known.get(own)
        if closed is None:
            closed = self._known[own] = self._close(own)
        return (state ^ own) | closed

    def _close(self, state: int) -> int:
        follows = [0] * self.n_atoms  # atom -> mask of the atoms that follow from it
        true = 0
        for bit, body, head in self.closed:
            if state & bit:
                if body < 0:
                    true |= 1 << head
                else:
                    follows[body] |= 1 << head
        for bit, body, head in self.added:
            if (bit and not state & bit) or true >> head & 1:
                continue
            reached = follows[head] | 1 << head
            if body < 0 or true >> body & 1:
                true |= reached
            else:
                for atom, own in enumerate(follows):
                    if atom == body or own >> body & 1:
                        follows[atom] |= reached
        # what is true needs no reason, and what follows from it is true
        result = sum([bit for atom, bit in self.facts if true >> atom & 1])
        for body, head, bit in self.pairs:
            if follows[body] >> head & 1 and not (true >> body | true >> head) & 1:
                result |= bit
        return result
