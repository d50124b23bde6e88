"""The belief tree and what is known of each node: bounds of its children, refreshed by what is new.

A belief that is reached in two ways is one node. Source: Kurniawati, Hsu and Lee, RSS 2008, section III;
the caches follow the observation that a visit needs only the vectors and points added since the last one.
"""

from __future__ import annotations

import numpy as np

from lcorpp.planning.belief import IMPOSSIBLE
from lcorpp.planning.sarsop.dynamics import Dynamics
from lcorpp.planning.sarsop.lower import AlphaVectors
from lcorpp.planning.sarsop.upper import Sawtooth
from lcorpp.values import Array, Belief


class Node:
    """A belief and its n possible children, sorted by action.

    belief: (S,). immediate: (A,) expected reward of each action.
    action, observation, probability: (n,) of each child. begins: (A,) first child of each action.
    lower, upper: (n,) bounds of the children times their probability.
    best: (n,) stamps of the vectors that give `lower`.
    q_lower, q_upper: (A,) bounds on the value of each action. low, high: bounds on the value of the belief.
    surface: the sawtooth at the belief when last asked, with the points before stamp seen_surface.
    point: stamp of the node's point in the upper bound, -1 for none.
    links: the children that were visited.
    """

    __slots__ = (
        "action",
        "begins",
        "belief",
        "best",
        "high",
        "immediate",
        "links",
        "low",
        "lower",
        "observation",
        "point",
        "probability",
        "q_lower",
        "q_upper",
        "seen_points",
        "seen_surface",
        "seen_vectors",
        "surface",
        "upper",
    )

    def __init__(self, belief: Belief, dynamics: Dynamics, high: float) -> None:
        self.belief = belief
        probability = dynamics.observation_probabilities(dynamics.spread(belief))
        self.action, self.observation = np.nonzero(probability >= IMPOSSIBLE)
        self.probability = probability[self.action, self.observation]
        self.begins = np.searchsorted(self.action, np.arange(dynamics.actions))
        self.immediate: Array = dynamics.reward @ belief
        n = len(self.action)
        self.lower, self.upper = np.full(n, -np.inf), np.full(n, np.inf)
        self.best = np.full(n, -1, dtype=np.intp)
        self.q_lower = np.full(dynamics.actions, -np.inf)
        self.q_upper = np.full(dynamics.actions, np.inf)
        self.low, self.high = -np.inf, high
        self.seen_vectors = 0
        self.seen_points = np.zeros(dynamics.actions, dtype=np.intp)
        self.point = -1
        self.surface, self.seen_surface = np.inf, 0
        self.links: dict[int, Node] = {}

    def children(self, action: int) -> slice:
        """The children of one action."""
        end = int(self.begins[action + 1]) if action + 1 < len(self.begins) else len(self.action)
        return slice(int(self.begins[action]), end)


class Tree:
    """All nodes, by belief, with the two bounds they share."""

    def __init__(self, dynamics: Dynamics, alphas: AlphaVectors, sawtooth: Sawtooth) -> None:
        self.dynamics, self.alphas, self.sawtooth = dynamics, alphas, sawtooth
        self.nodes: dict[bytes, Node] = {}
        self.outdated: set[int] = set()  # stamps of points that a lower one at the same belief replaces

    def node(self, belief: Belief) -> Node:
        """The node of a belief (S,), made where there is none."""
        # Beliefs that differ by rounding alone share a node. This is sound: a node's bounds are used at its
        # own belief only; a parent's cache is computed from its own children.
        key = (np.round(belief, 10) + 0.0).tobytes()
        node = self.nodes.get(key)
        if node is None:
            node = Node(belief, self.dynamics, self.sawtooth.value(belief))
            self.nodes[key] = node
        return node

    def child(self, node: Node, k: int) -> Node:
        """The node of a node's k-th child."""
        if k not in node.links:
            weights = self._weights(node, self.dynamics.spread(node.belief), slice(k, k + 1))[0]
            node.links[k] = self.node(weights / weights.sum())
        return node.links[k]

    def refresh(self, node: Node) -> None:
        """Bring a node's bounds up to date with the vectors and points added since its last visit."""
        spread = self.dynamics.spread(node.belief)
        weights = self._weights(node, spread, slice(None))
        self._refresh_lower(node, weights)
        self._refresh_upper(node, weights)

    def forget_best(self, node: Node) -> None:
        """Make the next refresh look at all vectors: a remembered one was pruned."""
        node.lower[:] = -np.inf
        node.seen_vectors = 0

    def _weights(self, node: Node, spread: Array, which: slice) -> Array:
        """(n, S) the children's beliefs times their probability."""
        action = node.action[which]
        return spread[action] * self.dynamics.observing[action, node.observation[which]]

    def _refresh_lower(self, node: Node, weights: Array) -> None:
        first = self.alphas.first_since(node.seen_vectors)
        if first < self.alphas.count:
            values = weights @ self.alphas.vectors[first:].T
            row = values.argmax(axis=1)
            value = values[np.arange(len(values)), row]
            better = value > node.lower
            node.lower[better] = value[better]
            node.best[better] = self.alphas.stamps[first:][row[better]]
            sums = np.add.reduceat(node.lower, node.begins)
            node.q_lower = node.immediate + self.dynamics.discount * sums
            node.low = max(
                float(node.q_lower.max()), float((self.alphas.vectors[first:] @ node.belief).max()), node.low
            )
        node.seen_vectors = self.alphas.next_stamp

    def _refresh_upper(self, node: Node, weights: Array) -> None:
        """Only the action that looks best need be up to date: the others' old bounds are bounds still."""
        sawtooth, stale = self.sawtooth, set(range(self.dynamics.actions))
        while (a := int(node.q_upper.argmax())) in stale:
            stale.discard(a)
            part = node.children(a)
            bound = sawtooth.bound(weights[part], int(node.seen_points[a]))
            np.minimum(node.upper[part], bound, out=node.upper[part])
            node.seen_points[a] = sawtooth.next_stamp
            node.q_upper[a] = node.immediate[a] + self.dynamics.discount * float(node.upper[part].sum())
        node.high = min(node.high, float(node.q_upper[a]))
