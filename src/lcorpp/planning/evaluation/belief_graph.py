"""The beliefs that a policy meets, each worked out once: what it does there and where that leads."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.errors import ObservationError
from lcorpp.planning.belief import MIN_PROBABILITY, describe
from lcorpp.planning.evaluation.absorbing import self_loop_observation_class
from lcorpp.planning.evaluation.batch_policy import BatchPolicy
from lcorpp.planning.evaluation.sparse_beliefs import Indices, SparseBeliefs
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array

UNKNOWN = -1
"""Stands for a child that nobody has asked for."""


class Children(NamedTuple):
    """All that may follow some nodes, in their order and then that of the observations.

    owner: (k,) the node. observation: (k,). probability: (k,) positive. child: (k,) the node that follows.
    """

    owner: Indices
    observation: Indices
    probability: Array
    child: Indices


class BeliefGraph:
    """Nodes are beliefs that a policy meets; nodes with the same belief are one.

    Beliefs have 40 binary digits (`SparseBeliefs.rounded`) and depend on the parent's belief, the action and
    the observation only: the results at a node depend neither on the path to it nor on the order of visits.
    """

    def __init__(self, pomdp: Pomdp, policy: Policy, batch: BatchPolicy | None = None) -> None:
        self.pomdp, self.policy = pomdp, policy
        self._batch = batch or BatchPolicy(policy)
        self._known: dict[bytes, int] = {}
        self._count = 0
        self._begins = np.zeros(65, dtype=np.int64)
        self._states = np.zeros(256, dtype=np.int32)
        self._weights = np.zeros(256)
        self._children = np.full((64, len(pomdp.observations)), UNKNOWN, dtype=np.int32)
        self._actions = np.zeros(64, dtype=np.int32)
        self._vectors = np.zeros(64, dtype=np.intp)
        self._values = np.zeros(64)
        self._over = np.zeros(64, dtype=bool)
        self._branching = branching(pomdp.transition) * branching(pomdp.observation)
        self._shows = self_loop_observation_class(pomdp)

    def __len__(self) -> int:
        return self._count

    @property
    def actions(self) -> npt.NDArray[np.int32]:
        """(n,) what the policy does at each node."""
        return self._actions[: self._count]

    @property
    def vectors(self) -> Indices:
        """(n,) the number of the policy's best vector at each node."""
        return self._vectors[: self._count]

    @property
    def values(self) -> Array:
        """(n,) what the best vector says of each node."""
        return self._values[: self._count]

    @property
    def over(self) -> npt.NDArray[np.bool_]:
        """(n,) whether nothing is paid from a node on: each state of the belief stays where it is under the
        action and unpaid, and shows the same observations as the others do."""
        return self._over[: self._count]

    @property
    def beliefs(self) -> SparseBeliefs:
        """The beliefs of all nodes."""
        end = int(self._begins[self._count])
        return SparseBeliefs(self._begins[: self._count + 1], self._states[:end], self._weights[:end])

    @property
    def size(self) -> int:
        """Numbers kept: of beliefs and of children."""
        return int(self._begins[self._count]) + self._count * self._children.shape[1]

    def add(self, beliefs: SparseBeliefs) -> Indices:
        """The nodes (k,) of some beliefs, which need not add up to 1."""
        return self._add(beliefs.rounded())

    def _add(self, rounded: SparseBeliefs) -> Indices:
        nodes = np.zeros(len(rounded), dtype=np.intp)
        known, number, new = self._known, self._count, []
        for i, key in enumerate(rounded.keys()):
            node = known.setdefault(key, number)
            if node == number:
                number += 1
                new.append(i)
            nodes[i] = node
        if new:
            self._keep(rounded.take(np.array(new)) if len(new) < len(rounded) else rounded)
        return nodes

    def _keep(self, beliefs: SparseBeliefs) -> None:
        begin, end = self._count, self._count + len(beliefs)
        entry, last = int(self._begins[begin]), int(self._begins[begin] + beliefs.begins[-1])
        self._begins = _roomy(self._begins, end + 1)
        self._states, self._weights = _roomy(self._states, last), _roomy(self._weights, last)
        self._children = _roomy(self._children, end, UNKNOWN)
        for name in ("_actions", "_vectors", "_values", "_over"):
            setattr(self, name, _roomy(getattr(self, name), end))
        self._begins[begin + 1 : end + 1] = entry + beliefs.begins[1:]
        self._states[entry:last] = beliefs.states
        self._weights[entry:last] = beliefs.weights
        self._values[begin:end], self._vectors[begin:end] = self._batch.best(beliefs)
        self._actions[begin:end] = self.policy.actions[self._vectors[begin:end]]
        shows = self._shows[self._actions[begin:end][beliefs.owners], beliefs.states]
        least = np.minimum.reduceat(shows, beliefs.begins[:-1])
        self._over[begin:end] = (least >= 0) & (least == np.maximum.reduceat(shows, beliefs.begins[:-1]))
        self._count = end

    def follow(self, nodes: Indices, observations: npt.NDArray[np.integer]) -> Indices:
        """The nodes (k,) that observations (k,) lead to; those not met before are worked out.

        Raises:
            ObservationError: an observation is impossible; belief, action and observation are named.
        """
        width = self._children.shape[1]
        keys = nodes * width + observations
        found = self._children.reshape(-1)[keys].astype(np.intp)
        if len(found) and found.min() == UNKNOWN:
            asked = np.unique(keys[found == UNKNOWN])
            owner, observation = np.divmod(asked, width)
            self._children[owner, observation] = self._worked_out(owner, observation)
            found = self._children.reshape(-1)[keys].astype(np.intp)
        return found

    def _worked_out(self, owner: Indices, observation: Indices) -> Indices:
        beliefs, actions = self.beliefs.take(owner), self._actions[owner]
        nodes = np.zeros(len(owner), dtype=np.intp)
        for run in beliefs.chunks(self._branching):
            part = beliefs.take(np.arange(run.start, run.stop))
            seen = part.predict(self.pomdp, actions[run]).condition(
                self.pomdp, actions[run], observation[run]
            )
            impossible = np.flatnonzero(seen.totals() < MIN_PROBABILITY)
            if len(impossible):
                i = run.start + int(impossible[0])
                raise self._impossible(int(owner[i]), int(observation[i]))
            nodes[run] = self.add(seen)
        return nodes

    def _impossible(self, node: int, observation: int) -> ObservationError:
        pomdp = self.pomdp
        belief = self.beliefs.belief(node, len(pomdp.states))
        return ObservationError(
            f"observation {pomdp.observations[observation]!r} is impossible after action"
            f" {pomdp.actions[self._actions[node]]!r} in belief {describe(pomdp, belief)}"
        )

    def expand(self, nodes: Indices) -> Children:
        """All children of some nodes; observations without digits of probability are left out."""
        found = []
        beliefs = self.beliefs.take(nodes)
        for run in beliefs.chunks(self._branching):
            actions = self._actions[nodes[run]]
            spread = beliefs.take(np.arange(run.start, run.stop)).predict(self.pomdp, actions)
            owner, observation, parts = spread.posteriors(self.pomdp, actions)
            chance = parts.totals() / spread.totals()[owner]
            likely = np.flatnonzero(chance >= MIN_PROBABILITY)
            parts = parts if len(likely) == len(chance) else parts.take(likely)
            child = self.add(parts)
            owner, observation = nodes[run][owner[likely]], observation[likely]
            self._children[owner, observation] = child
            found.append(Children(owner, observation, chance[likely], child))
        return Children(*(np.concatenate(kind) for kind in zip(*found, strict=True)))

    def rewards(self, nodes: Indices) -> Array:
        """(k,) the mean reward of what is done at some nodes."""
        beliefs = self.beliefs.take(nodes)
        owners = beliefs.owners
        paid = self.pomdp.reward[self._actions[nodes][owners], beliefs.states]
        return beliefs.average(paid)

    def empty_copy(self) -> BeliefGraph:
        """A graph of the same policy that knows no belief."""
        return BeliefGraph(self.pomdp, self.policy, self._batch)

    def import_nodes(self, other: BeliefGraph, nodes: Indices) -> Indices:
        """The nodes (k,) here of the beliefs of some nodes (k,) of another graph of the same policy."""
        met, place = np.unique(nodes, return_inverse=True)
        return self._add(other.beliefs.take(met))[place]


def _roomy(array: npt.NDArray[Any], length: int, fill: int = 0) -> npt.NDArray[Any]:
    """The array itself where it has the length, otherwise one of twice that with the same beginning."""
    if len(array) >= length:
        return array
    larger = np.full((2 * length, *array.shape[1:]), fill, dtype=array.dtype)
    larger[: len(array)] = array
    return larger


def branching(table: SparseTables) -> int:
    """How many entries a row of a table has, on average and at least 1."""
    return max(1, len(table.values) // (len(table.begins) - 1))
