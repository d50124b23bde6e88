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

from collections.abc import Callable, Sequence
from dataclasses import replace
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.planning.arguments import check_solver_arguments, check_starts
from lcorpp.planning.evaluation.policy_evaluation import evaluate
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernels import build_model, load_kernels
from lcorpp.planning.solution import BoundsRecord, Progress, Solution
from lcorpp.planning.sparse import ragged_indices
from lcorpp.planning.upper_bounds import PiecewiseLinearBound
from lcorpp.values import Array

INITIAL_NODES = 1000
"""Largest number of beliefs of the first evaluation."""

NODE_GROWTH = 4
"""Each further evaluation starts again with this many times the beliefs."""


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
    check_solver_arguments(pomdp, precision, time_limit, callback)
    began, starts = monotonic(), check_starts(pomdp, start)
    kernels = load_kernels()
    table = kernels.mdp_bound(build_model(kernels, pomdp), 1e-3 * precision, time_limit)
    return _solve_table(pomdp, table, starts, precision, began, began + time_limit, callback)


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
    check_solver_arguments(pomdp, precision, time_limit, callback)
    began, starts = monotonic(), check_starts(pomdp, start)
    kernels = load_kernels()
    model = build_model(kernels, pomdp)
    mdp = kernels.mdp_bound(model, 1e-3 * precision, time_limit / 4)
    table = kernels.fast_informed_bound(model, mdp, 1e-2 * precision, time_limit / 4)
    return _solve_table(pomdp, table, starts, precision, began, began + time_limit, callback)


def _solve_table(
    pomdp: Pomdp,
    table: Array,
    starts: Array,
    precision: float,
    began: float,
    deadline: float,
    callback: Callable[[Progress], None] | None,
) -> Solution:
    """Solve with the policy of a table (A, S) of upper bounds."""
    evaluation = _TablePolicyEvaluation(pomdp, table, BoundsRecord(pomdp, starts, began), precision)
    try:
        reason = evaluation.run(deadline, callback)
    except KeyboardInterrupt:
        reason = "interrupted"
    return evaluation.record.make_solution(evaluation.policy, reason, beliefs=evaluation.beliefs, trials=0)


class _TablePolicyEvaluation:
    """The policy of a table and bounds so far: `record` at the starts, `policy` at every belief."""

    def __init__(self, pomdp: Pomdp, table: Array, record: BoundsRecord, precision: float) -> None:
        self.pomdp, self.table, self.record, self.precision = pomdp, table, record, precision
        # no policy earns less than the smallest reward in every step: no vector may exceed it
        floor = float(pomdp.reward.min()) / (1 - pomdp.discount)
        self.policy = self._make_policy(table - table.max(axis=0) + floor)
        self.lower = np.full(len(record.starts), floor)
        self.upper = (record.starts @ table.T).max(axis=1)
        self.beliefs = 0
        self._raise_lower(self.lower)

    def run(self, deadline: float, callback: Callable[[Progress], None] | None) -> str:
        """Evaluate the policy at more and more beliefs; return the reason to stop."""
        seconds = max(0.0, deadline - monotonic())
        vectors = policy_lower_bound(self.pomdp, self.table, 1e-3 * self.precision, seconds)
        self.policy = self._make_policy(vectors)
        self._raise_lower([self.policy.value(start) for start in self.record.starts])
        max_nodes, rounds = INITIAL_NODES, 0
        while True:
            if callback is not None:
                count = len(self.policy)
                callback(self.record.make_progress(vectors=count, beliefs=self.beliefs, trials=rounds))
            began = monotonic()
            evaluations = [
                evaluate(
                    self.pomdp, self.policy, start, precision=self.precision, max_nodes=max_nodes, trials=0
                )
                for start in self.record.starts
            ]
            self.beliefs = sum(each.beliefs for each in evaluations)
            self._raise_lower([each.lower for each in evaluations])
            rounds, max_nodes = rounds + 1, NODE_GROWTH * max_nodes
            if self.record.upper - self.record.lower <= self.precision:
                return "precision reached"
            if all(each.exact or each.complete for each in evaluations):
                return "policy evaluated"
            # the next evaluation takes about NODE_GROWTH times as long
            if monotonic() + NODE_GROWTH * (monotonic() - began) > deadline:
                return "time limit"

    def _raise_lower(self, bounds: Sequence[float] | Array) -> None:
        """Raise the lower bounds at the starts to `bounds` (N,) if these are larger."""
        self.lower = np.maximum(self.lower, bounds)
        self.record.update(self.lower, self.upper, len(self.policy))

    def _make_policy(self, vectors: Array) -> Policy:
        actions, states = vectors.shape
        alphas = AlphaVectors(np.arange(states), vectors, np.arange(actions))
        return Policy.of_sets(self.pomdp, [alphas], PiecewiseLinearBound(self.table))


def policy_lower_bound(pomdp: Pomdp, table: Array, tolerance: float, seconds: float) -> Array:
    """Compute vectors U (A, S) of the policy of a table that are a lower bound on its value at every belief.

    Args:
        table: (A, S) any values.
        tolerance: how far c may exceed the smallest one, in reward units.
        seconds: of wall-clock time.
    """
    excess = np.array([table[a] - _look_ahead(pomdp, table, a) for a in range(len(table))])
    kernels = load_kernels()
    bound = kernels.mdp_bound(build_model(kernels, replace(pomdp, reward=excess)), tolerance, seconds)
    return np.asarray(table - bound.max(axis=0))


def _look_ahead(pomdp: Pomdp, table: Array, action: int) -> Array:
    """Return (S,) the reward of an action and the table's value after it, by the minimax-regret next actions.

    A next action may depend on the observation, but not on the state.
    """
    from scipy.sparse import csr_array

    T, Z = pomdp.transition, pomdp.observation
    S = T.shape[1]
    part = T.action_slice(action)
    row = action * S + T.columns[part].astype(np.int64)
    sizes = Z.begins[row + 1] - Z.begins[row]
    # one entry for each triple (s, s', o): its entries in the tables of transitions and observations
    t_entry = np.repeat(np.arange(part.start, part.stop), sizes)
    z_entry = ragged_indices(Z.begins[row], sizes)
    # one row for each possible pair (o, s), by observation
    keys = Z.columns[z_entry] * np.int64(S) + T.rows[t_entry] - action * S
    pairs, pair = np.unique(keys, return_inverse=True)
    joint = csr_array((T.values[t_entry] * Z.values[z_entry], (pair, T.columns[t_entry])), (len(pairs), S))
    values = np.asarray(joint @ table.T)  # (pairs, A): of the table after o from s, by the next action
    observation, state = np.divmod(pairs, S)
    begins = np.unique(observation, return_index=True)[1]
    regret = np.maximum.reduceat(values.max(axis=1, keepdims=True) - values, begins, axis=0)
    next_action = np.repeat(regret.argmin(axis=1), np.diff(begins, append=len(pairs)))
    expected = np.bincount(state, values[np.arange(len(pairs)), next_action], minlength=S)
    return np.asarray(pomdp.reward[action] + pomdp.discount * expected)
