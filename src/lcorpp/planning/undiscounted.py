"""Discount 1: a problem in which every policy ends is a discounted problem with the same policies.

A state has ended if no action earns anything there or leaves the states that have ended. Every policy ends if
it reaches them with probability 1 from every state, whatever it knows. Then there are weights w >= 1 with

    w(s) >= 1 + max over a of the sum over s' that have not ended of T(s' | s, a) w(s'),

such as the largest expected number of steps to the end. The problem with

    gamma = 1 - 1 / max w,  T'(s' | s, a) = T(s' | s, a) w(s') / (gamma w(s)),  R'(s, a) = R(s, a) / w(s),

in which the rest of each row ends and the end is observed, has the alpha vectors alpha(s) / w(s), as one step
shows. So V(b) = (b.w) V'(b'), with b'(s) = b(s) w(s) / (b.w).

Source: Bertsekas and Tsitsiklis, "An analysis of stochastic shortest path problems", Mathematics of
Operations Research, 1991, whose weighted maximum norm this is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, e, log
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ModelError
from lcorpp.planning.policy import AlphaVectors, Policy, UpperBound
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solution import Solution
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array, Belief

MAX_STEPS = 1e5
"""Maximal expected number of steps; the discount of the other problem is 1 minus its inverse."""

MAX_SWEEPS = 10**6
"""Maximal number of sweeps of the value iteration for the weights."""

_Flags = npt.NDArray[np.bool_]
_Solver = TypeVar("_Solver", bound=Callable[..., Solution])


@dataclass(frozen=True, eq=False)
class WeightedBound:
    """The upper bound (b.w) bound(b') of a problem with discount 1; see the module."""

    bound: UpperBound
    weights: Array

    def value(self, belief: Belief) -> float:
        """Return the bound at a belief (S,)."""
        weighted = np.asarray(belief) * self.weights
        scale = float(weighted.sum())
        return scale * self.bound.value(weighted / scale)


@dataclass(frozen=True, eq=False)
class DiscountedForm:
    """A problem with discount 1 and its discounted form.

    original, pomdp: the two problems. weights: (S,) w. ended: (S,) whether a state has ended.
    """

    original: Pomdp
    pomdp: Pomdp
    weights: Array
    ended: _Flags

    @classmethod
    def of(cls, original: Pomdp) -> DiscountedForm:
        """Return the discounted form of a problem with discount 1.

        Raises:
            ModelError: some policy may never end, or takes more than `MAX_STEPS` steps on average.
        """
        ended = find_ended(original)
        endless = find_endless(original, ended)
        if endless.any():
            state = original.states[int(endless.argmax())]
            raise ModelError(
                "discount 1 needs a model in which every policy ends, in states that no action leaves and"
                f" where nothing is earned; from {state!r} a policy may go on forever. Use a discount below"
                " 1, e.g. 0.999, or a finite horizon (`lcorpp solve --horizon`)"
            )
        weights = _find_weights(original, ended)
        discount = 1 - 1 / max(2.0, float(weights.max()))
        alive = np.where(ended, 0.0, 1.0)
        T = original.transition
        factors = (weights * alive)[T.columns] / (discount * weights)[T.rows % len(weights)]
        transition = _end_with_the_rest(T, T.values * factors, ended)
        scaled = replace(
            original,
            observations=(*original.observations, _find_new_name("ended", original.observations)),
            transition=transition,
            observation=_show_the_end(original.observation, ended),
            reward=original.reward * alive / weights,
            discount=discount,
            start=original.start * weights / (original.start @ weights),
        )
        return cls(original, scaled, weights, ended)

    def scale(self, beliefs: Array) -> Array:
        """Return (N,) b.w of beliefs (N, S), by which values are multiplied."""
        return np.asarray(beliefs @ self.weights)

    def convert_beliefs(self, beliefs: Array) -> Array:
        """Return the beliefs (N, S) of the discounted form."""
        converted: Array = beliefs * self.weights / self.scale(beliefs)[:, None]
        return converted

    def restore_belief(self, belief: Belief) -> Belief:
        """Return the belief (S,) of the original problem."""
        weights = belief / self.weights
        restored: Belief = weights / weights.sum()
        return restored

    def convert_policy(self, policy: Policy) -> Policy:
        """Return a policy of the original problem as one of the discounted form."""
        upper = policy.upper_bound
        bound = upper.bound if isinstance(upper, WeightedBound) else None
        sets = [
            AlphaVectors(part.states, part.vectors / self.weights[part.states], part.actions)
            for part in policy.vector_sets
        ]
        return Policy.of_sets(self.pomdp, sets, bound)

    def restore_policy(self, policy: Policy) -> Policy:
        """Return a policy of the discounted form as one of the original problem.

        Its vectors are over the states that have ended, too, where every plan earns 0: beliefs of the
        original problem contain them unless an observation shows that they have not ended.
        """
        sets = []
        for part in policy.vector_sets:
            alive = ~self.ended[part.states]
            states = np.union1d(part.states[alive], np.flatnonzero(self.ended))
            vectors = np.zeros((len(part.actions), len(states)))
            vectors[:, ~self.ended[states]] = (part.vectors * self.weights[part.states])[:, alive]
            if alive.any():
                sets.append(AlphaVectors(states, vectors, part.actions))
        if not sets:
            ended = np.flatnonzero(self.ended)
            sets.append(AlphaVectors(ended, np.zeros((1, len(ended))), np.zeros(1, dtype=np.intp)))
        upper = policy.upper_bound
        bound = None if upper is None else WeightedBound(upper, self.weights)
        floor = min(0.0, policy.floor) * float(self.weights.max())
        return replace(
            policy,
            vector_sets=tuple(sets),
            fingerprint=self.original.fingerprint,
            floor=floor,
            upper_bound=bound,
        )

    def restore_solution(self, solution: Solution) -> Solution:
        """Return a solution of the discounted form as one of the original problem.

        With several starts, all bounds in its history have the factor of the start with the widest gap.
        """
        start = self.restore_belief(self.pomdp.start if solution.start is None else solution.start)
        scale = float(self.scale(start[None])[0])
        return replace(
            solution,
            pomdp=self.original,
            policy=self.restore_policy(solution.policy),
            lower=scale * solution.lower,
            upper=scale * solution.upper,
            history=tuple((t, scale * low, scale * high, n) for t, low, high, n in solution.history),
            start=start,
        )

    def find_max_steps(self, probability: float) -> int:
        """Return a number of steps that every policy exceeds with at most this probability.

        The probability that a policy has not ended after e max w steps is at most 1 / e, by Markov's
        inequality.
        """
        return ceil(log(1 / probability)) * ceil(e * float(self.weights.max()))


def find_ended(pomdp: Pomdp) -> _Flags:
    """Return (S,) which states have ended: nothing is earned there, and no action leaves them."""
    S = len(pomdp.states)
    ended: _Flags = (pomdp.reward == 0).all(axis=0)
    source, target = pomdp.transition.rows % S, pomdp.transition.columns
    while (leaving := ended[source] & ~ended[target]).any():
        ended[source[leaving]] = False
    return ended


def find_endless(pomdp: Pomdp, ended: _Flags) -> _Flags:
    """Return (S,) the states from which some policy surely never ends: some action stays within them."""
    A, S = pomdp.reward.shape
    rows, target = pomdp.transition.rows, pomdp.transition.columns
    order = np.argsort(target, kind="stable")
    begins = np.searchsorted(target[order], np.arange(S + 1))
    endless, staying = ~ended, np.ones(A * S, dtype=bool)  # staying: rows whose next states are all endless
    staying_actions = np.full(S, A)
    removed = np.flatnonzero(ended)
    while len(removed):
        entries = np.concatenate([order[begins[s] : begins[s + 1]] for s in removed.tolist()])
        leaving = np.unique(rows[entries])
        leaving = leaving[staying[leaving]]
        staying[leaving] = False
        np.subtract.at(staying_actions, leaving % S, 1)
        removed = np.flatnonzero(endless & (staying_actions == 0))
        endless[removed] = False
    return endless


def _find_weights(pomdp: Pomdp, ended: _Flags) -> Array:
    """Return (S,) weights: about the largest expected number of steps to the end.

    If a sweep raises no weight by more than d < 1, the weights divided by 1 - d satisfy the inequality.
    """
    from scipy.sparse import csr_array  # it takes memory and time to import

    A, S = pomdp.reward.shape
    T = pomdp.transition
    matrix = csr_array((T.values, T.columns, T.begins), shape=(A * S, S))
    weights = np.where(ended, 0.0, 1.0)
    for _ in range(MAX_SWEEPS):
        raised = 1 + (matrix @ weights).reshape(A, S).max(axis=0)
        raised[ended] = 0
        change = float((raised - weights).max())
        weights = raised
        if change <= 1e-3:
            return np.where(ended, 1.0, weights / (1 - change - 1e-9))
        if weights.max() > MAX_STEPS:
            break
    state = pomdp.states[int(weights.argmax())]
    raise ModelError(
        f"with discount 1, a policy may take more than {weights.max():.6g} steps on average from {state!r} to"
        " the end; use a discount below 1"
    )


def _end_with_the_rest(table: SparseTables, values: Array, ended: _Flags) -> SparseTables:
    """Return T' where the rest of each row goes to the first state that has ended."""
    A, S, _ = table.shape
    rest = 1 - np.bincount(table.rows, values, A * S)
    end = np.full(A * S, int(ended.argmax()))
    rows, columns = np.concatenate([table.rows, np.arange(A * S)]), np.concatenate([table.columns, end])
    values = np.concatenate([values, rest])
    kept = values > 0
    return SparseTables.of_entries(table.shape, rows[kept], columns[kept], values[kept])


def _show_the_end(table: SparseTables, ended: _Flags) -> SparseTables:
    """Return O with one more observation, in the states that have ended.

    It changes no value, because nothing is earned there, and it merges beliefs that differ in their weight.
    """
    A, S, O = table.shape  # noqa: E741
    last = np.flatnonzero(np.tile(ended, A))
    kept = ~ended[table.rows % S]
    rows = np.concatenate([table.rows[kept], last])
    columns = np.concatenate([table.columns[kept], np.full(len(last), O)])
    values = np.concatenate([table.values[kept], np.ones(len(last))])
    return SparseTables.of_entries((A, S, O + 1), rows, columns, values)


def _find_new_name(name: str, names: tuple[str, ...]) -> str:
    while name in names:
        name += "'"
    return name
