"""The kernels of SARSOP in numpy: what `lcorpp.planning._native` does in C++, to be read and to be changed.

Both have the same classes and functions with the same arguments, keep the same caches and make the same
choices; tests run them side by side. Where there was no compiler at installation, this one serves.

model     the problem and its blocks           tree        the beliefs that were met, what the search sees
outcomes  where one action leads               node        what is kept of each
bounds    where both bounds start              refresh     what is new is brought to a node
vectors   the lower bound: alpha vectors       backup      both bounds improved at one belief
sawtooth  the upper bound, of all points       pruning     what is dropped again
points    those of one group                   prediction  what a belief may be worth
"""

from __future__ import annotations

from lcorpp.planning.sarsop.numpy_kernels.bounds import blind_policies, fast_informed_bound, mdp_bound
from lcorpp.planning.sarsop.numpy_kernels.model import Model
from lcorpp.planning.sarsop.numpy_kernels.prediction import Prediction
from lcorpp.planning.sarsop.numpy_kernels.tree import Tree

__all__ = ["Model", "Prediction", "Tree", "blind_policies", "fast_informed_bound", "mdp_bound"]
