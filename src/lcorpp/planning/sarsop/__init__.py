"""SARSOP, with the structure of its paper (Kurniawati, Hsu and Lee, RSS 2008).

solver            Algorithm 1: sample, back up and prune until the bounds meet
path_sampling     Algorithm 2: sample one path; users can replace it
look_ahead        how far ahead the paths aim
bounded_search    loop, limits and result, shared with Perseus and the online planner
bounded_tree      beliefs and bounds of a search
reachable_blocks  smaller blocks for large models
kernel_protocols  the contract of the kernels
kernels           selection of the kernels: C++ (native/sarsop) or numpy (numpy_kernels)
"""

from __future__ import annotations

from lcorpp.planning.sarsop.solver import solve

__all__ = ["solve"]
