"""SARSOP, with the structure of its paper (Kurniawati, Hsu and Lee, RSS 2008).

solver            Algorithm 1: sample, back up and prune until the bounds meet
trials            work for paths, and for the graph of beliefs
look_ahead        how far ahead the paths aim
work_shares       work divided by gains, for both of these
hidden_values     symmetries and potentials of problems with a hidden value, and when they are searched for
potentials        upper bounds by what questions reveal
bounded_search    loop, limits and result, shared with Perseus and the online planner
bounded_tree      beliefs and bounds of a search
mixtures          the precision at all mixtures of some beliefs
paced_search      a search by bounded amounts of work
reachable_blocks  smaller blocks for large models
kernel_model      conversion of a problem for the kernels

Algorithms 2 and 3, which sample and back up, and pruning are kernels in C++: native/sarsop, called through
`lcorpp.planning._native`, whose stub documents them.
"""

from __future__ import annotations

from lcorpp.planning.sarsop.solver import solve

__all__ = ["solve"]
