"""Prediction of a belief's value from similar beliefs, for selective deep sampling.

Source: Kurniawati, Hsu and Lee, RSS 2008, section III-B: beliefs are similar if their initial upper bound and
their entropy fall into the same bins.
"""

from __future__ import annotations

import numpy as np

from lcorpp.planning.sarsop.numpy_kernels.node import PREDICTOR_BINS
from lcorpp.planning.sarsop.numpy_kernels.tree import Tree
from lcorpp.values import Array


class ValuePredictor:
    """Mean lower bound of the visited beliefs, by bins of initial upper bound and entropy."""

    def __init__(self, corners: Array) -> None:
        """
        Args:
            corners: (S,) the initial upper bound at the beliefs that know the state.

        Raises:
            ValueError: `corners` is empty, or a number is not finite.
        """
        values = np.asarray(corners, dtype=np.float64)
        if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
            raise ValueError("expected at least one corner, and finite corners")
        self._lowest = float(values.min())
        self._range = max(float(values.max()) - self._lowest, 1e-300)
        self._sum = np.zeros((PREDICTOR_BINS, PREDICTOR_BINS))
        self._count = np.zeros((PREDICTOR_BINS, PREDICTOR_BINS))

    def learn(self, tree: Tree, node: int) -> None:
        """Add the lower bound of a visited node."""
        own = self._find_bin(tree, node)
        self._sum[own] += tree.cached_lower(node)
        self._count[own] += 1

    def predict(self, tree: Tree, node: int) -> float:
        """Return the mean of the node's bin, or the node's upper bound if the bin is empty."""
        own = self._find_bin(tree, node)
        return float(self._sum[own] / self._count[own]) if self._count[own] else tree.cached_upper(node)

    def _find_bin(self, tree: Tree, number: int) -> tuple[int, int]:
        node = tree.node(number)
        level = (node.informed_value - self._lowest) / self._range * PREDICTOR_BINS
        return int(min(max(level, 0.0), PREDICTOR_BINS - 1.0)), node.entropy_bin
