"""The belief tree and the value predictor: what a search calls, with checks of the arguments.

Source: Kurniawati, Hsu and Lee, RSS 2008, sections III and IV.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import isnan

import numpy as np
import numpy.typing as npt

from lcorpp.planning.sarsop import kernel_protocols
from lcorpp.planning.sarsop.kernel_protocols import PointArrays
from lcorpp.planning.sarsop.numpy_kernels.backup import backup
from lcorpp.planning.sarsop.numpy_kernels.bounds import copy_table
from lcorpp.planning.sarsop.numpy_kernels.compression import compress
from lcorpp.planning.sarsop.numpy_kernels.model import Model
from lcorpp.planning.sarsop.numpy_kernels.node import PREDICTOR_BINS, BeliefNode
from lcorpp.planning.sarsop.numpy_kernels.pruning import prune
from lcorpp.planning.sarsop.numpy_kernels.refresh import (
    find_or_add_child,
    refresh,
    select_action,
    update_best_vector,
    update_upper_bound,
)
from lcorpp.planning.sarsop.numpy_kernels.search_state import SearchState
from lcorpp.planning.sarsop.path_sampling import sample
from lcorpp.values import Array, Belief


class Tree:
    """`kernel_protocols.Tree` in numpy, which documents the methods."""

    def __init__(self, model: Model, informed: Array, blind: Array) -> None:
        self._state = SearchState(model, copy_table(model, informed), copy_table(model, blind))

    @property
    def discount(self) -> float:
        return self._state.model.discount

    @property
    def node_count(self) -> int:
        return len(self._state.nodes)

    @property
    def vector_count(self) -> int:
        return sum(vectors.count for vectors in self._state.sets)

    @property
    def made_count(self) -> int:
        return self._state.next_vector

    @property
    def point_count(self) -> int:
        return self._state.sawtooth.count

    @property
    def node_memory(self) -> int:
        return self._state.node_memory

    @property
    def bound_memory(self) -> int:
        state = self._state
        vectors = sum(vectors.table.nbytes for vectors in state.sets)
        return vectors + state.dependencies.memory_size + state.sawtooth.memory_size

    @property
    def group_count(self) -> int:
        return len(self._state.sets)

    def clear_nodes(self) -> None:
        self._state.clear_nodes()

    def drop_older_points(self) -> None:
        self._state.sawtooth.drop_older_half()

    def find_or_add_node(self, belief: Belief) -> int:
        return self._state.find_or_add_node(self._state.model.make_belief(belief))

    def find_or_add_child(self, node: int, action: int, child: int) -> int:
        parent = self.node(node)
        branch = parent.branches.get(self._check_action(action))
        if branch is None or not 0 <= child < len(branch.child_nodes):
            raise IndexError("unknown child")
        return find_or_add_child(self._state, parent, action, child)

    def refresh(self, node: int) -> None:
        refresh(self._state, self.node(node))

    def select_action(self, node: int, use_lower_bound: bool) -> int:
        return select_action(self._state, self.node(node), use_lower_bound)

    def backup(self, node: int) -> None:
        backup(self._state, self.node(node))

    def sample(
        self,
        predictor: kernel_protocols.ValuePredictor,
        root: int,
        target: float,
        max_depth: int,
        seconds: float,
        use_lower_bound: bool,
    ) -> int:
        self.node(root)
        if not target >= 0 or isnan(seconds):
            raise ValueError("target and seconds must not be NaN, target not negative")
        return sample(self, predictor, root, target, max_depth, seconds, use_lower_bound)

    def prune(self, roots: Sequence[int], radius: float, max_ratio: float, growth: float) -> None:
        for root in roots:
            self.node(root)
        if not (radius >= 0 and max_ratio >= 0 and growth >= 0):
            raise ValueError("radius, max_ratio and growth must be numbers, not negative")
        prune(self._state, roots, radius, max_ratio, growth)

    def compress(self, roots: Sequence[int], max_evaluations: float, seconds: float) -> bool:
        for root in roots:
            self.node(root)
        if not max_evaluations >= 0 or isnan(seconds):
            raise ValueError("max_evaluations and seconds must not be NaN, max_evaluations not negative")
        return compress(self._state, roots, max_evaluations, seconds)

    def lower_bound(self, node: int) -> float:
        return update_best_vector(self._state, self.node(node))

    def upper_bound(self, node: int) -> float:
        return update_upper_bound(self._state, self.node(node))

    def cached_lower(self, node: int) -> float:
        return self.node(node).lower

    def cached_upper(self, node: int) -> float:
        return self.node(node).upper

    def q_lower(self, node: int) -> Array:
        return self.node(node).q_lower.copy()

    def q_upper(self, node: int) -> Array:
        return self.node(node).q_upper.copy()

    def expected_rewards(self, node: int) -> Array:
        return self.node(node).expected_rewards.copy()

    def belief(self, node: int) -> Belief:
        self.node(node)
        return self._state.dense_belief(node)

    def children(
        self, node: int, action: int
    ) -> tuple[npt.NDArray[np.int32], Array, Array, Array, npt.NDArray[np.int32]]:
        branch = self.node(node).branches.get(self._check_action(action))
        if branch is None:
            indices, numbers = np.empty(0, dtype=np.int32), np.empty(0)
            return indices, numbers, numbers, numbers, indices
        bounds = branch.probability.copy(), branch.lower.copy(), branch.upper.copy()
        return branch.observation.astype(np.int32), *bounds, branch.child_nodes.astype(np.int32)

    def vectors(
        self, group: int, with_pruned: bool = False
    ) -> tuple[npt.NDArray[np.int32], Array, npt.NDArray[np.int32]]:
        state = self._state
        vectors = state.sets[self._check_group(group)]
        needed = state.dependencies.pruned() if with_pruned else []
        pruned = [vector for vector in needed if vector.group == group]
        table = np.concatenate([vectors.table.T, *(vector.values[None] for vector in pruned)])
        actions = [*vectors.actions.tolist(), *(vector.action for vector in pruned)]
        states = state.model.group_states(group).astype(np.int32)
        return states, np.ascontiguousarray(table), np.array(actions, dtype=np.int32)

    def points(self) -> tuple[Array, *PointArrays]:
        return self._state.sawtooth.export_points()

    def add_vectors(self, group: int, vectors: Array, actions: npt.NDArray[np.int32]) -> None:
        state, own = self._state, self._state.sets[self._check_group(group)]
        table, first = np.asarray(vectors, dtype=np.float64), np.asarray(actions)
        if table.shape != (len(first), len(state.model.group_states(group))) or not np.isfinite(table).all():
            raise ValueError(
                "the vectors do not fit the states of the group or the actions, or are not finite"
            )
        for vector, action in zip(table, [self._check_action(a) for a in first.tolist()], strict=True):
            state.dependencies.record_imported_vector(state.next_vector)
            own.add(vector, action, state.next_vector)
            state.next_vector += 1

    def add_points(
        self, begins: npt.NDArray[np.int64], states: npt.NDArray[np.int32], weights: Array, values: Array
    ) -> None:
        if len(begins) != len(values) + 1 or begins[0] != 0 or not begins[-1] == len(states) == len(weights):
            raise ValueError("the arrays of the points do not fit together")
        if not np.isfinite(values).all():
            raise ValueError("the value of a point is not finite")
        beliefs = [
            self._state.model.make_sparse_belief(
                np.asarray(states)[begin:end], np.asarray(weights)[begin:end]
            )
            for begin, end in pairwise(np.asarray(begins).tolist())
        ]
        for belief, value in zip(beliefs, np.asarray(values, dtype=np.float64).tolist(), strict=True):
            self._state.sawtooth.add(belief, value)

    def node(self, number: int) -> BeliefNode:
        """Return the node of a number, for the other kernels."""
        if not 0 <= number < len(self._state.nodes):
            raise IndexError("unknown node")
        return self._state.nodes[number]

    def _check_action(self, action: int) -> int:
        if not 0 <= action < self._state.model.actions:
            raise IndexError("unknown action")
        return action

    def _check_group(self, group: int) -> int:
        if not 0 <= group < len(self._state.sets):
            raise IndexError("unknown group")
        return group


class ValuePredictor:
    """`kernel_protocols.ValuePredictor` in numpy, for selective deep sampling.

    The prediction is the mean lower bound of similar beliefs: those with the same bins of initial upper bound
    and entropy (section III-B).
    """

    def __init__(self, corners: Array) -> None:
        values = np.asarray(corners, dtype=np.float64)
        if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
            raise ValueError("expected at least one corner, and finite corners")
        self._lowest = float(values.min())
        self._range = max(float(values.max()) - self._lowest, 1e-300)
        self._sum = np.zeros((PREDICTOR_BINS, PREDICTOR_BINS))
        self._count = np.zeros((PREDICTOR_BINS, PREDICTOR_BINS))

    def learn(self, tree: Tree, node: int) -> None:
        own = self._find_bin(tree, node)
        self._sum[own] += tree.cached_lower(node)
        self._count[own] += 1

    def predict(self, tree: Tree, node: int) -> float:
        own = self._find_bin(tree, node)
        return float(self._sum[own] / self._count[own]) if self._count[own] else tree.cached_upper(node)

    def _find_bin(self, tree: Tree, number: int) -> tuple[int, int]:
        node = tree.node(number)
        level = (node.informed_value - self._lowest) / self._range * PREDICTOR_BINS
        return int(min(max(level, 0.0), PREDICTOR_BINS - 1.0)), node.entropy_bin
