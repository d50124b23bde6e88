"""Numpy kernels of SARSOP: the same algorithms as `lcorpp.planning._native` in C++, written to be read and
changed.

Both have the classes and functions of `kernel_protocols.Kernels`, compute the same numbers and make the same
decisions; tests compare them call by call. These kernels serve if there was no compiler at installation.

Values, each used by those below it:
model            problem and its blocks            node          belief, its actions, the next beliefs
alpha_vectors    lower bound                       dependencies  vectors that vectors depend on
sawtooth         upper bound                       search_state  all nodes with the bounds they share

Functions on a search state:
refresh  update a node's bounds    backup  improve both bounds at a belief    pruning  drop useless vectors
compression  replace the vectors by those of a controller with fewer plans

bounds (initial bounds), reachable_blocks (a finer partition) and tree (what a search calls) complete the
kernels.
"""

from __future__ import annotations

from lcorpp.planning.sarsop.numpy_kernels.bounds import blind_policies, fast_informed_bound, mdp_bound
from lcorpp.planning.sarsop.numpy_kernels.model import Model
from lcorpp.planning.sarsop.numpy_kernels.reachable_blocks import find_reachable_blocks
from lcorpp.planning.sarsop.numpy_kernels.tree import Tree, ValuePredictor

__all__ = [
    "Model",
    "Tree",
    "ValuePredictor",
    "blind_policies",
    "fast_informed_bound",
    "find_reachable_blocks",
    "mdp_bound",
]
