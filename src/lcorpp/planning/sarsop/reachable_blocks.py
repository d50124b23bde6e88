"""Smaller blocks for large models: the kernels' vectors and beliefs are stored over their own block only.

The blocks of the kernels' model serve every belief. Beliefs that some starts reach may lie within much
smaller ones: where a robot knows its place and moves without fail, each place is a block even if no
observation shows it. Observations that also show this block change nothing at such beliefs, and the kernels
find the blocks in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.planning._native import Model, find_reachable_blocks
from lcorpp.planning.sparse import Int32Array, SparseTables
from lcorpp.values import Belief, Indices

MAX_BLOCK_STATES = 4096
"""Blocks of the model up to this size are used as they are: their policies serve every start."""


@dataclass(frozen=True, eq=False)
class ReachableBlocks:
    """Blocks such that every belief that some starts reach lies within one, or is a start over several.

    block: (S,) -1 for states that are not reached. spread: states of the starts over several blocks, rising.
    """

    block: Int32Array
    spread: Indices

    @classmethod
    def find(cls, model: Model, starts: Sequence[Belief]) -> ReachableBlocks | None:
        """Return the blocks that starts (S,) reach; None if the blocks of the model are small enough."""
        if np.bincount(model.export_blocks()).max() <= MAX_BLOCK_STATES:
            return None
        supports = [np.flatnonzero(start).astype(np.int32) for start in starts]
        begins = np.cumsum([0, *map(len, supports)]).astype(np.int64)
        block = find_reachable_blocks(model, begins, np.concatenate(supports))
        spread = [support for support in supports if np.ptp(block[support])]
        return cls(block, np.unique(np.concatenate([np.zeros(0, np.intp), *spread])))

    def cover(self, belief: Belief) -> bool:
        """Return whether a belief (S,) lies within one block, or within the starts over several."""
        support = np.flatnonzero(belief)
        blocks = self.block[support]
        return bool((blocks >= 0).all() and (not np.ptp(blocks) or np.isin(support, self.spread).all()))

    def find_spread_sets(self, model: Model) -> list[Indices]:
        """Return the sets of states within which the beliefs over several blocks of a kernel's model lie.

        The kernels separate states of one block if no action leads to one of them.
        """
        known = model.export_blocks()
        reached = np.flatnonzero(self.block >= 0)
        pairs = np.unique(np.stack([self.block[reached], known[reached]], axis=1), axis=0)
        separated = np.flatnonzero(np.bincount(pairs[:, 0]) > 1).tolist()
        sets = [np.flatnonzero(self.block == block) for block in separated]
        return [self.spread, *sets] if len(self.spread) else sets

    def refine(self, observation: SparseTables) -> SparseTables:
        """Return the table (A, S, O') of observations that also show the block of the next state."""
        A, S, O = observation.shape  # noqa: E741
        block = self.block[observation.rows % S].astype(np.int64) + 1
        _, columns = np.unique(block * O + observation.columns, return_inverse=True)
        shape = A, S, int(columns.max()) + 1
        return SparseTables(shape, observation.begins, columns.astype(np.int32), observation.values)
