"""SARSOP, in the steps of its paper (Kurniawati, Hsu and Lee, RSS 2008).

solver    Algorithm 1: sample, back up, prune until the bounds meet
bounds    where both bounds start                    sampling    which beliefs to look at
lower     alpha vectors                              prediction  which of them are worth the depth
upper     points and sawtooth                        backup      both bounds improved at one belief
tree      beliefs and what is known of them          pruning     what is dropped again
"""

from __future__ import annotations

from lcorpp.planning.sarsop.solution import Progress, Solution
from lcorpp.planning.sarsop.solver import solve

__all__ = ["Progress", "Solution", "solve"]
