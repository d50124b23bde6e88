"""The fast informed bound, as a policy: act as if all uncertainty were gone after the step after the next.

Source: Hauskrecht, JAIR 2000, section 4.4.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

import numpy.typing as npt

from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernels import engine, model_of
from lcorpp.planning.solution import Progress, Solution
from lcorpp.planning.solvers.arguments import checked_limits, checked_starts
from lcorpp.planning.solvers.table_policy import Search


def solve_fib(
    pomdp: Pomdp,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 1e-3,
    time_limit: float = 60.0,
    callback: Callable[[Progress], None] | None = None,
) -> Solution:
    """Find the policy of the fast informed bound, what it earns, and the bound itself.

    The table is the fixed point of Q(a, s) = R(a, s) + gamma sum over o of max over a' of sum over s' of
    P(s', o | s, a) Q(a', s'). It is nowhere above that of QMDP. For all else, see `solve_qmdp`: the vectors
    of the policy are the table less a vector common to all actions, so that they promise no more than is
    earned.

    Args:
        pomdp: the problem.
        start: (S,) belief at which the bounds are reported, or (N, S) several; the model's own when None.
        precision: how closely the table and what the policy earns are worked out, in reward units. The gap
            between `lower` and `upper` is what it is.
        time_limit: wall-clock seconds; half of them are for the table.
        callback: called after each evaluation of the policy, the last one aside.

    Returns:
        The policy of A vectors and both bounds; `beliefs` counts those that were worked out.

    Raises:
        ModelError: `start` is not a distribution over the states, or precision or limit are not positive.

    Source: Hauskrecht, JAIR 2000, section 4.4; `lcorpp.planning.solvers.table_policy` for the bound.
    """
    checked_limits(precision, time_limit)
    began, starts = monotonic(), checked_starts(pomdp, start)
    kernels = engine()
    model = model_of(kernels, pomdp)
    fully_seen = kernels.mdp_bound(model, 1e-3 * precision, time_limit / 4)
    table = kernels.fast_informed_bound(model, fully_seen, 1e-2 * precision, time_limit / 4)
    search = Search(pomdp, table, starts, precision=precision, began=began, deadline=began + time_limit)
    try:
        reason = search.run(callback)
    except KeyboardInterrupt:
        reason = "interrupted"
    return search.solution(reason)
