"""The contract of the kernels: C++ (`lcorpp.planning._native`) and numpy (`numpy_kernels`) both satisfy it.

The objects of one implementation work only with each other, so arguments of these types are `Any` here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from lcorpp.planning.sparse import Int32Array
from lcorpp.values import Array, Belief

PointArrays = tuple[npt.NDArray[np.int64], npt.NDArray[np.int32], Array, Array]
"""K points: begins (K + 1,), states and weights (entries,), values (K,). Point k is a belief with the states
and weights from begins[k] to before begins[k + 1], and an upper bound on the value at that belief."""


class Model(Protocol):
    """The problem in the form of the kernels; `kernels.build_model` makes it."""

    def export_blocks(self) -> Int32Array:
        """Return (S,) the block of each state; after an action and an observation a belief lies in one."""


class ValuePredictor(Protocol):
    """Predicts the value of a node from other nodes."""

    def learn(self, tree: Any, node: int) -> None:
        """Add the lower bound of a visited node."""

    def predict(self, tree: Any, node: int) -> float:
        """Predict the value of a node."""


class Tree(Protocol):
    """Beliefs, numbered in order of creation, and the two bounds they share.

    One thread at a time: the compiled tree releases the interpreter lock, and other threads must not use the
    same tree meanwhile. A group is a block of the model, or the last one, for beliefs over several blocks.

    Raises:
        IndexError: a node, action, child or group does not exist.
        ValueError, TypeError: an array has a wrong shape or type, or a number is invalid.
    """

    @property
    def discount(self) -> float:
        """gamma."""

    @property
    def node_count(self) -> int:
        """The number of beliefs."""

    @property
    def vector_count(self) -> int:
        """The number of alpha vectors in all groups."""

    @property
    def made_count(self) -> int:
        """The number of alpha vectors that were ever made, by backups or otherwise."""

    @property
    def point_count(self) -> int:
        """The number of points of the upper bound."""

    @property
    def node_memory(self) -> int:
        """Memory of the beliefs and of what is stored about them, in bytes."""

    @property
    def bound_memory(self) -> int:
        """Memory of the alpha vectors and points, in bytes."""

    @property
    def group_count(self) -> int:
        """The number of groups."""

    def clear_nodes(self) -> None:
        """Remove all nodes, but keep the vectors and points."""

    def drop_older_points(self) -> None:
        """Remove the older half of the points: those that no backup has lowered for the longest time."""

    def find_or_add_node(self, belief: Belief) -> int:
        """Return the node of a belief (S,), created if necessary."""

    def find_or_add_child(self, node: int, action: int, child: int) -> int:
        """Return the node of a child, given by its index in `children`, created if necessary."""

    def refresh(self, node: int) -> None:
        """Update the bounds of a node with the vectors and points since its last visit."""

    def select_action(self, node: int, use_lower_bound: bool) -> int:
        """Return the best action by the upper or lower bound, after an update of that action's bounds."""

    def backup(self, node: int) -> None:
        """Add the best alpha vector at a node and lower the upper bound there."""

    def sample(
        self,
        predictor: Any,
        root: int,
        target: float,
        max_depth: int,
        seconds: float,
        use_lower_bound: bool,
    ) -> int:
        """Sample a path and back up its nodes; return their number. See path_sampling.py."""

    def prune(self, roots: Sequence[int], radius: float, max_ratio: float, growth: float) -> None:
        """Keep the vectors that are best, or nearly best, at a belief that the roots may reach."""

    def compress(self, roots: Sequence[int], max_evaluations: float, seconds: float) -> bool:
        """Replace the vectors by those of a smaller controller if the bounds at the roots stay as good.

        The pruned vectors that others depend on are mostly older versions of plans. Where a vector of the set
        is no worse for the states in which the plans of the roots reach such a version, it replaces it. Plans
        may then lead back to themselves, so all values are computed anew.

        Args:
            max_evaluations: about as many vectors are computed at most; nothing is replaced if the values
                are not accurate then.
            seconds: wall-clock time limit; afterwards nothing is replaced.

        Returns:
            Whether the vectors were replaced.

        Sources: Hansen, "Solving POMDPs by searching in policy space", UAI 1998; Grzes, Poupart, Yang and
        Hoey, "Energy efficient execution of POMDP policies", IEEE Transactions on Cybernetics 2015.
        """

    def lower_bound(self, node: int) -> float:
        """Return the value of the best alpha vector at a node, of all current vectors."""

    def upper_bound(self, node: int) -> float:
        """Return the upper bound at a node by all current points, or the node's own if that is smaller."""

    def cached_lower(self, node: int) -> float:
        """Return the lower bound of a node at its last update."""

    def cached_upper(self, node: int) -> float:
        """Return the upper bound of a node at its last update."""

    def q_lower(self, node: int) -> Array:
        """Return (A,) lower bounds on the values of the actions, at their last update."""

    def q_upper(self, node: int) -> Array:
        """Return (A,) upper bounds on the values of the actions, at their last update."""

    def expected_rewards(self, node: int) -> Array:
        """Return (A,) expected rewards of the actions."""

    def belief(self, node: int) -> Belief:
        """Return (S,) the belief of a node."""

    def children(self, node: int, action: int) -> tuple[Int32Array, Array, Array, Array, Int32Array]:
        """Return five arrays (n,): each child's observation, probability, bounds times probability, and node.

        The node is -1 before the first visit. There are no children before the first update of the action.
        """

    def vectors(self, group: int, with_pruned: bool = False) -> tuple[Int32Array, Array, Int32Array]:
        """Return the states (n,) of a group, its alpha vectors (K, n) and their plans' first actions (K,).

        Args:
            with_pruned: whether the pruned vectors that others depend on follow.
        """

    def points(self) -> tuple[Array, *PointArrays]:
        """Return the upper bound: corners (S,), and begins, states, weights and values of the points."""

    def add_vectors(self, group: int, vectors: Array, actions: Int32Array) -> None:
        """Import alpha vectors (K, n) over the states of a group, and the first actions (K,) of their
        plans."""

    def add_points(
        self, begins: npt.NDArray[np.int64], states: Int32Array, weights: Array, values: Array
    ) -> None:
        """Import points in the form of `points`."""


