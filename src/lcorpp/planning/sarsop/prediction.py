"""A guess at the value of a belief, learnt from beliefs alike: what selective deep sampling goes by.

Source: Kurniawati, Hsu and Lee, RSS 2008, section III-B: beliefs are alike when their initial upper bound and
their entropy fall into one bin.
"""

from __future__ import annotations

import numpy as np

from lcorpp.planning.sarsop.tree import Node
from lcorpp.values import Array, Belief

_BINS = 32


class Prediction:
    """Mean lower bound of the visited beliefs, by bin of initial upper bound and entropy."""

    def __init__(self, informed: Array) -> None:
        """`informed`: (A, S) Q values of the initial upper bound."""
        self._informed = informed
        self._least = float(informed.max(axis=0).min())
        self._span = max(float(informed.max()) - self._least, 1e-300)
        self._sum = np.zeros((_BINS, _BINS))
        self._count = np.zeros((_BINS, _BINS))

    def learn(self, node: Node) -> None:
        """Count a visited node with its lower bound."""
        bin_ = self._bin(node.belief)
        self._sum[bin_] += node.low
        self._count[bin_] += 1

    def value(self, node: Node) -> float:
        """The mean of the node's bin, or its upper bound where the bin is empty."""
        bin_ = self._bin(node.belief)
        return float(self._sum[bin_] / self._count[bin_]) if self._count[bin_] else node.high

    def _bin(self, belief: Belief) -> tuple[int, int]:
        share = (float((self._informed @ belief).max()) - self._least) / self._span
        p = belief[belief > 0]
        entropy = -float(p @ np.log(p)) / max(np.log(len(belief)), 1e-300)
        return (
            min(max(int(share * _BINS), 0), _BINS - 1),
            min(max(int(entropy * _BINS), 0), _BINS - 1),
        )
