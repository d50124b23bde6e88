"""The pool of nodes of a search within limits, to which each policy of alpha vectors adds its controller."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcorpp.planning.evaluation.belief_graph import BeliefGraph
from lcorpp.planning.evaluation.sparse_beliefs import SparseBeliefs
from lcorpp.planning.limits.controller import (
    MAX_FACTORISED,
    MAX_ITERATED,
    Controller,
    evaluate_controller,
    repeat_actions,
)
from lcorpp.planning.limits.limited_model import LimitedModel
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array, Indices

MAX_NODES, MAX_EQUATIONS, MAX_STEPS = 400, 60_000, 500_000
"""Maximum numbers of nodes of a policy, of pairs of a node and a state, whose values are solved for, and of
steps between pairs."""

MIN_WEIGHT = 1e-6
"""Beliefs that are reached with a smaller discounted probability are not followed."""

MIN_DECAY, MAX_DECAY = 0.5, 0.99
"""Limits of the discount by which later beliefs are less important."""

ROUNDS = 4
"""Maximum number of improvements at the beliefs that are not followed."""


@dataclass(frozen=True, eq=False)
class Pool:
    """A controller that grows, with the values of its nodes, (1 + K, n, X), for each criterion."""

    controller: Controller
    values: Array

    @classmethod
    def of(cls, model: LimitedModel) -> Pool:
        """Return the pool of nodes that repeat an action."""
        n_states = len(model.base)
        controller = repeat_actions(len(model.stated.actions), len(model.stated.observations))
        unknown = np.full((len(model.discounts), len(controller), n_states), np.nan)
        nodes, states = (own.ravel() for own in np.indices((len(controller), n_states)))
        return cls(controller, evaluate_controller(model, controller, unknown, nodes, states))

    def __len__(self) -> int:
        return len(self.controller)

    def grow(
        self, model: LimitedModel, actions: Indices, successors: Indices, nodes: Indices, states: Indices
    ) -> Pool:
        """Return the pool with further nodes, whose successors (n, O) are nodes of the larger pool.

        Args:
            nodes, states: (m,) pairs whose values become known.
        """
        larger = Controller(
            np.concatenate([self.controller.actions, actions]),
            np.concatenate([self.controller.successors, successors]),
        )
        unknown = np.full((len(self.values), len(actions), self.values.shape[2]), np.nan)
        known = np.concatenate([self.values, unknown], axis=1)
        return Pool(larger, evaluate_controller(model, larger, known, nodes, states))

    def score(self, model: LimitedModel, factors: Array, starts: Indices) -> float:
        """Return the sum of the criteria at the starts, from nodes (N,); factors: (1 + K,)."""
        used = factors != 0
        own = np.where(model.starts > 0, self.values[used][:, starts], 0.0)  # (criteria, N, X)
        return float(factors[used] @ ((own * model.starts).sum(axis=2) @ model.weights))


def add_policy(model: LimitedModel, pool: Pool, problem: Pomdp, policy: Policy, factors: Array) -> Pool:
    """Return the pool with the controller of a policy for a sum of the criteria.

    The likeliest beliefs that the policy reaches become nodes. An edge to another belief leads to the node of
    the pool that is best there by its exact values; this is repeated while the sum at the starts increases.

    Args:
        problem: `model.make_problem(factors)`. policy: for it.
    """
    graph = BeliefGraph(problem, policy)
    roots = graph.add(SparseBeliefs.of(model.place(model.starts)))
    width = max(1, int(graph.beliefs.sizes.max()))
    branching = sum(len(own.targets) for own in model.steps) / (len(model.steps) * len(model.base))
    equations = MAX_EQUATIONS if model.discounts.max() <= MAX_ITERATED else MAX_FACTORISED
    size = min(MAX_NODES, equations // width, int(MAX_STEPS / (width * branching)))
    max_nodes = max(len(set(roots.tolist())), size)
    decay = min(max(float(model.discounts.min()), MIN_DECAY), MAX_DECAY)
    nodes = _choose_nodes(graph, roots, model.weights, max_nodes, decay)
    number = np.full(len(graph), -1)
    number[nodes] = len(pool) + np.arange(len(nodes))
    children = graph.children[nodes]  # (n, O)
    inner = np.where(children >= 0, number[children], -1)
    actions = graph.actions[nodes].astype(np.intp)
    fringe = np.nonzero((children >= 0) & (inner < 0))
    # after observations that are impossible at a node's belief, its action is repeated
    successors = np.where(inner >= 0, inner, actions[:, None])
    beliefs = graph.beliefs.take(nodes)
    pairs = number[nodes][beliefs.owners], (beliefs.states % len(model.base)).astype(np.intp)
    if not len(fringe[0]):
        return pool.grow(model, actions, successors, *pairs)
    ends = graph.beliefs.take(children[fringe])
    successors[fringe] = _find_best(ends, model.combine(factors, pool.values))
    best = pool.grow(model, actions, successors, *pairs)
    score = best.score(model, factors, number[roots])
    for _ in range(ROUNDS):
        successors = successors.copy()
        successors[fringe] = _find_best(ends, model.combine(factors, best.values))
        found = pool.grow(model, actions, successors, *pairs)
        after = found.score(model, factors, number[roots])
        if not after > score or (np.isfinite(score) and after - score <= 1e-12 * max(1.0, abs(score))):
            break
        best, score = found, after
    return best


def _choose_nodes(graph: BeliefGraph, roots: Indices, weights: Array, count: int, decay: float) -> Indices:
    """Return the likeliest beliefs that the policy reaches, at most `count`, the roots first."""
    chosen = list(dict.fromkeys(roots.tolist()))
    reached = dict.fromkeys(chosen, 0.0)
    for node, weight in zip(roots.tolist(), weights.tolist(), strict=True):
        reached[node] += weight
    taken, front = set(chosen), chosen
    waiting: dict[int, float] = {}
    while front:
        following = [node for node in front if not graph.absorbing[node]]
        children = graph.expand(np.array(following)) if following else ()
        for parent, _, p, child in zip(*(own.tolist() for own in children), strict=True):
            if child not in taken:
                waiting[child] = waiting.get(child, 0.0) + decay * p * reached[parent]
        ordered = sorted(waiting, key=lambda node: -waiting[node])
        room = min(count - len(chosen), max(1, len(ordered) // 2 + len(chosen) // 8))
        front = [node for node in ordered[:room] if waiting[node] > MIN_WEIGHT]
        for node in front:
            reached[node] = waiting.pop(node)
        taken.update(front)
        chosen += front
    return np.array(chosen, np.intp)


def _find_best(beliefs: SparseBeliefs, vectors: Array) -> Indices:
    """Return (k,) the index of the best of vectors (n, X) at each belief, of those that are known there."""
    from scipy.sparse import csr_array

    shape = (len(beliefs), vectors.shape[1])
    matrix = csr_array((beliefs.weights, beliefs.states, beliefs.begins), shape=shape)
    found = np.asarray(matrix @ vectors.T)
    best: Indices = np.where(np.isfinite(found), found, -np.inf).argmax(axis=1)
    return best
