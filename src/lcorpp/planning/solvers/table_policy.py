"""Policies that act on too rosy a table of values, and what they are really worth.

Source: Hauskrecht, Value-function approximations for partially observable Markov decision processes, JAIR
2000, sections 4.2 and 4.4 (QMDP and the fast informed bound as bounds and as policies). What such a policy
earns at least is worked out as follows. Let Q be any table. At a belief b the policy takes the action a with
the most Q(a).b; a number c(s) taken from every Q(a, s) changes nothing of that. So U(a, s) = Q(a, s) - c(s)
is the same policy, and max over a of U(a).b is no more than it earns if it is no more than one step earns
with U after it:

    U(a, s) <= R(a, s) + gamma sum over s', o of P(s', o | s, a) U(f(a, o), s')   for all a and s,

whatever next actions f(a, o) are put in, for the policy's own are worth at least as much in U. The least such
c is the value of a problem that can be seen and in which rho(a, s) is earned, what Q(a, s) promises beyond
one step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import monotonic

import numpy as np

from lcorpp.planning.evaluation.policy_evaluation import evaluate
from lcorpp.planning.evaluation.sparse_beliefs import ragged_indices
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernels import engine, model_of
from lcorpp.planning.solution import Progress, Solution
from lcorpp.values import Array, Belief

EVALUATED = 1000
"""Beliefs that are worked out in the first evaluation."""

MORE = 4
"""Every further evaluation works out so many times as many: they begin anew."""


@dataclass(frozen=True, eq=False)
class InformedBound:
    """The most that a table (A, S) above the truth promises: `lcorpp.planning.policy.UpperBound`."""

    table: Array

    def value(self, belief: Belief) -> float:
        """The bound at a belief (S,)."""
        return float((self.table @ belief).max())


class Search:
    """A policy by a table, while it is worked out what it earns.

    Args:
        table: (A, S) values above the truth.
        starts: (N, S). began, deadline: on the monotonic clock.
    """

    def __init__(
        self, pomdp: Pomdp, table: Array, starts: Array, *, precision: float, began: float, deadline: float
    ) -> None:
        self.pomdp, self.table, self.starts, self.precision = pomdp, table, starts, precision
        self.began, self.deadline = began, deadline
        self.above = InformedBound(table)
        # to begin with, no policy earns less than the least reward at every step
        floor = float(pomdp.reward.min()) / (1 - pomdp.discount)
        self.policy = self._policy(table - table.max(axis=0) + floor)
        self.lower = np.full(len(starts), floor)
        self.nodes = 0
        self.history: list[tuple[float, float, float, int]] = []
        self._note()

    def run(self, callback: Callable[[Progress], None] | None) -> str:
        """Work out what the policy earns, as well as the time allows; the reason to stop."""
        seconds = max(0.0, self.deadline - monotonic())
        self.policy = self._policy(promised(self.pomdp, self.table, 1e-3 * self.precision, seconds))
        self.lower = np.maximum(self.lower, [self.policy.value(start) for start in self.starts])
        most, rounds = EVALUATED, 0
        while True:
            _, low, high = self._note()
            if callback is not None:
                vectors = len(self.policy)
                callback(Progress(self.history[-1][0], low, high, vectors, self.nodes, rounds))
            began = monotonic()
            found = [
                evaluate(self.pomdp, self.policy, start, precision=self.precision, max_nodes=most, trials=0)
                for start in self.starts
            ]
            self.lower = np.maximum(self.lower, [each.lower for each in found])
            self.nodes, rounds, most = sum(each.nodes for each in found), rounds + 1, MORE * most
            _, low, high = self._note()
            if high - low <= self.precision:
                return "precision reached"
            if all(each.exact or each.closed for each in found):
                return "policy evaluated"
            # the next evaluation takes longer by as much as it works out more
            if monotonic() + MORE * (monotonic() - began) > self.deadline:
                return "time limit"

    def _policy(self, vectors: Array) -> Policy:
        piece = AlphaVectors(np.arange(vectors.shape[1]), vectors, np.arange(len(vectors)))
        return Policy.of_sets(self.pomdp, [piece], self.above)

    def _note(self) -> tuple[int, float, float]:
        """The start where the bounds are furthest apart, and the bounds there."""
        high = (self.starts @ self.table.T).max(axis=1)
        widest = int((high - self.lower).argmax())
        low, top = float(self.lower[widest]), max(float(high[widest]), float(self.lower[widest]))
        self.history.append((monotonic() - self.began, low, top, len(self.policy)))
        return widest, low, top

    def solution(self, reason: str) -> Solution:
        """What is known so far."""
        widest, low, high = self._note()
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


def promised(pomdp: Pomdp, table: Array, tolerance: float, seconds: float) -> Array:
    """(A, S) vectors of the policy that acts by a table, which promise no more than it earns anywhere.

    Args:
        table: (A, S) any values. tolerance: how far c may be above the least one.
        seconds: of wall-clock time.
    """
    beyond = np.array([table[a] - _one_step(pomdp, table, a) for a in range(len(table))])
    kernels = engine()
    taken = kernels.mdp_bound(model_of(kernels, replace(pomdp, reward=beyond)), tolerance, seconds)
    return np.asarray(table - taken.max(axis=0))


def _one_step(pomdp: Pomdp, table: Array, action: int) -> Array:
    """(S,) what an action earns and the table promises then, by the next actions that lose least at worst.

    A next action may depend on what is observed, but not on the state.
    """
    from scipy.sparse import csr_array

    T, Z = pomdp.transition, pomdp.observation
    S = T.shape[1]
    part = T.action_slice(action)
    row = action * S + T.columns[part].astype(np.int64)
    sizes = Z.begins[row + 1] - Z.begins[row]
    shown, step = ragged_indices(Z.begins[row], sizes), np.repeat(np.arange(part.start, part.stop), sizes)
    # a row for every observation and state before it that go together, in the order of the observations
    key = Z.columns[shown] * np.int64(S) + T.rows[step] - action * S
    found, place = np.unique(key, return_inverse=True)
    chances = csr_array((T.values[step] * Z.values[shown], (place, T.columns[step])), shape=(len(found), S))
    worth = np.asarray(chances @ table.T)
    observation, state = np.divmod(found, S)
    begins = np.searchsorted(observation, np.unique(observation))
    lost = np.maximum.reduceat(worth.max(axis=1, keepdims=True) - worth, begins, axis=0)
    following = np.repeat(lost.argmin(axis=1), np.diff(begins, append=len(found)))
    promise = np.bincount(state, worth[np.arange(len(found)), following], minlength=S)
    return np.asarray(pomdp.reward[action] + pomdp.discount * promise)
