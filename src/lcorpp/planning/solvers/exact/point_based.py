"""Plans made better at some beliefs: what lies between two backups of all of them.

Sources: Zhang and Zhang, Speeding up the convergence of value iteration in POMDPs, JAIR 2001 (steps at the
witnesses between full steps); Ji, Parr, Li, Liao and Carin, Point-based policy iteration, AAAI 2007.
"""

from __future__ import annotations

from time import monotonic
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.planning.solvers.exact.dynamic_programming import Controller, Steps
from lcorpp.values import Array

MOST_UNKNOWNS = 4000
"""The most numbers of a controller that are solved for; a larger one is carried on step by step."""

Indices = npt.NDArray[np.intp]


class Plans(NamedTuple):
    """Values of plans.

    vectors: (K, S). actions: (K,) what each begins with.
    """

    vectors: Array
    actions: Indices


def improved(
    steps: Steps, plans: Plans, beliefs: Array, *, gain: float, deadline: float
) -> tuple[Plans, Plans | None]:
    """Plans that are worth more at some beliefs: those best there, and the last ones that are closed.

    Every round looks one step ahead at each belief, and works out what the plans found there are worth when
    they follow each other for ever. No belief's value falls, and every vector is that of a plan. Plans that
    follow each other are closed: who takes the action of the best of them at every belief earns what it
    promises. The others may promise what their successors, since replaced, would have earned.

    Args:
        beliefs: (n, S).
        gain: it ends when a round gains no more than this at any belief.
        deadline: on the monotonic clock.

    Returns:
        The plans, one for every belief at most, and closed ones, None where there were too many to solve for.
    """
    closed = None
    while True:
        values = beliefs @ plans.vectors.T
        best = values.argmax(axis=1)
        held = values[np.arange(len(best)), best]
        used, first = np.unique(best, return_index=True)
        plans = Plans(plans.vectors[used], plans.actions[used])
        if monotonic() >= deadline:
            return plans, closed
        ahead = steps.look_ahead(plans.vectors, beliefs)
        pool = [plans, Plans(steps.carried(ahead, plans.vectors), ahead.actions)]
        if len(used) * steps.states <= MOST_UNKNOWNS:
            own = Controller(ahead.actions[first], ahead.links[first])
            closed = Plans(steps.value(own), own.actions)
            pool.append(closed)
        more = Plans(np.concatenate([each[0] for each in pool]), np.concatenate([each[1] for each in pool]))
        if float(((beliefs @ more.vectors.T).max(axis=1) - held).max()) <= gain:
            return plans, closed
        plans = more
