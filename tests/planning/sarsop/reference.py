"""The bounds of SARSOP in dense arithmetic, written from the equations: the oracle of the C++ kernels.

outcomes             Bayes' rule                            TreeValue      the optimal value, by enumeration
initial_bounds       blind policies, MDP, informed bound    TwoStateValue  the optimal value of two states
Bounds               what the vectors and points of a tree promise, and one backup
Predictor, sample    Algorithm 2 in Python, on the compiled tree

Sources: Hauskrecht, JAIR 2000 (initial bounds, sawtooth); Kurniawati, Hsu and Lee, RSS 2008 (backup,
sampling); Sondik, The optimal control of partially observable Markov processes, 1971 (the optimal value).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log
from typing import Any

import numpy as np
from scipy.optimize import linprog

from lcorpp.planning import Pomdp
from lcorpp.planning.sarsop.kernel_model import build_model


def outcomes(pomdp: Pomdp, beliefs: Any, action: int) -> Any:
    """(..., O, S) the next beliefs times the probabilities of their observations, for beliefs (..., S)."""
    predicted = beliefs @ pomdp.transition.dense[action]
    return predicted[..., None, :] * pomdp.observation.dense[action].T


SWEEPS = 600
"""Of an iteration: .97^600 is 1e-8."""


def initial_bounds(pomdp: Pomdp, sweeps: int) -> tuple[Any, Any, Any]:
    """(A, S) each: the values of the blind policies, the Q values of the MDP, and the fast informed bound.

    Each is the limit of its equation: a linear system, and two iterations from the largest possible value,
    whose limits they exceed by at most gamma^sweeps times its distance from the smallest.
    """
    T, Z, R, gamma = pomdp.transition.dense, pomdp.observation.dense, pomdp.reward, pomdp.discount
    blind = np.linalg.solve(np.eye(R.shape[1]) - gamma * T, R[:, :, None])[:, :, 0]
    mdp = informed = np.full(R.shape, R.max() / (1 - gamma))
    joint = np.einsum("ast,ato->asot", T, Z)
    for _ in range(sweeps):
        mdp = R + gamma * T @ mdp.max(axis=0)
        informed = R + gamma * (joint @ informed.T).max(axis=3).sum(axis=2)
    return blind, mdp, informed


class TreeValue:
    """The optimal value, by the tree of all actions and observations.

    The tree is as deep as `max_beliefs` leaves permit, and at most 40 steps. At a leaf the value is at least
    that of the best blind policy and at most that of the MDP.
    """

    def __init__(self, pomdp: Pomdp, max_beliefs: int = 3000) -> None:
        self._pomdp, self._max_beliefs = pomdp, max_beliefs
        self._blind, mdp, _ = initial_bounds(pomdp, SWEEPS)
        self._mdp = mdp + pomdp.discount**SWEEPS * np.ptp(pomdp.reward) / (1 - pomdp.discount)

    def interval(self, belief: Any) -> tuple[float, float]:
        """The lowest and the highest optimal value at a belief (S,), also times a probability."""
        pomdp = self._pomdp
        actions, observations = len(pomdp.actions), len(pomdp.observations)
        levels = [np.asarray(belief, dtype=float)[None]]
        while len(levels) <= 40 and len(levels[-1]) * actions * observations <= self._max_beliefs:
            after = np.stack([outcomes(pomdp, levels[-1], a) for a in range(actions)], axis=1)
            levels.append(after.reshape(-1, len(pomdp.states)))
        bounds = [(levels[-1] @ leaf.T).max(axis=1) for leaf in (self._blind, self._mdp)]
        for beliefs in reversed(levels[:-1]):
            for k, bound in enumerate(bounds):
                sums = bound.reshape(-1, actions, observations).sum(axis=2)
                bounds[k] = (beliefs @ pomdp.reward.T + pomdp.discount * sums).max(axis=1)
        return float(bounds[0][0]), float(bounds[1][0])


class TwoStateValue:
    """The optimal value of a problem with two states, by exact value iteration.

    A value function is the maximum of lines over the probability of the second state. A step adds, for each
    action, the lines of all observations in every combination, and drops those that are the highest nowhere.

    vectors: (K, 2) lower bounds on the optimal value, at most `error` below it at any belief.
    """

    def __init__(self, pomdp: Pomdp, error: float) -> None:
        gamma, self.error = pomdp.discount, error
        self.vectors = np.full((1, 2), pomdp.reward.min() / (1 - gamma))
        rest = float(np.ptp(pomdp.reward)) / (1 - gamma)
        while rest > error:
            self.vectors = self._step(pomdp)
            rest *= gamma

    def _step(self, pomdp: Pomdp) -> Any:
        lines = []
        for a, reward in enumerate(pomdp.reward):
            total = reward[None]
            for seen in pomdp.observation.dense[a].T:
                after = pomdp.discount * self.vectors * seen @ pomdp.transition.dense[a].T
                total = highest_lines((total[:, None] + after[None]).reshape(-1, 2))
            lines.append(total)
        return highest_lines(np.concatenate(lines))

    def interval(self, belief: Any) -> tuple[float, float]:
        """The lowest and the highest optimal value at a belief."""
        value = float((self.vectors @ belief).max())
        return value, value + self.error


def highest_lines(lines: Any) -> Any:
    """Those lines, with values (K, 2) at the ends of [0, 1], that are the highest between: a convex hull."""
    hull: list[Any] = []
    for line in lines[np.lexsort((lines[:, 0], lines[:, 1] - lines[:, 0]))]:  # by slope, then by value at 0
        while hull and line[0] >= hull[-1][0]:  # as high at 0, and at least as steep
            hull.pop()
        if hull and line[1] <= hull[-1][1]:
            continue
        while len(hull) > 1 and _crossing(hull[-2], line) <= _crossing(hull[-2], hull[-1]):
            hull.pop()
        hull.append(line)
    return np.array(hull)


def _crossing(flat: Any, steep: Any) -> float:
    """Where the second line begins to be higher than the first."""
    below = flat[0] - steep[0]
    return float(below / (below + steep[1] - flat[1]))


@dataclass(frozen=True)
class Bounds:
    """The vectors and points of a tree, and what they promise at a belief (S,), also times a probability.

    groups: for each group of the tree its states (n,), alpha vectors (K, n) and first actions (K,).
    informed: (A, S). corners: (S,). points: beliefs (S,) with upper bounds.
    """

    pomdp: Pomdp
    block: Any
    groups: list[tuple[Any, Any, Any]]
    informed: Any
    corners: Any
    points: list[tuple[Any, float]]

    @classmethod
    def of(cls, pomdp: Pomdp, tree: Any, informed: Any) -> Bounds:
        """The bounds of a tree at this moment."""
        corners, begins, states, weights, values = tree.points()
        points = []
        for k, value in enumerate(values.tolist()):
            inside = slice(begins[k], begins[k + 1])
            points.append((np.zeros(len(corners)), value))
            points[-1][0][states[inside]] = weights[inside]
        groups = [tree.vectors(group) for group in range(tree.group_count)]
        return cls(pomdp, build_model(pomdp).export_blocks(), groups, informed, corners, points)

    def group(self, belief: Any) -> int:
        """The block of a belief, or the last group for a belief over several."""
        blocks = set(self.block[belief > 0].tolist())
        return blocks.pop() if len(blocks) == 1 else len(self.groups) - 1

    def lower(self, belief: Any) -> float:
        """max over the alpha vectors of alpha.b."""
        states, vectors, _ = self.groups[self.group(belief)]
        return float((vectors @ belief[states]).max())

    def upper(self, belief: Any) -> float:
        """The lower one of the informed bound and the sawtooth: the plane through the corners, lowered by the
        point of the belief's group that lowers it most."""
        own = self.group(belief)
        lowered = [0.0]
        for point, value in self.points:
            if self.group(point) == own:
                inside = point > 0
                share = (belief[inside] / point[inside]).min()
                lowered.append(share * min(0.0, value - self.corners @ point))
        return float(min((self.informed @ belief).max(), self.corners @ belief + min(lowered)))

    def convex_hull(self, belief: Any) -> float:
        """The closest bound by points: the lowest mixture of corners and points that is the belief."""
        beliefs = np.array([*np.eye(len(self.corners)), *(point for point, _ in self.points)])
        values = np.array([*self.corners, *(value for _, value in self.points)])
        found = linprog(values, A_eq=beliefs.T, b_eq=belief)
        assert found.success, found.message
        return float(found.fun)

    def q_lower(self, belief: Any) -> Any:
        """(A,) the rewards and the lower bounds after each action."""
        return self._look_ahead(belief, self.lower)

    def q_upper(self, belief: Any) -> Any:
        """(A,) the rewards and the upper bounds after each action."""
        return self._look_ahead(belief, self.upper)

    def _look_ahead(self, belief: Any, bound: Any) -> Any:
        after = [outcomes(self.pomdp, belief, a) for a in range(len(self.pomdp.actions))]
        sums = [sum(bound(each) for each in beliefs if each.any()) for beliefs in after]
        return self.pomdp.reward @ belief + self.pomdp.discount * np.array(sums)

    def back_up(self, belief: Any) -> tuple[int, Any]:
        """The best action at a belief and the alpha vector (n,) over the states of its group (Algorithm 3).

        alpha(s) = R(a, s) + gamma sum over o and s' of T Z alpha_o(s'), with the vector alpha_o that is best
        at the belief after o. If o is impossible there, it is the best vector before any observation.
        """
        action = int(self.q_lower(belief).argmax())
        own = self.groups[self.group(belief)][0]
        T, Z = self.pomdp.transition.dense[action][own], self.pomdp.observation.dense[action]
        predicted = belief @ self.pomdp.transition.dense[action]
        vector = self.pomdp.reward[action, own].astype(float)
        for after, seen in zip(outcomes(self.pomdp, belief, action), Z.T, strict=True):
            reached = np.flatnonzero((T * seen).any(axis=0))
            if len(reached):
                states, vectors, _ = self.groups[self.block[reached[0]]]
                weights = after[states] if after.any() else predicted[states]
                if not weights.any():
                    weights = np.ones(len(states))
                best = vectors[(vectors @ weights).argmax()]
                vector += self.pomdp.discount * (T * seen)[:, states] @ best
        return action, vector


