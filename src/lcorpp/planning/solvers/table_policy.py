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
value of a fully observable problem with the reward rho(a, s) by which Q(a, s) exceeds one step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import monotonic

import numpy as np
import numpy.typing as npt

from lcorpp.planning.arguments import check_limits, check_starts
from lcorpp.planning.evaluation.policy_evaluation import evaluate
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernels import build_model, load_kernels
from lcorpp.planning.solution import Progress, Solution
from lcorpp.planning.sparse import ragged_indices
from lcorpp.values import Array, Belief

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
    certificates as those of other solvers, though wide ones. `Solution.lower` is closer: it evaluates the
    beliefs that the policy reaches from the start. `Solution.upper` is Q at the start.

    Args:
        pomdp: the problem.
        start: (S,) belief of the reported bounds, or (N, S) several; the model's own when None.
        precision: of the table and of the evaluation, in reward units. It does not bound the gap between
            `lower` and `upper`.
        time_limit: wall-clock seconds.
        callback: called before each evaluation of the policy.

    Returns:
        The policy of A vectors and both bounds; `beliefs` counts the evaluated beliefs.

    Raises:
        ModelError: `start` is not a distribution over the states, or precision or limit are not positive.

    Source: Littman, Cassandra and Kaelbling, ICML 1995; the module docstring for the lower bound.
    """
    check_limits(precision, time_limit)
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
    check_limits(precision, time_limit)
    began, starts = monotonic(), check_starts(pomdp, start)
    kernels = load_kernels()
    model = build_model(kernels, pomdp)
    mdp = kernels.mdp_bound(model, 1e-3 * precision, time_limit / 4)
    table = kernels.fast_informed_bound(model, mdp, 1e-2 * precision, time_limit / 4)
    return _solve_table(pomdp, table, starts, precision, began, began + time_limit, callback)


@dataclass(frozen=True, eq=False, repr=False)
class QTableBound:
    """The upper bound max over a of Q(a).b of a table (A, S): `lcorpp.planning.policy.UpperBound`."""

    table: Array

    def __repr__(self) -> str:
        return f"<QTableBound: {self.table.shape[0]} actions, {self.table.shape[1]} states>"

    def value(self, belief: Belief) -> float:
        """Return the bound at a belief (S,)."""
        return float((self.table @ belief).max())


def _solve_table(
    pomdp: Pomdp,
    table: Array,
    starts: Array,
    precision: float,
    began: float,
    deadline: float,
    callback: Callable[[Progress], None] | None,
) -> Solution:
    search = _Evaluation(pomdp, table, starts, precision=precision, began=began, deadline=deadline)
    try:
        reason = search.run(callback)
    except KeyboardInterrupt:
        reason = "interrupted"
    return search.make_solution(reason)


class _Evaluation:
    """The policy of a table and the best lower bounds on its value so far.

    Args:
        table: (A, S) Q values that are upper bounds.
        starts: (N, S). began, deadline: on the monotonic clock.
    """

    def __init__(
        self, pomdp: Pomdp, table: Array, starts: Array, *, precision: float, began: float, deadline: float
    ) -> None:
        self.pomdp, self.table, self.starts, self.precision = pomdp, table, starts, precision
        self.began, self.deadline = began, deadline
        # no policy earns less than the smallest reward in every step
        floor = float(pomdp.reward.min()) / (1 - pomdp.discount)
        self.policy = self._make_policy(table - table.max(axis=0) + floor)
        self.lower = np.full(len(starts), floor)
        self.nodes = 0
        self.history: list[tuple[float, float, float, int]] = []
        self._record_bounds()

    def run(self, callback: Callable[[Progress], None] | None) -> str:
        """Evaluate the policy at more and more beliefs; the reason to stop."""
        seconds = max(0.0, self.deadline - monotonic())
        vectors = policy_lower_bound(self.pomdp, self.table, 1e-3 * self.precision, seconds)
        self.policy = self._make_policy(vectors)
        self.lower = np.maximum(self.lower, [self.policy.value(start) for start in self.starts])
        max_nodes, rounds = INITIAL_NODES, 0
        while True:
            _, low, high = self._record_bounds()
            if callback is not None:
                callback(Progress(self.history[-1][0], low, high, len(self.policy), self.nodes, rounds))
            began = monotonic()
            evaluations = [
                evaluate(
                    self.pomdp, self.policy, start, precision=self.precision, max_nodes=max_nodes, trials=0
                )
                for start in self.starts
            ]
            self.lower = np.maximum(self.lower, [each.lower for each in evaluations])
            self.nodes = sum(each.beliefs for each in evaluations)
            rounds, max_nodes = rounds + 1, NODE_GROWTH * max_nodes
            _, low, high = self._record_bounds()
            if high - low <= self.precision:
                return "precision reached"
            if all(each.exact or each.complete for each in evaluations):
                return "policy evaluated"
            # the next evaluation takes about NODE_GROWTH times as long
            if monotonic() + NODE_GROWTH * (monotonic() - began) > self.deadline:
                return "time limit"

    def make_solution(self, reason: str) -> Solution:
        """Return the result so far."""
        widest, low, high = self._record_bounds()
        return Solution(
            pomdp=self.pomdp,
            policy=self.policy,
            lower=low,
            upper=high,
            seconds=monotonic() - self.began,
            reason=reason,
            history=tuple(self.history[:-1]),
            beliefs=self.nodes,
            trials=0,
            start=self.starts[widest],
        )

    def _make_policy(self, vectors: Array) -> Policy:
        actions, states = vectors.shape
        alphas = AlphaVectors(np.arange(states), vectors, np.arange(actions))
        return Policy.of_sets(self.pomdp, [alphas], QTableBound(self.table))

    def _record_bounds(self) -> tuple[int, float, float]:
        """Return the start with the widest gap and its bounds; append the bounds to the history."""
        high = (self.starts @ self.table.T).max(axis=1)
        widest = int((high - self.lower).argmax())
        low, top = float(self.lower[widest]), max(float(high[widest]), float(self.lower[widest]))
        self.history.append((monotonic() - self.began, low, top, len(self.policy)))
        return widest, low, top


def policy_lower_bound(pomdp: Pomdp, table: Array, tolerance: float, seconds: float) -> Array:
    """Compute vectors (A, S) of the policy of a table that are a lower bound on its value at every belief.

    Args:
        table: (A, S) any values.
        tolerance: how far c may exceed the smallest one.
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
    seen, step = ragged_indices(Z.begins[row], sizes), np.repeat(np.arange(part.start, part.stop), sizes)
    # one row for each possible pair of observation and previous state, by observation
    key = Z.columns[seen] * np.int64(S) + T.rows[step] - action * S
    pairs, place = np.unique(key, return_inverse=True)
    joint = csr_array((T.values[step] * Z.values[seen], (place, T.columns[step])), shape=(len(pairs), S))
    values = np.asarray(joint @ table.T)
    observation, state = np.divmod(pairs, S)
    begins = np.searchsorted(observation, np.unique(observation))
    regret = np.maximum.reduceat(values.max(axis=1, keepdims=True) - values, begins, axis=0)
    next_action = np.repeat(regret.argmin(axis=1), np.diff(begins, append=len(pairs)))
    expected = np.bincount(state, values[np.arange(len(pairs)), next_action], minlength=S)
    return np.asarray(pomdp.reward[action] + pomdp.discount * expected)
