"""Symmetries and potentials of a problem, for a belief tree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from lcorpp.planning._native import Tree

if TYPE_CHECKING:
    from lcorpp.planning.sarsop.potentials import Potential


@dataclass(frozen=True)
class HiddenBounds:
    """symmetries: for each, the state whose weight each state takes (S). potentials: upper bounds."""

    symmetries: Sequence[Sequence[int]] = ()
    potentials: Sequence[Potential] = ()

    @property
    def found(self) -> bool:
        """Whether there is a symmetry or a potential; then the tree gets a graph of beliefs, too."""
        return bool(self.symmetries or self.potentials)

    def apply(self, tree: Tree) -> None:
        """Add the potentials to a tree, and a graph of beliefs with the symmetries."""
        for own in self.potentials:
            numbers = own.offset, own.scale, own.power, own.entropy
            tree.add_potential(*numbers, own.pairs, own.pair_weights, own.state)
        if self.found:
            tree.add_graph([list(symmetry) for symmetry in self.symmetries])