PREDICTOR_BINS = 32
"""Of the initial upper bound and of the entropy."""


class Predictor:
    """The mean lower bound of the beliefs with the same bins of initial upper bound and entropy.

    Source: Kurniawati, Hsu and Lee, RSS 2008, section III-B.
    """

    def __init__(self, informed: Any) -> None:
        self._informed, corners = informed, informed.max(axis=0)
        self._lowest, self._range = corners.min(), max(np.ptp(corners), 1e-300)
        self._known: dict[tuple[int, int], list[float]] = {}

    def _bin(self, belief: Any) -> tuple[int, int]:
        inside = belief[belief > 0]
        entropy = -(inside * np.log(inside)).sum() / log(len(belief)) if len(belief) > 1 else 0.0
        level = ((self._informed @ belief).max() - self._lowest) / self._range
        found = (np.clip(share * PREDICTOR_BINS, 0, PREDICTOR_BINS - 1) for share in (level, entropy))
        return tuple(map(int, found))  # type: ignore[return-value]

    def learn(self, tree: Any, node: int) -> None:
        """Add the lower bound of a node."""
        self._known.setdefault(self._bin(tree.belief(node)), []).append(tree.cached_lower(node))

    def predict(self, tree: Any, node: int) -> float:
        """The prediction for a node, which is its upper bound if there are no similar beliefs."""
        known = self._known.get(self._bin(tree.belief(node)))
        return float(np.mean(known)) if known else tree.cached_upper(node)


