"""Incremental pruning: the exact backup of a value function, as a minimal set of alpha vectors.

Source: Cassandra, Littman and Zhang, Incremental pruning: a simple, fast, exact method for partially
observable Markov decision processes, UAI 1997.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.planning.solvers.exact.dynamic_programming import DenseModel
from lcorpp.planning.solvers.exact.pruning import prune
from lcorpp.planning.sparse import MAX_BYTES
from lcorpp.values import Array, Indices


class Backup(NamedTuple):
    """The value function one step earlier.

    vectors: (K, S). actions: (K,). witnesses: (K, S) where each was best when it was chosen.
    loss: largest difference to the exact value of this step at any belief.
    """

    vectors: Array
    actions: Indices
    witnesses: Array
    loss: float


def max_prunings(model: DenseModel) -> int:
    """Return the largest number of prunings whose losses add up in a backup."""
    return 2 * max(len(possible) for possible in model.possible)


def back_up(
    model: DenseModel, vectors: Array, beliefs: Array, *, tolerance: float, deadline: float = np.inf
) -> Backup:
    """Compute the value function one step earlier: prune the union of the sets of all actions.

    Args:
        vectors: (K, S) the value function of the next step.
        beliefs: (n, S) where some may be best.
        tolerance: largest loss of each single pruning.
        deadline: on the monotonic clock.

    Raises:
        DeadlineExceeded: the deadline passed.
        ModelError: the cross sum of two sets is too large for memory.
    """
    parts = []
    for a in range(model.actions):
        parts.append(_back_up_action(model, a, vectors, beliefs, tolerance, deadline))
        beliefs = np.concatenate([beliefs, parts[-1].witnesses])
    union = np.concatenate([part.vectors for part in parts])
    actions = np.concatenate([part.actions for part in parts])
    pruned = prune(union, beliefs, tolerance=tolerance, deadline=deadline)
    loss = max(part.loss for part in parts) + pruned.loss
    return Backup(union[pruned.rows], actions[pruned.rows], pruned.witnesses, loss)


def _back_up_action(
    model: DenseModel, action: int, vectors: Array, beliefs: Array, tolerance: float, deadline: float
) -> Backup:
    """Return the set of an action: the cross sum of the projected sets of its observations.

    The cross sum grows by one observation at a time, the smallest sets first, and is pruned each time.

    Source: UAI 1997, Figure 2.
    """
    projected, loss = [], 0.0
    for o in model.possible[action]:
        candidates = (model.transition[action] @ (model.observation[action, o] * vectors).T).T
        candidates *= model.discount
        pruned = prune(candidates, beliefs, tolerance=tolerance, deadline=deadline)
        projected.append((candidates[pruned.rows], pruned.witnesses))
        loss += pruned.loss
    projected.sort(key=lambda part: len(part[0]))
    sums, witnesses = projected[0]
    for added, added_witnesses in projected[1:]:
        count = len(sums) * len(added)
        if 8 * count * model.states > MAX_BYTES:
            raise ModelError(
                f"the exact value function needs sums of {count} vectors over {model.states} states, too many"
                " for memory; use the solver sarsop or perseus"
            )
        candidates = (sums[:, None, :] + added).reshape(-1, model.states)
        near = np.concatenate([witnesses, added_witnesses, beliefs])
        pruned = prune(candidates, near, tolerance=tolerance, deadline=deadline)
        sums, witnesses = candidates[pruned.rows], pruned.witnesses
        loss += pruned.loss
    return Backup(model.reward[action] + sums, np.full(len(sums), action), witnesses, loss)
