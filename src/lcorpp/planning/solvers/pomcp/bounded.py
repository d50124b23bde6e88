"""Search over particle beliefs with a lower and an upper bound of each, estimated from the same particles.

Sources: Wu and others, Adaptive online packing-guided search for POMDPs, NeurIPS 2021 (particles that the
beliefs after an action share); Somani and others, DESPOT, NIPS 2013 (the choice of the next belief).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from time import monotonic

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.planning.solvers.pomcp.batches import Batch, Observations, States, number_rows
from lcorpp.planning.solvers.pomcp.particles import Particles, draw_systematically, resample
from lcorpp.planning.solvers.pomcp.search import MIN_WEIGHT, ActionValues
from lcorpp.values import Array, Indices

GAP_SHARE = 0.95
"""xi of DESPOT: a trial ends at beliefs whose gap, discounted, is below this share of the first."""

MIN_EFFECTIVE_SHARE = 0.3
"""Particles are resampled if the effective number, 1 / sum of squared weights, is below this share."""

MAX_OBSERVATIONS = 10
"""Maximum number of different observations after an action; of more, some are drawn by their weights."""


class ParticleNode:
    """A belief in the search tree: particles and weights (N,), of states before the end of the decision.

    probability: that the decision is not over. lower, upper: bounds on the value, which counts 0 after the
    end. depth: the number of actions before it.
    branches: after the expansion, what may follow.
    """

    __slots__ = ("branches", "depth", "lower", "probability", "states", "upper", "weights")

    def __init__(self, states: States, weights: Array, lower: float, upper: float, depth: int) -> None:
        self.states, self.weights, self.probability = states, weights, 1.0
        self.lower, self.upper, self.depth = lower, upper, depth
        self.branches: Branches | None = None


@dataclass
class Branches:
    """The actions at a belief of N particles, and K observations after them: of each a belief.

    rewards: (A,) mean reward of each action. after: (A, N) next states.
    actions: (K,) the action of each branch. probabilities: (K,) of its observation.
    weights: (K, N) of the next states. lower, upper: (K,) bounds on the value after it.
    children: beliefs that were visited, by the number of their branch.
    """

    rewards: Array
    after: States
    actions: Indices
    probabilities: Array
    weights: Array
    lower: Array
    upper: Array
    children: dict[int, ParticleNode] = field(default_factory=dict)

    def value(self, bounds: Array, discount: float) -> Array:
        """Return (A,) the values of the actions by values (K,) of the branches."""
        return self.rewards + discount * np.bincount(
            self.actions, self.probabilities * bounds, len(self.rewards)
        )

    def visit(self, branch: int, depth: int) -> ParticleNode:
        """Return the belief of a branch."""
        if branch not in self.children:
            states, weights = self.after[self.actions[branch]], self.weights[branch]
            lower, upper = float(self.lower[branch]), float(self.upper[branch])
            self.children[branch] = ParticleNode(states, weights, lower, upper, depth)
        return self.children[branch]


class BoundedParticleSearch:
    """A tree of particle beliefs that grows where the bounds at its root may come closer (DESPOT's trials).

    The expansion of a belief simulates each action of each particle once. After an action, the beliefs of
    all observations share the next states, and differ in their weights. Initial bounds are the means of those
    of the states. All bounds are estimates: they hold for the particles.

    Args:
        batch: simulates the states, and has bounds.
        particles: number of particles of a belief.
        rng: of the resampling.

    Raises:
        ModelError: the likelihood of a simulated observation is 0.
    """

    def __init__(self, batch: Batch, particles: int, rng: np.random.Generator) -> None:
        self._batch, self._count, self._rng = batch, particles, rng
        self._expansions = 0

    def search(self, belief: Particles, expansions: int) -> ActionValues:
        """Search from a belief.

        Args:
            expansions: largest number of beliefs that are expanded, at least 1.

        Returns:
            The bounds of the actions. The best action has the largest lower bound.
        """
        began, self._expansions, gamma = monotonic(), 0, self._batch.discount
        visits = np.zeros(self._batch.actions, dtype=np.intp)
        if (self._batch.group(belief.states) < 0).all():  # the decision is over
            return ActionValues(np.zeros(len(visits)), visits, 0, 0.0, np.zeros(len(visits)))
        root = ParticleNode(belief.states, belief.weights, -inf, inf, 0)
        branches, before = self._expand(root), 0
        while before < self._expansions < expansions:  # a trial expands, or is the last
            before = self._expansions
            values, bounds = branches.value(branches.lower, gamma), branches.value(branches.upper, gamma)
            gap = float(bounds.max() - values.max())  # of the actions; the state's own bounds choose none
            if gap > 0:
                visits[self._sample(root, gap, expansions)] += 1
        values, bounds = branches.value(branches.lower, gamma), branches.value(branches.upper, gamma)
        values, bounds = root.probability * values, root.probability * np.maximum(values, bounds)
        return ActionValues(values, visits, self._expansions, monotonic() - began, bounds)

    def _sample(self, root: ParticleNode, gap: float, expansions: int) -> int:
        """Follow the largest upper bounds to a belief whose gap matters, and expand; return the action.

        Args:
            gap: between the bounds of the best actions. expansions: the largest number of all trials.
        """
        path, gamma = list[tuple[Branches, int, ParticleNode]](), self._batch.discount
        target, node, first = GAP_SHARE * gap, root, 0
        while node.branches is not None or self._expansions < expansions:
            branches = node.branches or self._expand(node)
            action = int(np.argmax(branches.value(branches.upper, gamma)))
            first = first if path else action
            target /= gamma
            gaps = branches.upper - branches.lower
            excess = np.where(branches.actions == action, branches.probabilities * (gaps - target), -inf)
            widest = int(np.argmax(excess))
            if not excess[widest] > 0 or gamma ** (node.depth + 1) < MIN_WEIGHT:
                break
            child = branches.visit(widest, node.depth + 1)
            path.append((branches, widest, node))
            node = child
        for branches, branch, parent in reversed(path):
            branches.lower[branch], branches.upper[branch] = node.lower, node.upper
            self._back_up(parent)
            node = parent
        return first

    def _expand(self, node: ParticleNode) -> Branches:
        """Simulate all actions at a belief, and back up their bounds."""
        self._expansions += 1
        self._resample(node)
        batch, n, weights = self._batch, len(node.states), node.weights
        actions = np.repeat(np.arange(batch.actions), n)
        states = np.concatenate([node.states] * batch.actions)
        after, observations, rewards = batch.step(states, actions)
        lower, upper = (bounds.reshape(-1, n) for bounds in self._batch.bounds(after))
        first, probabilities = self._choose_observations(
            actions, observations, np.tile(weights, batch.actions)
        )
        own = actions[first]
        rows = (own[:, None] * n + np.arange(n)).reshape(-1)
        likelihoods = batch.likelihood(
            np.repeat(observations[first], n, axis=0), states[rows], actions[rows], after[rows]
        ).reshape(-1, n)
        highest = likelihoods.max(axis=1, keepdims=True)  # likelihoods may be tiny
        by_own = likelihoods[np.arange(len(first)), first % n]  # of the states that were observed
        if not (by_own > 0).all():
            seen = observations[first[int(np.argmin(by_own))]]
            raise ModelError(f"likelihood() returned 0 for the observation {seen} that step() returned")
        beliefs = likelihoods / highest * weights
        beliefs /= beliefs.sum(axis=1, keepdims=True)
        node.branches = Branches(
            rewards.reshape(-1, n) @ weights,
            after.reshape(batch.actions, n, *after.shape[1:]),
            own,
            probabilities,
            beliefs,
            (beliefs * lower[own]).sum(axis=1),
            (beliefs * upper[own]).sum(axis=1),
        )
        self._back_up(node)
        return node.branches

    def _back_up(self, node: ParticleNode) -> None:
        """Bring the bounds of a belief up to date with its branches."""
        branches, gamma = node.branches, self._batch.discount
        assert branches is not None
        lower = node.probability * float(branches.value(branches.lower, gamma).max())
        upper = node.probability * float(branches.value(branches.upper, gamma).max())
        node.lower = max(node.lower, lower)
        node.upper = max(node.lower, min(node.upper, upper))  # estimates may cross

    def _resample(self, node: ParticleNode) -> None:
        """Leave out states after the end, and replace particles of which few have most of the weight."""
        alive = np.flatnonzero((self._batch.group(node.states) >= 0) & (node.weights > 0))
        weights: Array = node.weights[alive]
        node.probability = float(weights.sum())
        weights /= node.probability
        node.states, node.weights = node.states[alive], weights
        effective = 1 / float(weights @ weights)
        if len(weights) > self._count or effective < MIN_EFFECTIVE_SHARE * self._count:
            drawn = resample(self._batch, node.states, weights, self._count, self._rng)
            node.states, node.weights = drawn.states, drawn.weights

    def _choose_observations(
        self, actions: Indices, observations: Observations, weights: Array
    ) -> tuple[Indices, Array]:
        """Return (K,) rows of the observations to consider after each action, and their probabilities."""
        _, numbers = number_rows(observations)
        keys = actions * (int(numbers.max()) + 1) + numbers
        _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
        probabilities = np.asarray(np.bincount(inverse, weights), dtype=np.float64)
        counts = np.bincount(actions[first])
        for action in np.flatnonzero(counts > MAX_OBSERVATIONS).tolist():
            own = np.flatnonzero(actions[first] == action)
            drawn = draw_systematically(probabilities[own], MAX_OBSERVATIONS, self._rng)
            probabilities[own] = np.bincount(drawn, minlength=len(own)) / MAX_OBSERVATIONS
        kept = np.flatnonzero(probabilities > 0)
        return first[kept], probabilities[kept]
