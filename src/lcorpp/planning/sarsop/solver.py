"""SARSOP: point-based value iteration on the beliefs that optimal policies reach.

Source: Kurniawati, Hsu and Lee, "SARSOP: Efficient point-based POMDP planning by approximating optimally
reachable belief spaces", RSS 2008, Algorithm 1.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import monotonic

import numpy.typing as npt

from lcorpp.errors import PolicyError
from lcorpp.planning.any_discount import accept_undiscounted
from lcorpp.planning.arguments import (
    MEMORY_LIMIT,
    check_beliefs,
    check_memory_limit,
    check_solver_arguments,
    check_type,
)
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.bounded_search import BoundedSearch, SampleFunction
from lcorpp.planning.sarsop.bounded_tree import BoundedTree
from lcorpp.planning.sarsop.mixtures import MixtureStarts
from lcorpp.planning.sarsop.trials import Trials
from lcorpp.planning.solution import CONVERGED, Progress, Solution

MIXTURE_WORK = 2.5e5
"""Work for mixtures for each second of the time limit, in the unit of `BoundedSearch`: about a hundredth of a
second. Unlike a time, it gives the same policy each time."""

INITIAL_SHARE = 0.1
"""Share of the time limit for each of the initial bounds."""

COMPRESSION_SHARE = 0.05
"""Share of the time of the search that the last compression may take beyond the time limit."""


@accept_undiscounted
def solve(
    pomdp: Pomdp,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 5e-4,
    time_limit: float = 60.0,
    memory_limit: float = MEMORY_LIMIT,
    callback: Callable[[Progress], None] | None = None,
    previous: Solution | None = None,
    mixed: npt.ArrayLike | None = None,
    sample: SampleFunction | None = None,
) -> Solution:
    """Find a policy and bounds on the optimal value with SARSOP.

    At the time limit or after Ctrl-C, the result is the best policy so far.

    Args:
        pomdp: the problem.
        start: (S,) belief for which the policy is optimised, or (N, S) several; the model's own when None.
        precision: stop when upper - lower is at most this, in reward units, at every start belief.
        time_limit: wall-clock seconds.
        memory_limit: maximal size of problem, search and policy, in bytes. At the limit the search removes
            nodes and older points and continues; it ends if vectors and points alone are too large.
        callback: called after each sampled path of beliefs.
        previous: a solution of the same model for other starts. Its vectors and points are valid for all
            beliefs, so the search continues from them and stops at once if its gap is small enough.
        mixed: (V, S) linearly independent beliefs, V from 2 to `MAX_MIXED`. The search goes on until the
            precision is reached at all their mixtures, too, i.e. wherever a prior is a mixture of them; or
            until its work is as much as belongs to the time limit, see `MIXTURE_WORK`.
        sample: samples each path instead of `lcorpp.planning._native.Tree.sample`, and takes the tree and
            the arguments of that method.

    Returns:
        The policy, both bounds, the seconds used and why the search stopped.

    Raises:
        ModelError: `start` or `mixed` is not a distribution over the states, `mixed` are too many or
            dependent, or precision or limit are not positive.
        PolicyError: `previous` is for another model.

    Source: Kurniawati, Hsu and Lee, RSS 2008, Algorithm 1.

    Examples:
        >>> from lcorpp import load_domain, solve
        >>> solution = solve(load_domain("intention").pomdp)
        >>> solution.reason, round(solution.lower, 1), round(solution.upper, 1)
        ('precision reached', 66.5, 66.5)
    """
    starts = check_solver_arguments(pomdp, start, precision, time_limit, callback)
    check_memory_limit(memory_limit)
    if previous is not None:
        check_type("previous", previous, Solution)
        if previous.policy.fingerprint != pomdp.fingerprint:
            raise PolicyError("the previous solution is for another model")
    mixed = None if mixed is None else check_beliefs(pomdp, mixed, "mixed")
    began = monotonic()
    bounds = BoundedTree(
        pomdp,
        [*starts, *([] if mixed is None else [mixed.mean(axis=0)])],
        precision=precision,
        seconds=INITIAL_SHARE * time_limit,
        previous=previous.policy if previous else None,
    )
    search = BoundedSearch(bounds, starts, precision=precision, began=began, time_limit=time_limit)
    trials = Trials(search, memory_limit=memory_limit, seconds=time_limit, function=sample)

    def step() -> str | None:
        trials.sample()
        if mixed is None:  # the compressed vectors are as good at the starts, not at their mixtures
            search.compress(memory_limit)
        return "memory limit" if search.limit_memory(memory_limit) else None

    def run() -> str:
        return search.run(step, callback)

    reason = run()
    if mixed is None:
        try:
            if reason != "interrupted":
                seconds = max(search.seconds_left, COMPRESSION_SHARE * (monotonic() - began))
                search.compress_now(seconds, memory_limit)
        except KeyboardInterrupt:  # the vectors are as before
            reason = "interrupted"
        return search.make_solution(reason)
    mixtures = MixtureStarts(search, mixed)
    limit = search.work + MIXTURE_WORK * time_limit
    while reason == CONVERGED:
        reason = run()
        if reason == CONVERGED and (search.work > limit or not mixtures.add_wide()):
            break
    solution = search.make_solution(reason)
    return replace(solution, policy=mixtures.tighten(solution.policy))
