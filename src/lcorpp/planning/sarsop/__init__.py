"""SARSOP, in the steps of its paper (Kurniawati, Hsu and Lee, RSS 2008).

solver       Algorithm 1: sample, back up, prune until the bounds meet
sampling     one trial, Algorithm 2, to be read and changed: it runs on either kernels
engine       what the kernels offer, and which are taken: those in native/ (C++), or their twins
twin         the kernels in numpy: bounds, vectors, points, the belief tree, backups, pruning
upper_bound  what is left of the upper bound when the search is over
"""

from __future__ import annotations

from lcorpp.planning.sarsop.solver import solve

__all__ = ["solve"]
