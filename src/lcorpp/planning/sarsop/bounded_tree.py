"""The belief tree with two bounds, in which SARSOP, Perseus and the online planner search."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from lcorpp.planning._native import (
    Model,
    Tree,
    ValuePredictor,
    blind_policies,
    fast_informed_bound,
    mdp_bound,
)
from lcorpp.planning.policy import AlphaVectors, Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.kernel_model import build_model
from lcorpp.planning.sarsop.reachable_blocks import ReachableBlocks
from lcorpp.planning.upper_bounds import SawtoothBound
from lcorpp.values import Belief

if TYPE_CHECKING:
    from lcorpp.planning.sarsop.hidden_values import HiddenBounds


class BoundedTree:
    """A belief tree of a problem with a lower and an upper bound, for one or more searches.

    Args:
        starts: beliefs (S,) from which all searches start, or whose mixtures they start from.
        precision: of the searches, in reward units.
        seconds: wall-clock time limit of each of the three initial bounds.
        previous: a policy for the same model whose vectors and points are imported.

    tree: the nodes and bounds. predictor: of the values of nodes. informed: (A, S) the fast informed bound.
    max_abs_value: the largest absolute initial bound, at least 1: the unit of rounding errors.
    """

    def __init__(
        self,
        pomdp: Pomdp,
        starts: Sequence[Belief],
        *,
        precision: float,
        seconds: float,
        previous: Policy | None = None,
    ) -> None:
        self.pomdp = pomdp
        self._model, self._blocks = self._own = self._build_model(starts)
        self._blind = blind_policies(self._model, 1e-3 * precision, seconds)
        upper = previous.upper_bound if previous else None
        if isinstance(upper, SawtoothBound):
            self.informed = upper.informed
        else:
            mdp = mdp_bound(self._model, 1e-3 * precision, seconds)
            self.informed = fast_informed_bound(self._model, mdp, 1e-2 * precision, seconds)
        self.max_abs_value = max(1.0, float(np.abs(self._blind).max()), float(np.abs(self.informed).max()))
        self.predictor = ValuePredictor(self.informed.max(axis=0))
        self._hidden: HiddenBounds | None = None
        self.tree = self._make_tree(previous)

    @property
    def memory_size(self) -> int:
        """Bytes of the problem and of the nodes, vectors and points.

        The problem is in memory twice, for Python and for the kernels; a policy copies vectors and points.
        """
        own = self.tree.node_memory + self.tree.graph_memory + 2 * self.tree.bound_memory
        return 2 * self.pomdp.memory_size + own

    @property
    def has_graph(self) -> bool | None:
        """Whether the tree has a graph of beliefs; None before `sharpen`."""
        return None if self._hidden is None else self._hidden.found

    def sharpen(self, starts: Sequence[Belief], *, seconds: float) -> None:
        """Add what `hidden_values` finds about the problem.

        Args:
            starts: beliefs (S,) at which the upper bound shall be low.
            seconds: time for which the limits of its work are set.
        """
        from lcorpp.planning.sarsop.hidden_values import find_hidden_values

        self._hidden = find_hidden_values(self.pomdp, self._model, starts, seconds)
        self._hidden.apply(self.tree)

    def restart(self, policy: Policy | None) -> None:
        """Replace all that a search has changed, by the vectors and points of a policy."""
        self._model, self._blocks = self._own
        self.predictor = ValuePredictor(self.informed.max(axis=0))
        self.tree = self._make_tree(policy)

    def include(self, start: Belief) -> None:
        """Allow searches from another start (S,), which may remove all nodes."""
        if self._blocks is not None and not self._blocks.cover(start):
            policy = self.make_policy()
            self._model, self._blocks = self._build_model([start])
            self.tree = self._make_tree(policy)

    def add_points(self, nodes: Iterable[int]) -> None:
        """Add the upper bounds of nodes, often below the interpolation of the points, to the points."""
        for node in nodes:
            belief = self.tree.belief(node)
            states = np.flatnonzero(belief).astype(np.int32)
            value = np.array([self.tree.upper_bound(node)])
            self.tree.add_points(np.array([0, len(states)]), states, belief[states], value)

    def make_policy(self, nodes: Sequence[int] = ()) -> Policy:
        """Return the policy of the alpha vectors, with its upper bound, also at the beliefs of some nodes."""
        tree, sets = self.tree, []
        for group in range(tree.group_count):
            # without the pruned vectors that others depend on, the policy could earn less than it promises
            states, table, actions = tree.vectors(group, with_pruned=True)
            if not len(actions):
                continue
            table.setflags(write=False)  # so that the policy takes it without a copy
            parts, is_last = [states.astype(np.intp)], group == tree.group_count - 1
            if self._blocks is not None and is_last:  # valid only for beliefs that the starts reach
                parts = self._blocks.find_spread_sets(self._model)
            for part in parts:
                values = table if len(part) == len(states) else table[:, part]
                sets.append(AlphaVectors(part, values, actions.astype(np.intp)))
        return Policy.of_sets(self.pomdp, sets, self._make_upper_bound(nodes))

    def _make_upper_bound(self, nodes: Sequence[int]) -> SawtoothBound:
        """Return the bound by the points of the tree, and by one at the belief of each node.

        The points of the tree are at beliefs in normal form, see `native/sarsop/graph/renamings.hpp`.
        """
        corners, begins, states, weights, values = self.tree.points()
        beliefs = [self.tree.belief(node) for node in nodes]
        supports = [np.flatnonzero(belief).astype(np.int32) for belief in beliefs]
        ends = begins[-1] + np.cumsum([len(support) for support in supports], dtype=np.int64)
        own = [belief[support] for belief, support in zip(beliefs, supports, strict=True)]
        own_values = np.array([self.tree.upper_bound(node) for node in nodes])
        begins, states = np.concatenate([begins, ends]), np.concatenate([states, *supports])
        weights, values = np.concatenate([weights, *own]), np.concatenate([values, own_values])
        for array in (corners, begins, states, weights, values):
            array.setflags(write=False)  # so that the bound takes it without a copy
        return SawtoothBound(self.informed, corners, begins, states, weights, values)

    def _build_model(self, starts: Sequence[Belief]) -> tuple[Model, ReachableBlocks | None]:
        """Return the problem for the kernels, and the blocks of its states if they depend on the starts."""
        model = build_model(self.pomdp)
        blocks = ReachableBlocks.find(model, starts)
        if blocks is None:
            return model, None
        del model  # a large model is in memory only once
        return build_model(self.pomdp, blocks.refine(self.pomdp.observation)), blocks

    def _make_tree(self, previous: Policy | None) -> Tree:
        """Return a tree without nodes, with the vectors and points of an earlier policy.

        A group takes the vectors over sets that contain its states. A group without vectors is never used:
        the model has a single block, and its beliefs are in that.
        """
        tree = Tree(self._model, self.informed, self._blind)
        if self._hidden is not None:
            self._hidden.apply(tree)
        if previous is None:
            return tree
        groups = [(group, *tree.vectors(group)[::2]) for group in range(tree.group_count)]
        position = np.empty(len(self.pomdp.states), dtype=np.intp)
        for vectors in previous.vector_sets:
            position[:] = -1
            position[vectors.states] = np.arange(len(vectors.states))
            for group, states, actions in groups:
                if len(actions) and position[states[0]] >= 0 and (columns := position[states]).min() >= 0:
                    tree.add_vectors(group, vectors.vectors[:, columns], vectors.actions.astype(np.int32))
        if isinstance(previous.upper_bound, SawtoothBound):
            tree.add_points(*previous.upper_bound.points())
        return tree
