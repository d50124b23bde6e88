"""The graph of the beliefs that a policy reaches; each belief is computed once."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.planning.belief import make_impossible_error
from lcorpp.planning.evaluation.batch_policy import batch_policy
from lcorpp.planning.evaluation.mdp import find_self_loop_classes
from lcorpp.planning.evaluation.sparse_beliefs import SparseBeliefs
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array, Indices
from lcorpp.values.probabilities import MIN_NORMAL

UNKNOWN = -1
"""The index of a child that is not computed yet."""

INITIAL_NODES, INITIAL_ENTRIES = 64, 256
"""Lengths of the arrays of an empty graph; they grow with the graph."""

BYTES_PER_KEY = 200
"""Memory of one entry of the dictionary of beliefs."""


class Children(NamedTuple):
    """All children of some nodes, by node and then by observation.

    parent: (k,) the node before. observation: (k,). probability: (k,) positive. child: (k,) the node after.
    """

    parent: Indices
    observation: Indices
    probability: Array
    child: Indices


class BeliefGraph:
    """A graph whose nodes are the distinct beliefs that a policy reaches.

    The weights of beliefs are rounded to 40 bits (`SparseBeliefs.round_weights`) and depend on the parent's
    belief, the action and the observation only: the results at a node depend neither on the path to it nor
    on the order of visits.
    """

    def __init__(self, pomdp: Pomdp, policy: Policy) -> None:
        self.pomdp, self.policy = pomdp, policy
        self._batch = batch_policy(policy)
        self._node_of_key: dict[bytes, int] = {}
        self._count = 0
        # the arrays are longer than needed: the first len(self) nodes are used
        self._begins = np.zeros(INITIAL_NODES + 1, dtype=np.int64)
        self._states = np.zeros(INITIAL_ENTRIES, dtype=np.int32)
        self._weights = np.zeros(INITIAL_ENTRIES)
        self._children = np.full((INITIAL_NODES, len(pomdp.observations)), UNKNOWN, dtype=np.int32)
        self._actions = np.zeros(INITIAL_NODES, dtype=np.int32)
        self._vector_indices = np.zeros(INITIAL_NODES, dtype=np.intp)
        self._values = np.zeros(INITIAL_NODES)
        self._absorbing = np.zeros(INITIAL_NODES, dtype=bool)
        self._branching = mean_row_size(pomdp.transition) * mean_row_size(pomdp.observation)
        self._loop_classes = find_self_loop_classes(pomdp)

    def __len__(self) -> int:
        return self._count

    def __repr__(self) -> str:
        return f"<BeliefGraph: {len(self)} beliefs>"

    @property
    def actions(self) -> npt.NDArray[np.int32]:
        """(n,) the policy's action at each node."""
        return self._actions[: self._count]

    @property
    def vector_indices(self) -> Indices:
        """(n,) the index of the policy's best vector at each node."""
        return self._vector_indices[: self._count]

    @property
    def values(self) -> Array:
        """(n,) the value of the best vector at each node."""
        return self._values[: self._count]

    @property
    def absorbing(self) -> npt.NDArray[np.bool_]:
        """(n,) whether the belief never changes again, with zero reward.

        This holds if all states of the belief have one self-loop class >= 0 (`find_self_loop_classes`).
        """
        return self._absorbing[: self._count]

    @property
    def children(self) -> npt.NDArray[np.int32]:
        """(n, O) the node after each observation, `UNKNOWN` if it is not computed or impossible."""
        return self._children[: self._count]

    @property
    def beliefs(self) -> SparseBeliefs:
        """The beliefs of all nodes."""
        end = int(self._begins[self._count])
        return SparseBeliefs(self._begins[: self._count + 1], self._states[:end], self._weights[:end])

    @property
    def memory_size(self) -> int:
        """Bytes of the arrays and of the table of nodes."""
        arrays = (
            self._begins, self._states, self._weights, self._children,
            self._actions, self._vector_indices, self._values, self._absorbing,
        )  # fmt: skip
        return sum(array.nbytes for array in arrays) + BYTES_PER_KEY * self._count

    @property
    def expansion_products(self) -> int:
        """Estimated number of products of a vector entry and a belief entry to expand one node."""
        entries = max(1, int(self._begins[self._count]) // max(1, self._count))
        return len(self.policy) * entries * self._children.shape[1]

    def add(self, beliefs: SparseBeliefs) -> Indices:
        """Return the nodes (k,) of beliefs, which need not be normalised; new beliefs become nodes."""
        return self._add_rounded(beliefs.round_weights())

    def _add_rounded(self, rounded: SparseBeliefs) -> Indices:
        """Return the nodes (k,) of beliefs with rounded weights."""
        nodes = np.zeros(len(rounded), dtype=np.intp)
        known, number, new = self._node_of_key, self._count, []
        for i, key in enumerate(rounded.keys()):
            node = known.setdefault(key, number)
            if node == number:
                number += 1
                new.append(i)
            nodes[i] = node
        if new:
            self._append(rounded.take(np.array(new)) if len(new) < len(rounded) else rounded)
        return nodes

    def _append(self, beliefs: SparseBeliefs) -> None:
        """Append new nodes; their numbers follow those of the other nodes."""
        begin, end = self._count, self._count + len(beliefs)
        entry, last = int(self._begins[begin]), int(self._begins[begin] + beliefs.begins[-1])
        self._begins = _grow(self._begins, end + 1)
        self._states, self._weights = _grow(self._states, last), _grow(self._weights, last)
        self._children = _grow(self._children, end, UNKNOWN)
        for name in ("_actions", "_vector_indices", "_values", "_absorbing"):
            setattr(self, name, _grow(getattr(self, name), end))
        self._begins[begin + 1 : end + 1] = entry + beliefs.begins[1:]
        self._states[entry:last] = beliefs.states
        self._weights[entry:last] = beliefs.weights
        self._values[begin:end], self._vector_indices[begin:end] = self._batch.best(beliefs)
        self._actions[begin:end] = self.policy.actions[self._vector_indices[begin:end]]
        # the classes of the states of a belief are equal if the lowest is the highest
        classes = self._loop_classes[self._actions[begin:end][beliefs.owners], beliefs.states]
        low = np.minimum.reduceat(classes, beliefs.begins[:-1])
        self._absorbing[begin:end] = (low >= 0) & (low == np.maximum.reduceat(classes, beliefs.begins[:-1]))
        self._count = end

    def follow(self, nodes: Indices, observations: npt.NDArray[np.integer]) -> Indices:
        """Return the nodes (k,) after observations (k,), computing those that are new.

        Raises:
            ObservationError: an observation is impossible; the message names belief, action and observation.
        """
        width = self._children.shape[1]
        keys = nodes * width + observations
        children = self._children.reshape(-1)[keys].astype(np.intp)
        if len(children) and children.min() == UNKNOWN:
            parent, observation = np.divmod(np.unique(keys[children == UNKNOWN]), width)
            self._children[parent, observation] = self._compute_children(parent, observation)
            children = self._children.reshape(-1)[keys].astype(np.intp)
        return children

    def _compute_children(self, parent: Indices, observation: Indices) -> Indices:
        """Return (k,) the nodes after nodes (k,) and observations (k,)."""
        beliefs, actions = self.beliefs.take(parent), self._actions[parent]
        nodes = np.zeros(len(parent), dtype=np.intp)
        for chunk in beliefs.chunks(self._branching):
            predicted = beliefs.take(np.arange(chunk.start, chunk.stop)).predict(self.pomdp, actions[chunk])
            posterior = predicted.condition(self.pomdp, actions[chunk], observation[chunk])
            impossible = np.flatnonzero(posterior.totals() < MIN_NORMAL)
            if len(impossible):
                i = chunk.start + int(impossible[0])
                belief = beliefs.dense(i, len(self.pomdp.states))
                raise make_impossible_error(self.pomdp, belief, int(actions[i]), int(observation[i]))
            nodes[chunk] = self.add(posterior)
        return nodes

    def expand(self, nodes: Indices) -> Children:
        """Return all children of nodes (k,), at least one, without observations below `MIN_NORMAL`."""
        parts = []
        beliefs = self.beliefs.take(nodes)
        for chunk in beliefs.chunks(self._branching):
            actions = self._actions[nodes[chunk]]
            predicted = beliefs.take(np.arange(chunk.start, chunk.stop)).predict(self.pomdp, actions)
            position, observation, posterior = predicted.posteriors(self.pomdp, actions)
            probability = posterior.totals() / predicted.totals()[position]
            likely = np.flatnonzero(probability >= MIN_NORMAL)
            posterior = posterior if len(likely) == len(probability) else posterior.take(likely)
            child = self.add(posterior)
            parent, observation = nodes[chunk][position[likely]], observation[likely]
            self._children[parent, observation] = child
            parts.append(Children(parent, observation, probability[likely], child))
        return Children(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def rewards(self, nodes: Indices) -> Array:
        """Return (k,) the expected reward of the policy's action at nodes (k,)."""
        beliefs = self.beliefs.take(nodes)
        owners = beliefs.owners
        return beliefs.average(self.pomdp.reward[self._actions[nodes][owners], beliefs.states])

    def empty_copy(self) -> BeliefGraph:
        """Return a graph of the same policy without nodes."""
        return BeliefGraph(self.pomdp, self.policy)

    def import_nodes(self, other: BeliefGraph, nodes: Indices) -> Indices:
        """Add nodes (k,) of another graph of the same policy; return their nodes (k,) here."""
        distinct, inverse = np.unique(nodes, return_inverse=True)
        return self._add_rounded(other.beliefs.take(distinct))[inverse]


def _grow(array: npt.NDArray[Any], length: int, fill: int = 0) -> npt.NDArray[Any]:
    """Return the array itself if it is long enough, otherwise a copy of twice the length."""
    if len(array) >= length:
        return array
    larger = np.full((2 * length, *array.shape[1:]), fill, dtype=array.dtype)
    larger[: len(array)] = array
    return larger


def mean_row_size(table: SparseTables) -> int:
    """Return the mean number of entries of a row, at least 1."""
    return max(1, len(table.values) // (len(table.begins) - 1))
