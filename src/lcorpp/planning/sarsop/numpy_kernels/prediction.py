"""A guess at the value of a belief, learnt from beliefs alike: what selective deep sampling goes by.

Source: Kurniawati, Hsu and Lee, RSS 2008, section III-B: beliefs are alike when their initial upper bound and
their entropy fall into one bin.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from lcorpp.values import Array

if TYPE_CHECKING:
    from lcorpp.planning.sarsop.numpy_kernels.tree import Tree

BINS = 32


class Prediction:
    """Mean lower bound of the visited beliefs, by bin of initial upper bound and entropy."""

    def __init__(self, corners: Array) -> None:
        """`corners`: (S,) the initial upper bound where a state is certain.

        Raises:
            ValueError: there are none, or one is not finite.
        """
        values = np.asarray(corners, dtype=np.float64)
        if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
            raise ValueError("corners are finite numbers; there is one at least")
        self._least = float(values.min())
        self._span = max(float(values.max()) - self._least, 1e-300)
        self._sum = np.zeros((BINS, BINS))
        self._count = np.zeros((BINS, BINS))

    def learn(self, tree: Tree, node: int) -> None:
        """Count a visited node with its lower bound."""
        own = self._bin(tree, node)
        self._sum[own] += tree.low(node)
        self._count[own] += 1

    def value(self, tree: Tree, node: int) -> float:
        """The mean of the node's bin, or its upper bound where the bin is empty."""
        own = self._bin(tree, node)
        return float(self._sum[own] / self._count[own]) if self._count[own] else tree.high(node)

    def _bin(self, tree: Tree, node: int) -> tuple[int, int]:
        held = tree.nodes[node]
        level = (held.informed - self._least) / self._span * BINS
        return int(min(max(level, 0.0), BINS - 1.0)), held.entropy
