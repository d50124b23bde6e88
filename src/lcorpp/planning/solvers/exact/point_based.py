"""Point-based improvement of plans between two exact backups.

Sources: Zhang and Zhang, Speeding up the convergence of value iteration in POMDPs, JAIR 2001 (steps at the
witnesses between full steps); Ji, Parr, Li, Liao and Carin, Point-based policy iteration, AAAI 2007.
"""

from __future__ import annotations

from time import monotonic
from typing import NamedTuple

import numpy as np

from lcorpp.planning.solvers.exact.dynamic_programming import Controller, DenseModel
from lcorpp.values import Array, Indices

MAX_UNKNOWNS = 4000
"""Largest linear system of a controller; a larger controller is improved step by step only."""


class Plans(NamedTuple):
    """Values (K, S) of plans and their first actions (K,)."""

    vectors: Array
    actions: Indices


def improve(
    model: DenseModel, plans: Plans, beliefs: Array, *, gain: float, deadline: float
) -> tuple[Plans, Plans | None]:
    """Improve plans at some beliefs.

    Every round computes the best plans by one step of look-ahead at each belief, and their values if they
    follow each other forever. The value at a belief never falls, and every vector is the value of a plan.
    Plans that follow each other are closed: the policy that takes the action of the best of them at every
    belief earns what it promises. Others may promise the value of successors that have been replaced.

    Args:
        beliefs: (n, S).
        gain: stop when a round gains no more than this at any belief.
        deadline: on the monotonic clock.

    Returns:
        The best plans, at most one for each belief, and the last closed plans, or None if there were too
        many to solve for.
    """
    closed = None
    while True:
        values = beliefs @ plans.vectors.T
        best = values.argmax(axis=1)
        before = values[np.arange(len(best)), best]
        used, first = np.unique(best, return_index=True)
        plans = Plans(plans.vectors[used], plans.actions[used])
        if monotonic() >= deadline:
            return plans, closed
        ahead = model.look_ahead(plans.vectors, beliefs)
        pool = [plans, Plans(model.backproject(ahead, plans.vectors), ahead.actions)]
        if len(used) * model.states <= MAX_UNKNOWNS:
            own = Controller(ahead.actions[first], ahead.links[first])
            closed = Plans(model.evaluate(own), own.actions)
            pool.append(closed)
        more = Plans(np.concatenate([each[0] for each in pool]), np.concatenate([each[1] for each in pool]))
        if float(((beliefs @ more.vectors.T).max(axis=1) - before).max()) <= gain:
            return plans, closed
        plans = more
