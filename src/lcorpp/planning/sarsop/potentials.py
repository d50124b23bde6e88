"""Potentials: upper bounds for hidden values that do not change, by what each question can reveal.

A function U of the belief bounds the optimal value if no action can raise it: U(b) >= R(b, a) + gamma
E[U(b')] at all beliefs and for all actions. Let U(b) = v.b - k H(b) - sum over pairs of states of w(s, t)
sqrt(b(s) b(t)), with the entropy H, k >= 0 and w >= 0. For questions, which leave the state as it is, the
right side minus the left is linear in (v, k, w) and concave in b. So a linear program over cutting planes
finds the lowest U at a belief, and the gradient at each action's maximum proves that U is a bound. H states
how fast all questions together reveal the value (mutual information). A pair states how fast those do that
distinguish two values: E[sqrt(b'(s) b'(t))] is sqrt(b(s) b(t)) times their Bhattacharyya coefficient.

Sources: Kelley, "The cutting-plane method for solving convex programs", 1960; for bounds of sequential tests
by information, Naghshvar and Javidi, "Active sequential hypothesis testing", Annals of Statistics 2013.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog

from lcorpp.planning._native import maximise_gain
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array, Belief, Indices

MAX_STATES = 200
"""Largest number of states among which a value is hidden; the program has a column for each pair."""

MAX_PAIRS = 800
"""Largest number of pairs; those that are hardest to distinguish are kept."""

TOLERANCE = 0.01
"""The search for a potential ends this close to the lowest one, as a share of the largest value."""

STEP = 0.5
"""Each trial is this share of the way from the last bound to the solution of the linear program."""

CHECK_COST = 0.2
"""Cost of the maxima of actions for each number that they read, in entries of a linear program."""

MAX_ROWS, KEPT_ROWS = 1000, 500
"""With more cutting planes than the first number, only the closest are kept."""


@dataclass(frozen=True, eq=False)
class Potential:
    """offset.b + scale N(b) - entropy H(b) - sum of weight sqrt(b(s) b(t)): an upper bound within blocks.

    offset: (S,). scale, power: of the norm N(b) = (sum of b(s)^power)^(1 / power). entropy: of H, in nats.
    pairs: (n, 2) states s and t. pair_weights: (n,).
    state: the bound holds at beliefs within the block of this state; -1: within any block.
    """

    offset: Array
    scale: float
    power: float
    entropy: float
    pairs: np.ndarray[tuple[int, ...], np.dtype[np.int32]]
    pair_weights: Array
    state: int = -1


@dataclass(frozen=True, eq=False)
class _Action:
    """An action at n states: its gain is reward.b - keep v.b + k drop(H) + sum of w drop(pair).

    reward: (n,). keep: 1 - gamma for a question. likelihood: (n, m) P(o | s); m = 0 for other actions.
    drops: (pairs,) share of each pair's sqrt(b(s) b(t)) that is expected to vanish, discounted.
    """

    reward: Array
    keep: float
    likelihood: Array
    drops: Array


class PairPotentials:
    """The potentials of the questions about some states.

    Args:
        pomdp: the problem. values: (S,) upper bounds on the values of known states, not below their backups.
        states: (n,) a block of states.
        symmetries: renamings of the states; a potential for a belief that they do not change is symmetric.
    """

    def __init__(
        self, pomdp: Pomdp, values: Array, states: Indices, symmetries: Sequence[Sequence[int]] = ()
    ) -> None:
        self._values, self._states, self._gamma = values, states, pomdp.discount
        n = len(states)
        first, second = np.triu_indices(n, 1)
        self.actions: list[_Action] = []
        for a in range(len(pomdp.actions)):
            next_states = pomdp.transition[a][states]
            if (next_states[:, states].diagonal() > 1 - 1e-12).all():
                Z = pomdp.observation[a][states]
                Z = np.ascontiguousarray(Z[:, Z.any(axis=0)])
                overlap = (np.sqrt(Z)[first] * np.sqrt(Z)[second]).sum(axis=1)
                keep, reward = 1 - self._gamma, pomdp.reward[a][states]
            else:  # the next state may be known
                Z, overlap, keep = np.empty((n, 0)), np.zeros(len(first)), 1.0
                reward = pomdp.reward[a][states] + self._gamma * (next_states @ values)
            self.actions.append(_Action(reward, keep, Z, 1 - self._gamma * overlap))
        self.has_questions = any(action.likelihood.shape[1] > 1 for action in self.actions)
        pairs = np.stack([first, second], axis=1).astype(np.int32)
        if self.has_questions and len(pairs) > MAX_PAIRS:
            hardest = np.max([action.drops for action in self.actions if action.likelihood.shape[1]], axis=0)
            kept = np.argsort(hardest, kind="stable")[:MAX_PAIRS]
            pairs = np.ascontiguousarray(pairs[kept])
            self.actions = [
                _Action(action.reward, action.keep, action.likelihood, action.drops[kept])
                for action in self.actions
            ]
        self.pairs = pairs
        self._orbits = self._find_orbits(symmetries)
        self._rows: list[Array] = []
        self._limits: list[float] = []
        # the condition where the state is known: no entropy and no pair counts there
        self._floor = np.max([action.reward / action.keep for action in self.actions], axis=0)
        sizes = [action.likelihood.size + len(self.pairs) + 20 * n for action in self.actions]
        self._check_cost = int(CHECK_COST * sum(sizes))
        self._maxima = [np.full(n, 1 / n) for _ in self.actions]

    def minimise(self, belief: Belief, max_entries: int) -> Potential:
        """Return a potential that is low at a belief (S,).

        Args:
            max_entries: limit of the work, in numbers of all linear programs together.
        """
        n, b = len(self._states), np.asarray(belief)[self._states]
        cost = np.concatenate([b, [-_entropy(b)], -self._pair_roots(b)])
        span = float(np.abs(self._values[self._states]).max()) + float(np.ptp(self._values))
        safe = np.concatenate([self._values[self._states], np.zeros(1 + len(self.pairs))])
        columns = self._orbits if self._is_symmetric(b) else np.arange(len(cost))
        total = _sum_columns(cost[None], columns)[0]
        for with_pairs in (False, True):  # few columns give a good start
            low = np.concatenate([self._floor, np.zeros(1 + len(self.pairs))])
            high = np.concatenate(
                [np.full(n, 50 * span), [10 * span], np.full(len(self.pairs), 10 * span * with_pairs)]
            )
            least, most = np.full(len(total), -np.inf), np.full(len(total), np.inf)
            np.maximum.at(least, columns, low)
            np.minimum.at(most, columns, high)
            limits = list(zip(least.tolist(), np.maximum(least, most).tolist(), strict=True))
            while max_entries > 0:
                planes = None
                if self._rows:
                    planes = _sum_columns(np.array(self._rows), columns)
                    max_entries -= planes.size if with_pairs else len(planes) * (n + 1)
                found = linprog(total, planes, self._limits or None, bounds=limits, method="highs")
                if found.x is None or cost @ safe - found.fun <= TOLERANCE * span:
                    break
                max_entries -= self._check_cost
                tried = safe + STEP * (found.x[columns] - safe)
                excess = self._check(tried, 0.1 * TOLERANCE * span)
                if excess <= 0.1 * TOLERANCE * span:
                    tried[:n] += max(0.0, excess)
                    safe = tried
                elif len(self._rows) > MAX_ROWS:
                    self._drop_planes(found.x[columns])
        offset, used = self._values.copy(), safe[n + 1 :] > 0
        offset[self._states] = safe[:n]
        pairs = np.ascontiguousarray(self._states[self.pairs[used]].astype(np.int32))
        weights = np.ascontiguousarray(safe[n + 1 :][used])
        return Potential(offset, 0.0, 2.0, float(safe[n]), pairs, weights, int(self._states[0]))

    def _pair_roots(self, b: Array) -> Array:
        roots = np.sqrt(b)
        return np.asarray(roots[self.pairs[:, 0]] * roots[self.pairs[:, 1]])

    def _add_plane(self, action: _Action, b: Array) -> None:
        """Require that the gain of an action at a belief (n,) is at most 0."""
        drop = _entropy(b)
        if action.likelihood.shape[1]:
            joint = (b[:, None] * action.likelihood).T
            drop -= self._gamma * sum(
                float(row.sum()) * _entropy(row / row.sum()) for row in joint if row.any()
            )
        self._rows.append(np.concatenate([-action.keep * b, [drop], action.drops * self._pair_roots(b)]))
        self._limits.append(-float(action.reward @ b))

    def _drop_planes(self, solution: Array) -> None:
        slack = np.array(self._limits) - np.array(self._rows) @ solution
        kept = np.argsort(slack, kind="stable")[:KEPT_ROWS]
        self._rows = [self._rows[i] for i in kept]
        self._limits = [self._limits[i] for i in kept]

    def _check(self, tried: Array, tolerance: float) -> float:
        """Return the offset that makes up for the largest gain; add planes where gains are above 0."""
        n, excess = len(self._states), 0.0
        v, entropy, weights = tried[:n], float(tried[n]), tried[n + 1 :]
        for i, action in enumerate(self.actions):
            b, value, upper = maximise_gain(
                action.reward - action.keep * v,
                entropy,
                self._gamma,
                action.likelihood,
                self.pairs,
                weights * action.drops,
                tolerance * action.keep / 2,
                self._maxima[i],
            )
            self._maxima[i] = b
            excess = max(excess, upper / action.keep)
            if value > 0:
                self._add_plane(action, b)
        return excess

    def _find_orbits(self, symmetries: Sequence[Sequence[int]]) -> Indices:
        """Return a number for each column, the same one for those that symmetries exchange."""
        n = len(self._states)
        position = {int(s): i for i, s in enumerate(self._states)}
        pair_position = {tuple(pair): n + 1 + i for i, pair in enumerate(self.pairs.tolist())}
        orbit, images = np.arange(n + 1 + len(self.pairs)), []
        self._images: list[Indices] = []
        for symmetry in symmetries:
            image = [position.get(int(symmetry[s]), -1) for s in self._states.tolist()]
            pairs = [
                pair_position.get((min(image[i], image[j]), max(image[i], image[j])))
                for i, j in self.pairs.tolist()
            ]
            if -1 in image or None in pairs:
                return orbit
            self._images.append(np.array(image))
            images.append(np.array([*image, n, *pairs]))
        before = None
        while before is None or (before != orbit).any():
            before = orbit
            for columns in images:
                orbit = np.minimum(orbit, orbit[columns])
        return np.unique(orbit, return_inverse=True)[1]

    def _is_symmetric(self, b: Array) -> bool:
        return bool(self._images) and all(np.abs(b[image] - b).max() < 1e-12 for image in self._images)


def _entropy(b: Array) -> float:
    positive = b[b > 0]
    return -float((positive * np.log(positive)).sum())


def _sum_columns(rows: Array, columns: Indices) -> Array:
    """Return rows (m, k) whose columns with one number are summed."""
    summed = np.zeros((len(rows), int(columns.max()) + 1))
    np.add.at(summed.T, columns, rows.T)
    return summed
