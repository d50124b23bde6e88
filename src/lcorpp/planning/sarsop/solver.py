"""SARSOP: point-based value iteration on the beliefs that optimal policies reach.

Source: Kurniawati, Hsu and Lee, "SARSOP: Efficient point-based POMDP planning by approximating optimally
reachable belief spaces", RSS 2008, Algorithm 1.
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

import numpy.typing as npt

from lcorpp.errors import PolicyError
from lcorpp.planning.arguments import check_solver_arguments, check_type
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.bounded_search import BoundedSearch, BoundedTree, SampleFunction
from lcorpp.planning.sarsop.kernel_protocols import Kernels
from lcorpp.planning.solution import Progress, Solution

LOOK_AHEAD = 10
"""A path aims at the gap discounted by this many steps. Under a slow discount, a wider aim is reached only
far below the root, and the path gains little from all its steps."""

MAX_DEPTH = 1000
"""Largest number of nodes on a path. The bounds are valid for any value; later paths reach what one
misses."""

INITIAL_SHARE = 0.1
"""Share of the time limit for each of the initial bounds."""


def solve(
    pomdp: Pomdp,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 5e-4,
    time_limit: float = 60.0,
    callback: Callable[[Progress], None] | None = None,
    previous: Solution | None = None,
    sample: SampleFunction | None = None,
    kernels: Kernels | None = None,
) -> Solution:
    """Find a policy and bounds on the optimal value with SARSOP.

    At the time limit or after Ctrl-C, the result is the best policy so far.

    Args:
        pomdp: the problem.
        start: (S,) belief for which the policy is optimised, or (N, S) several; the model's own when None.
        precision: stop when upper - lower is at most this, in reward units, at every start belief.
        time_limit: wall-clock seconds.
        callback: called after each sampled path of beliefs.
        previous: a solution of the same model for other starts. Its vectors and points are valid for all
            beliefs, so the search continues from them and stops at once if its gap is small enough.
        sample: replaces `lcorpp.planning.sarsop.path_sampling.sample`.
        kernels: implementation of the kernels; the compiled ones, if installed, when None.

    Returns:
        The policy, both bounds, the seconds used and why the search stopped.

    Raises:
        ModelError: `start` is not a distribution over the states, or precision or limit are not positive.
        PolicyError: `previous` is for another model.

    Source: Kurniawati, Hsu and Lee, RSS 2008, Algorithm 1.
    """
    starts = check_solver_arguments(pomdp, start, precision, time_limit, callback)
    if previous is not None:
        check_type("previous", previous, Solution)
        if previous.policy.fingerprint != pomdp.fingerprint:
            raise PolicyError("the previous solution is for another model")
    began = monotonic()
    bounds = BoundedTree(
        pomdp,
        precision=precision,
        seconds=INITIAL_SHARE * time_limit,
        kernels=kernels,
        previous=previous.policy if previous else None,
    )
    search = BoundedSearch(bounds, starts, precision=precision, began=began, time_limit=time_limit)
    share = pomdp.discount**LOOK_AHEAD
    reason = search.run(lambda: search.sample(share, MAX_DEPTH, sample), callback)
    return search.make_solution(reason)
