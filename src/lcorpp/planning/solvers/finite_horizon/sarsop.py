"""Finite-horizon solution from start beliefs: SARSOP on the time-expanded problem.

Source: Kurniawati, Hsu and Lee, RSS 2008; the time step is a fully observed part of the state (Ong, Png, Hsu
and Lee, Planning under uncertainty for robotic tasks with mixed observability, IJRR 2010).
"""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.planning.arguments import (
    MEMORY_LIMIT,
    check_count,
    check_discount,
    check_memory_limit,
    check_solver_arguments,
)
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop import solve
from lcorpp.planning.solution import Progress
from lcorpp.planning.solvers.finite_horizon.solution import FiniteHorizonSolution, make_finite_policy
from lcorpp.planning.solvers.finite_horizon.time_expanded import (
    TimeExpandedPomdp,
    TimeStepBound,
    time_expand,
)
from lcorpp.values import Array


def solve_finite_horizon(
    pomdp: Pomdp,
    horizon: int,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 1e-3,
    time_limit: float = 60.0,
    memory_limit: float = MEMORY_LIMIT,
    callback: Callable[[Progress], None] | None = None,
    discount: float | None = None,
) -> FiniteHorizonSolution:
    """Find the policies for a number of steps from a start belief.

    The bounds are those of SARSOP; at beliefs that optimal policies do not reach, only the upper bounds of
    the policies are known. `solve_finite_horizon_exact` is as good at all beliefs. At the time limit or after
    Ctrl-C, the result is the best so far.

    Args:
        pomdp: the problem.
        horizon: the number of steps, at least 1.
        start: (S,) belief before the first step, or (N, S) several; the model's own when None.
        precision: stop when upper - lower is at most this, in reward units, at every start belief.
        time_limit: wall-clock seconds.
        memory_limit: of the search, in bytes; see `lcorpp.planning.solve`.
        callback: called after each sampled path of beliefs.
        discount: from 0 to 1 (the undiscounted sum of rewards); the model's own when None.

    Returns:
        The policy for every number of remaining steps, both bounds, the seconds used and why the search
        stopped.

    Raises:
        ModelError: `start` is not a distribution over the states, a number is out of range, or the horizon is
            too long for memory.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import solve_finite_horizon
        >>> pomdp = load_domain("intention").pomdp
        >>> solution = solve_finite_horizon(pomdp, 3)
        >>> [pomdp.actions[solution.action(pomdp.start, remaining)] for remaining in (3, 2, 1)]
        ['move_forward', 'move_forward', 'report_interested']
    """
    starts = check_solver_arguments(pomdp, start, precision, time_limit, callback)
    check_memory_limit(memory_limit)
    horizon = check_count("horizon", horizon, 1)
    factor = check_discount(pomdp, discount)
    began = monotonic()
    expanded = time_expand(pomdp, horizon, factor)
    solution = solve(
        expanded.pomdp,
        [expanded.belief(belief, 0) for belief in starts],
        precision=precision,
        time_limit=max(time_limit - (monotonic() - began), 1e-3 * time_limit),
        memory_limit=memory_limit,
        callback=callback,
    )
    return FiniteHorizonSolution(
        policies=_split_policy(pomdp, expanded, solution.policy, factor),
        lower=solution.lower,
        upper=solution.upper,
        seconds=monotonic() - began,
        reason=solution.reason,
        history=solution.history,
        start_count=len(starts),
    )


def _split_policy(
    pomdp: Pomdp, expanded: TimeExpandedPomdp, policy: Policy, discount: float
) -> tuple[Policy, ...]:
    """Return the policy of each time, the last time first."""
    S, all_states = expanded.states, np.arange(expanded.states)
    blind, policies = np.zeros((len(pomdp.actions), S)), []
    sets = _split_by_time(expanded, policy)
    for time in reversed(range(expanded.horizon)):
        blind = pomdp.reward + discount * np.array(
            [pomdp.transition.backward(a, row) for a, row in enumerate(blind)]
        )
        weight = float(expanded.weights[time])
        own = [
            AlphaVectors(each.states - time * S, each.vectors / weight, each.actions) for each in sets[time]
        ]
        # blind policies provide an action at beliefs that the search did not visit
        full = [each for each in own if len(each.states) == S]
        vectors = np.concatenate([blind, *(each.vectors for each in full)])
        actions = np.concatenate([np.arange(len(blind)), *(each.actions for each in full)])
        partial = [each for each in own if len(each.states) < S]
        upper = TimeStepBound(expanded, time, policy.upper_bound) if policy.upper_bound is not None else None
        kept = [*partial, AlphaVectors(all_states, *_drop_dominated(vectors, actions))]
        policies.append(make_finite_policy(pomdp, kept, expanded.horizon - time, discount, upper))
    return tuple(policies)


def _split_by_time(expanded: TimeExpandedPomdp, policy: Policy) -> list[list[AlphaVectors]]:
    """Return the alpha vectors of each time.

    Vectors over all times count for time 0, to which no transition leads.
    """
    S, by_time = expanded.states, [list[AlphaVectors]() for _ in range(expanded.horizon)]
    for each in policy.vector_sets:
        time = int(each.states[0]) // S
        inside = each.states < (time + 1) * S
        if time < expanded.horizon:
            by_time[time].append(AlphaVectors(each.states[inside], each.vectors[:, inside], each.actions))
    return by_time


def _drop_dominated(vectors: Array, actions: npt.NDArray[np.intp]) -> tuple[Array, npt.NDArray[np.intp]]:
    """Return the vectors that no later one equals or exceeds in every state."""
    kept = [k for k, vector in enumerate(vectors) if not (vectors[k + 1 :] >= vector).all(axis=1).any()]
    return vectors[kept], actions[kept]
