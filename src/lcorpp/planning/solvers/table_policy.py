"""Policies from optimistic Q tables (QMDP, FIB) and lower bounds on their value.

Sources: Littman, Cassandra and Kaelbling, Learning policies for partially observable environments, ICML 1995
(QMDP); Hauskrecht, Value-function approximations for partially observable Markov decision processes, JAIR
2000, sections 4.2 and 4.4 (QMDP and the fast informed bound as bounds and as policies).

A lower bound on the value of such a policy follows from the table. Let Q be any table. At a belief b the
policy takes the action a with the largest Q(a).b; subtracting a number c(s) from every Q(a, s) does not
change the policy. So U(a, s) = Q(a, s) - c(s) describes the same policy, and max over a of U(a).b is at most
the policy's value if it is at most the reward of one step followed by U:

    U(a, s) <= R(a, s) + gamma sum over s', o of P(s', o | s, a) U(f(a, o), s')   for all a and s,

for any next actions f(a, o), because the policy's own are at least as good in U. The smallest such c is the
value of a fully observable problem with the reward by which Q(a, s) exceeds one step. f(a, o) is the action
with the smallest maximal regret over the states: it keeps this excess, and hence c, small.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.planning._native import fast_informed_bound, mdp_bound
from lcorpp.planning.any_discount import accept_undiscounted
from lcorpp.planning.arguments import check_solver_arguments
from lcorpp.planning.evaluation.policy_evaluation import Evaluation, evaluate
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernel_model import build_model
from lcorpp.planning.solution import BoundsRecord, Progress, Solution
from lcorpp.planning.sparse import joint_matrix
from lcorpp.planning.upper_bounds import PiecewiseLinearBound
from lcorpp.values import Array

INITIAL_NODES = 1000
"""Largest number of beliefs of the first evaluation."""

NODE_GROWTH = 4
"""Each further evaluation starts again with this many times the beliefs."""


@accept_undiscounted
def solve_qmdp(
    pomdp: Pomdp,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 1e-3,
    time_limit: float = 60.0,
    callback: Callable[[Progress], None] | None = None,
) -> Solution:
    """Find the QMDP policy, a lower bound on its value, and the upper bound of its table.

    The table Q(a, s) is the value of a in s if the state is observed from the next step on. The policy takes
    the action with the largest Q(a).b; it never acts to gain information. Q itself exceeds the value of every
    policy. The vectors of the returned policy are Q(a) less a vector common to all actions: the policy is the
    same, and its vectors are a lower bound on its value at every belief, so that its value and `gap` are
    proven as those of other solvers, though wide. `Solution.lower` is closer: it evaluates the
    beliefs that the policy reaches from the start. `Solution.upper` is Q at the start.

    Args:
        pomdp: the problem.
        start: (S,) belief of the reported bounds, or (N, S) several; the model's own when None.
        precision: of the table and of the evaluation, in reward units. It does not bound the gap between
            `lower` and `upper`.
        time_limit: wall-clock seconds.
        callback: called before each evaluation of the policy; `trials` counts the evaluations.

    Returns:
        The policy of A vectors and both bounds; `beliefs` counts the evaluated beliefs.

    Raises:
        ModelError: `start` is not a distribution over the states, or precision or limit are not positive.

    Source: Littman, Cassandra and Kaelbling, ICML 1995; the module docstring for the lower bound.
    """
    starts = check_solver_arguments(pomdp, start, precision, time_limit, callback)
    began = monotonic()
    table = mdp_bound(build_model(pomdp), 1e-3 * precision, time_limit)
    return _solve_table(pomdp, table, starts, precision, began, began + time_limit, callback)


@accept_undiscounted
def solve_fib(
    pomdp: Pomdp,
    start: npt.ArrayLike | None = None,
    *,
    precision: float = 1e-3,
    time_limit: float = 60.0,
    callback: Callable[[Progress], None] | None = None,
) -> Solution:
    """Find the policy of the fast informed bound, a lower bound on its value, and the bound itself.

    The table is the fixed point of Q(a, s) = R(a, s) + gamma sum over o of max over a' of sum over s' of
    P(s', o | s, a) Q(a', s'), which is at most that of QMDP. Half of the time limit is for the table.
    Arguments, result and errors are those of `solve_qmdp`.

    Source: Hauskrecht, JAIR 2000, section 4.4; the module docstring for the lower bound.
    """
    starts = check_solver_arguments(pomdp, start, precision, time_limit, callback)
    began = monotonic()
    table = compute_informed_bound(pomdp, precision, time_limit / 4)
    return _solve_table(pomdp, table, starts, precision, began, began + time_limit, callback)


def compute_informed_bound(pomdp: Pomdp, precision: float, seconds: float) -> Array:
    """Compute the fast informed bound, a table (A, S): no policy earns more from b than max over a of Q(a).b.

    Args:
        precision: in reward units, of a search that uses the table, which is a hundred times as precise.
        seconds: time limit of each of the two steps.

    Source: Hauskrecht, JAIR 2000, section 4.4.
    """
    model = build_model(pomdp)
    mdp = mdp_bound(model, 1e-3 * precision, seconds)
    return fast_informed_bound(model, mdp, 1e-2 * precision, seconds)


def _solve_table(
    pomdp: Pomdp,
    table: Array,
    starts: Array,
    precision: float,
    began: float,
    deadline: float,
    callback: Callable[[Progress], None] | None,
) -> Solution:
    """Evaluate the policy of a table (A, S) of upper bounds at more and more beliefs."""

    def make_policy(vectors: Array) -> Policy:
        alphas = AlphaVectors(np.arange(len(pomdp.states)), vectors, np.arange(len(vectors)))
        return Policy.of_sets(pomdp, [alphas], PiecewiseLinearBound(table))

    # no policy earns less than the smallest reward in every step: no vector may exceed it
    floor = float(pomdp.reward.min()) / (1 - pomdp.discount)
    policy = make_policy(table - table.max(axis=0) + floor)
    lower, upper = np.full(len(starts), floor), (starts @ table.T).max(axis=1)
    record, beliefs, rounds = BoundsRecord(pomdp, starts, began), 0, 0
    record.update(lower.tolist(), upper.tolist(), len(policy))
    try:
        seconds = max(0.0, deadline - monotonic())
        policy = make_policy(policy_lower_bound(pomdp, table, 1e-3 * precision, seconds))
        lower = np.maximum(lower, [policy.value(start) for start in starts])
        record.update(lower.tolist(), upper.tolist(), len(policy))
        while True:
            if callback is not None:
                callback(record.make_progress(vectors=len(policy), beliefs=beliefs, trials=rounds))
            round_began, max_nodes = monotonic(), INITIAL_NODES * NODE_GROWTH**rounds
            evaluations: list[Evaluation] = []
            for i, start in enumerate(starts):
                if evaluations and monotonic() > deadline:
                    break
                evaluations.append(
                    evaluate(pomdp, policy, start, precision=precision, max_nodes=max_nodes, trials=0)
                )
                lower[i] = max(lower[i], evaluations[i].lower)
            beliefs, rounds = sum(each.beliefs for each in evaluations), rounds + 1
            record.update(lower.tolist(), upper.tolist(), len(policy))
            if record.upper - record.lower <= precision:
                reason = "precision reached"
                break
            is_complete = len(evaluations) == len(starts)
            if is_complete and all(each.exact or each.complete for each in evaluations):
                reason = "policy evaluated"
                break
            # the next evaluation takes about NODE_GROWTH times as long
            if monotonic() + NODE_GROWTH * (monotonic() - round_began) > deadline:
                reason = "time limit"
                break
    except KeyboardInterrupt:
        reason = "interrupted"
    return record.make_solution(policy, reason, beliefs=beliefs, trials=0)


def policy_lower_bound(pomdp: Pomdp, table: Array, tolerance: float, seconds: float) -> Array:
    """Compute vectors U (A, S) of the policy of a table that are a lower bound on its value at every belief.

    Args:
        table: (A, S) any values.
        tolerance: how far c may exceed the smallest one, in reward units.
        seconds: of wall-clock time.
    """
    excess = np.array([table[a] - _look_ahead(pomdp, table, a) for a in range(len(table))])
    bound = mdp_bound(build_model(replace(pomdp, reward=excess)), tolerance, seconds)
    return np.asarray(table - bound.max(axis=0))


def _look_ahead(pomdp: Pomdp, table: Array, action: int) -> Array:
    """Return (S,) the reward of an action and the table's value after it, by the minimax-regret next actions.

    A next action may depend on the observation, but not on the state.
    """
    joint, observation, state = joint_matrix(pomdp.transition, pomdp.observation, action)
    values = np.asarray(joint @ table.T)  # (pairs, A): of the table after o from s, by the next action
    begins = np.unique(observation, return_index=True)[1]
    regret = np.maximum.reduceat(values.max(axis=1, keepdims=True) - values, begins, axis=0)
    next_action = np.repeat(regret.argmin(axis=1), np.diff(begins, append=len(values)))
    expected = np.bincount(state, values[np.arange(len(values)), next_action], minlength=len(table[0]))
    return np.asarray(pomdp.reward[action] + pomdp.discount * expected)
