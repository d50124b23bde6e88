"""QMDP: act as if all uncertainty were gone after the next step.

Source: Littman, Cassandra and Kaelbling, Learning policies for partially observable environments, ICML 1995.
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


def solve_qmdp(
    pomdp: Pomdp,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 1e-3,
    time_limit: float = 60.0,
    callback: Callable[[Progress], None] | None = None,
) -> Solution:
    """Find the QMDP policy, what it earns, and the bound above all policies that its table is.

    The table Q(a, s) is the value of doing a in s when the state can be seen from then on. The policy takes
    the action with the most Q(a).b; it never does anything for the sake of information. Q itself promises
    more than any policy earns. So the vectors of the policy that is returned are Q(a) less a vector common to
    all actions, by which it takes the same actions and promises no more than it earns, at any belief: its
    value and `gap` are certificates like those of other solvers, though wide ones. `Solution.lower` is
    closer: the beliefs that the policy meets from the start are worked out one by one. `Solution.upper` is Q
    at the start.

    Args:
        pomdp: the problem.
        start: (S,) belief at which the bounds are reported, or (N, S) several; the model's own when None.
        precision: how closely the table and what the policy earns are worked out, in reward units. The gap
            between `lower` and `upper` is what it is.
        time_limit: wall-clock seconds.
        callback: called after each evaluation of the policy, the last one aside.

    Returns:
        The policy of A vectors and both bounds; `beliefs` counts those that were worked out.

    Raises:
        ModelError: `start` is not a distribution over the states, or precision or limit are not positive.

    Source: Littman, Cassandra and Kaelbling, ICML 1995; `lcorpp.planning.solvers.table_policy` for the bound.
    """
    checked_limits(precision, time_limit)
    began, starts = monotonic(), checked_starts(pomdp, start)
    kernels = engine()
    table = kernels.mdp_bound(model_of(kernels, pomdp), 1e-3 * precision, time_limit)
    search = Search(pomdp, table, starts, precision=precision, began=began, deadline=began + time_limit)
    try:
        reason = search.run(callback)
    except KeyboardInterrupt:
        reason = "interrupted"
    return search.solution(reason)
