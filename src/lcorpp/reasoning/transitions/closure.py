"""Compilation, step 2: the closure of implications between atoms, in the bits of a state."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lcorpp.reasoning._diagram import CompiledTransition

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
    A state with a contradiction, or with a goal that no atom can reach any more, is impossible.

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

    def compile_into(self, transition: CompiledTransition) -> None:
        """Add the closure to a transition; it changes a state after the effect of an outcome."""
        goals = [[(atom, bit.bit_length() - 1) for atom, bit in own.items()] for own in self.goals]
        transition.add_closure(
            _number_bits(self.closed),
            _number_bits(self.added),
            _number_bits(self.targets),
            self.false,
            self.n_atoms,
            goals,
        )


def _number_bits(implications: Iterable[Implication]) -> list[Implication]:
    """Return implications with the numbers of their bits, -1 for `ALWAYS`."""
    return [(bit.bit_length() - 1, body, head) for bit, body, head in implications]