class Kernels(Protocol):
    """The classes and functions of an implementation.

    The functions iterate until the result is within a tolerance, in reward units, or until wall-clock seconds
    are over. They raise a ValueError if one of these is NaN, or the tolerance negative.
    """

    @property
    def Model(self) -> Callable[..., Model]:
        """Made by `kernels.build_model`."""

    @property
    def Tree(self) -> Callable[..., Tree]:
        """Tree(model, informed, blind): (A, S) Q values that are upper bounds, (A, S) of blind policies."""

    @property
    def ValuePredictor(self) -> Callable[[Array], ValuePredictor]:
        """ValuePredictor(corners): (S,) the initial upper bound at the beliefs that know the state."""

    @property
    def find_reachable_blocks(self) -> Callable[[Any, npt.NDArray[np.int64], Int32Array], Int32Array]:
        """(model, begins, states) -> (S,) the block of each state that the starts reach, -1 for others.

        It is the finest partition such that every action and observation lead from a belief within a block,
        or within the support of a start, to one within a block. Start k has the states from begins[k] to
        before begins[k + 1]; those over several blocks count as one, because they share their vectors.

        Source: Hopcroft and Karp, "A linear algorithm for testing equivalence of finite automata", 1971.
        """

    @property
    def blind_policies(self) -> Callable[[Any, float, float], Array]:
        """(model, tolerance, seconds) -> (A, S) lower bounds on the value of repeating one action forever."""

    @property
    def mdp_bound(self) -> Callable[[Any, float, float], Array]:
        """(model, tolerance, seconds) -> (A, S) upper bounds on the Q values if the state were observed."""

    @property
    def fast_informed_bound(self) -> Callable[[Any, Array, float, float], Array]:
        """(model, Q, tolerance, seconds) -> (A, S) tighter upper bounds than the Q values (A, S)."""
