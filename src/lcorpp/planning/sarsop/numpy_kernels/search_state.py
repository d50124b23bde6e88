"""The state of a search: all nodes of the belief tree with the alpha vectors and points they share."""

from __future__ import annotations

from math import log

import numpy as np

from lcorpp.planning.sarsop.numpy_kernels.alpha_vectors import VectorSet
from lcorpp.planning.sarsop.numpy_kernels.dependencies import VectorDependencies
from lcorpp.planning.sarsop.numpy_kernels.model import BeliefBatch, Model
from lcorpp.planning.sarsop.numpy_kernels.node import PREDICTOR_BINS, BeliefNode
from lcorpp.planning.sarsop.numpy_kernels.sawtooth import Sawtooth
from lcorpp.values import Array, Belief

BELIEF_RESOLUTION = 1e10
"""Beliefs whose weights are equal after rounding to multiples of 1 / BELIEF_RESOLUTION share a node."""

MAX_CACHED_OUTCOMES = 1 << 25
"""Largest number of cached weights of outcomes; further ones are recomputed at each visit."""

CHILD_SIZE = 64
"""Memory of a child of a node in bytes: eight numbers."""

MIN_GAIN = 1e-11
"""Smallest improvement of a bound, relative to `max_abs_value`; smaller ones are rounding errors."""


class SearchState:
    """All nodes, numbered in order of creation, with the bounds they share.

    nodes: the belief nodes, by number. sawtooth: the upper bound.
    sets: the alpha vectors of each group (a block of states, or all states; see `Model`).
    max_abs_value: the largest absolute initial bound, at least 1: the unit of rounding errors.
    next_vector: stamp of the next vector; stamps number the vectors of all groups in order of creation.
    dependencies: the vectors that each vector depends on.
    sizes_after_pruning: by group, the number of vectors after the last pruning.
    cache_budget: how many more weights of outcomes are cached.
    """

    def __init__(self, model: Model, informed: Array, blind: Array) -> None:
        self.model, self.sawtooth = model, Sawtooth(model, informed)
        self.max_abs_value = max(1.0, float(np.abs(blind).max()), float(np.abs(informed).max()))
        self.nodes: list[BeliefNode] = []
        self.sets = [VectorSet(len(model.group_states(g))) for g in range(model.mixed_group + 1)]
        # with one block there are no beliefs over several, and the mixed group stays empty
        for g in range(len(self.sets) if model.mixed_group > 1 else 1):
            for a in range(model.actions):  # the blind policies have the stamps 0 to A - 1
                self.sets[g].add(blind[a, model.group_states(g)], a, stamp=a)
        self.next_vector = model.actions
        self.dependencies = VectorDependencies(model.actions)
        self.sizes_after_pruning = [vectors.count for vectors in self.sets]
        self.cache_budget = MAX_CACHED_OUTCOMES
        self._node_index: dict[tuple[bytes, bytes], int] = {}
        self._known_points: dict[tuple[bytes, bytes], int] = {}  # stamps, by the belief of a removed node

    def find_or_add_node(self, belief: BeliefBatch) -> int:
        """Return the node of one belief, created if necessary."""
        weights = np.floor(belief.weights[0] * BELIEF_RESOLUTION + 0.5)  # as in C++: halves upwards
        inside = weights > 0
        key = belief.states[inside].tobytes(), weights[inside].tobytes()
        if key not in self._node_index:
            node = self._make_node(belief)
            node.point_stamp = self._known_points.pop(key, -1)  # the next point here replaces it
            self.nodes.append(node)
            self._node_index[key] = len(self.nodes) - 1
        return self._node_index[key]

    def clear_nodes(self) -> None:
        """Remove all nodes, but keep the vectors and points."""
        stamps = {key: self.nodes[number].point_stamp for key, number in self._node_index.items()}
        self._known_points |= {key: stamp for key, stamp in stamps.items() if stamp >= 0}
        self.nodes.clear()
        self._node_index.clear()
        self.cache_budget = MAX_CACHED_OUTCOMES

    @property
    def node_memory(self) -> int:
        """Memory of the nodes in bytes, without the objects of Python."""
        beliefs = sum(node.belief.weights.nbytes + node.belief.states.nbytes for node in self.nodes)
        children = sum(len(branch.lower) for node in self.nodes for branch in node.branches.values())
        return beliefs + CHILD_SIZE * children + 8 * (MAX_CACHED_OUTCOMES - self.cache_budget)

    def dense_belief(self, node: int) -> Belief:
        """Return (S,) the belief of a node."""
        sparse = self.nodes[node].belief
        dense = np.zeros(self.model.states)
        dense[sparse.states] = sparse.weights[0]
        return dense

    def _make_node(self, belief: BeliefBatch) -> BeliefNode:
        weights, model = belief.weights[0], self.model
        entropy = -sum(p * log(p) for p in weights.tolist()) / max(log(model.states), 1e-300)
        q_upper = self.sawtooth.compute_informed_values(belief)[0]
        upper = float(self.sawtooth.compute_bound(belief)[0])
        return BeliefNode(
            belief=belief,
            expected_rewards=model.reward[:, belief.states] @ weights,
            q_lower=np.full(model.actions, -np.inf),
            q_upper=q_upper,
            upper=upper,
            sawtooth_value=upper,
            sawtooth_version=self.sawtooth.next_stamp,
            informed_value=float(q_upper.max()),
            entropy_bin=min(max(int(entropy * PREDICTOR_BINS), 0), PREDICTOR_BINS - 1),
        )
