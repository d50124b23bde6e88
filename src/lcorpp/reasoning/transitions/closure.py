"""Compilation, step 2: the closure of implications between atoms, in the bits of a state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

Implication = tuple[int, int, int]
"""(bit, body, head): the implication that a bit represents."""

ALWAYS = 0
"""In place of a bit: the implication has no condition."""


@dataclass(slots=True, eq=False)
class Closure:
    """Replaces the bits of rules that a step satisfied by the closure of what they imply.

    n_atoms: atom 0 is true; the other atoms before and after the step are numbered 1, 2, ...
    closed: the implications before the step, which are closed. added: those that the step adds.
    targets: the implications after the step.
    """

    n_atoms: int
    closed: Sequence[Implication]
    added: Sequence[Implication]
    targets: Sequence[Implication]
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
        for bit, body, head in self.closed:
            if state & bit:
                follows[body] |= 1 << head
        for bit, body, head in self.added:
            if (bit != ALWAYS and not state & bit) or (follows[0] | follows[body]) >> head & 1:
                continue
            reached = follows[head] | 1 << head
            for atom, own in enumerate(follows):
                if atom == body or own >> body & 1:
                    follows[atom] |= reached
        true = follows[0]
        result = 0
        for bit, body, head in self.targets:
            # what is true needs no other reason, and what follows from it is true
            if follows[body] >> head & 1 and not (body and (true >> body | true >> head) & 1):
                result |= bit
        return result