NEGLIGIBLE_SHARE, LEVEL_MARGIN = 0.1, 1e-6
"""Shares of the allowed gap: below the first, deep sampling has nothing left to find; only a value above a
level by more than the second counts as above it, because a value often equals its level exactly."""


def sample(
    tree: Any,
    predictor: Any,
    root: int,
    target: float,
    max_depth: int,
    seconds: float,
    use_lower_bound: bool,
) -> int:
    """Sample a path from the root and back up its nodes, as `Tree.sample` does; return their number.

    L and U are the levels that the lower and the upper bound of a node must exceed to matter at the root.
    """
    gamma, node, path, allowed = tree.discount, root, [root], target
    action = tree.select_action(root, use_lower_bound)
    L, U = tree.cached_lower(root), tree.cached_lower(root) + allowed
    while gamma > 0 and len(path) < max_depth:
        low, high, margin = tree.cached_lower(node), tree.cached_upper(node), LEVEL_MARGIN * allowed
        if high - low <= NEGLIGIBLE_SHARE * allowed:
            break
        if predictor.predict(tree, node) <= L + margin and high <= max(U, low + allowed) + margin:
            break
        reward = tree.expected_rewards(node)[action]
        _, probability, lower, upper, nodes = tree.children(node, action)
        L, U = max(L, low), max(U, low + allowed)
        allowed /= gamma
        excess = upper - lower - probability * allowed
        fresh = ~np.isin(nodes, path)  # under a slow discount a path would otherwise stay at one belief
        if (excess[fresh] > 0).any():
            excess = np.where(fresh, excess, -np.inf)
        k = int(excess.argmax())
        # what child k needs for its parent to reach a level, with the other children unchanged
        L = ((L - reward) / gamma - (lower.sum() - lower[k])) / probability[k]
        U = ((U - reward) / gamma - (upper.sum() - upper[k])) / probability[k]
        node = tree.find_or_add_child(node, action, k)
        action = tree.select_action(node, use_lower_bound)
        predictor.learn(tree, node)
        path.append(node)
    for each in reversed(path):
        tree.backup(each)
    return len(path)
