"""The belief tree and the two bounds its nodes share: what the search sees of the engine.

Source: Kurniawati, Hsu and Lee, RSS 2008, sections III and IV.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import isnan, log

import numpy as np
import numpy.typing as npt

from lcorpp.planning.sarsop.numpy_kernels.alpha_vectors import VectorSet
from lcorpp.planning.sarsop.numpy_kernels.backup import backup
from lcorpp.planning.sarsop.numpy_kernels.bounds import checked_table
from lcorpp.planning.sarsop.numpy_kernels.dependencies import Origins
from lcorpp.planning.sarsop.numpy_kernels.model import Beliefs, Model
from lcorpp.planning.sarsop.numpy_kernels.node import Node
from lcorpp.planning.sarsop.numpy_kernels.prediction import BINS, Prediction
from lcorpp.planning.sarsop.numpy_kernels.pruning import prune
from lcorpp.planning.sarsop.numpy_kernels.refresh import look, open_branch, refresh, witness
from lcorpp.planning.sarsop.numpy_kernels.sawtooth import Sawtooth
from lcorpp.planning.sarsop.sampling import trial
from lcorpp.values import Array, Belief

ALIKE = 1e10
"""Beliefs that agree to 1 / ALIKE share a node."""

ROOM = 1 << 25
"""Numbers of outcomes that are kept with their nodes; beyond, they are worked out anew."""

Points = tuple[npt.NDArray[np.int64], npt.NDArray[np.int32], Array, Array]


class Tree:
    """All nodes, numbered as they were made, with the alpha vectors and the points they share.

    A belief that is reached in two ways is one node.

    model: the problem. nodes: by number. sets: the vectors of each group. sawtooth: the upper bound.
    scale: the largest value in the model, what rounding is measured by.
    next_vector: the next vector's stamp. origins_of: what the vectors go on with.
    kept: by group, how many vectors the last pruning left.
    room: how many numbers of outcomes may still be kept.

    Raises:
        IndexError: there is no such node, action, child or group.
        ValueError: an array has another shape, or numbers that cannot be.
    """

    def __init__(self, model: Model, informed: Array, blind: Array) -> None:
        """
        Args:
            informed: (A, S) Q values above the truth.
            blind: (A, S) the value of each action done for ever.
        """
        informed, blind = checked_table(model, informed), checked_table(model, blind)
        self.model, self.sawtooth = model, Sawtooth(model, informed)
        self.scale = max(1.0, float(np.abs(blind).max()), float(np.abs(informed).max()))
        self.nodes: list[Node] = []
        self.sets = [VectorSet(len(model.states_of(g))) for g in range(len(model.members) + 1)]
        # one block: no belief is over several, and the set for those stays empty
        for g in range(len(self.sets) if len(model.members) > 1 else 1):
            for a in range(model.actions):
                self.sets[g].add(blind[a, model.states_of(g)], a, a)
        self.next_vector = model.actions
        self.origins_of = Origins(model.actions)
        self.kept = [vectors.count for vectors in self.sets]
        self.room = ROOM
        self._known: dict[tuple[bytes, bytes], int] = {}

    @property
    def discount(self) -> float:
        """gamma."""
        return self.model.discount

    @property
    def node_count(self) -> int:
        """How many beliefs were met."""
        return len(self.nodes)

    @property
    def vector_count(self) -> int:
        """How many alpha vectors there are, all groups together."""
        return sum(vectors.count for vectors in self.sets)

    @property
    def point_count(self) -> int:
        """How many points lower the upper bound."""
        return self.sawtooth.count

    @property
    def groups(self) -> int:
        """The number of groups: the blocks, and one for beliefs over several."""
        return len(self.sets)

    def vectors(self, group: int) -> tuple[npt.NDArray[np.int32], Array, npt.NDArray[np.int32]]:
        """The states (n,) of a group, its alpha vectors (K, n) and the actions (K,) they begin with."""
        held = self.sets[self._group(group)]
        states = self.model.states_of(group).astype(np.int32)
        return states, np.ascontiguousarray(held.table.T), held.actions.copy()

    def origins(self, group: int) -> tuple[Array, npt.NDArray[np.int32]]:
        """The vectors (K, n) and actions (K,) of a group that were pruned and that those left go on with."""
        n = self.sets[self._group(group)].table.shape[0]
        needed = [vector for vector in self.origins_of.needed(self.sets) if vector.group == group]
        table = np.array([vector.values for vector in needed]).reshape(len(needed), n)
        return table, np.array([vector.action for vector in needed], dtype=np.int32)

    def points(self) -> tuple[Array, *Points]:
        """The upper bound: corners (S,), and where each point begins, its states, weights and value."""
        return self.sawtooth.points()

    def low(self, node: int) -> float:
        """The best lower bound at a node."""
        return self._node(node).low

    def high(self, node: int) -> float:
        """The best upper bound at a node."""
        return self._node(node).high

    def q_lower(self, node: int) -> Array:
        """(A,) a lower bound on the value of each action."""
        return self._node(node).lower.copy()

    def q_upper(self, node: int) -> Array:
        """(A,) an upper bound on the value of each action."""
        return self._node(node).upper.copy()

    def immediate(self, node: int) -> Array:
        """(A,) the expected reward of each action."""
        return self._node(node).immediate.copy()

    def belief(self, node: int) -> Belief:
        """(S,) the belief of a node."""
        held = self._node(node).belief
        belief = np.zeros(self.model.states)
        belief[held.states] = held.weights[0]
        return belief

    def children(
        self, node: int, action: int
    ) -> tuple[npt.NDArray[np.int32], Array, Array, Array, npt.NDArray[np.int32]]:
        """(n,) observation, probability, lower and upper bound times probability, node (-1: not visited yet).

        There are none until the action was looked at.
        """
        branch = self._node(node).branches.get(self._action(action))
        if branch is None:
            none, nothing = np.empty(0, dtype=np.int32), np.empty(0)
            return none, nothing, nothing, nothing, none
        bounds = branch.probability.copy(), branch.lower.copy(), branch.upper.copy()
        return branch.observation.astype(np.int32), *bounds, branch.link.astype(np.int32)

    def node(self, belief: Belief) -> int:
        """The node of a belief (S,), made where there is none."""
        return self._node_of(self.model.belief(belief))

    def child(self, node: int, action: int, number: int) -> int:
        """The node of a child, by its place in `children`."""
        held = self._node(node)
        branch = held.branches.get(self._action(action))
        if branch is None or not 0 <= number < len(branch.link):
            raise IndexError("there is no such child")
        if branch.link[number] < 0:
            states, weights = open_branch(self, held, action)[1].belief(number)
            group = int(branch.group[number])
            found = self._node_of(Beliefs(group, states, self.model.places(group, states), weights[None]))
            # the values of two beliefs differ by no more than the largest value times their distance
            difference = self.belief(found)
            difference[states] -= weights
            branch.apart[number] = self.scale * float(np.abs(difference).sum())
            branch.link[number] = found
        return int(branch.link[number])

    def add_vectors(self, group: int, vectors: Array, actions: npt.NDArray[np.int32]) -> None:
        """Take over alpha vectors (K, n) over the states of a group, and the actions (K,) they begin with."""
        held = self.sets[self._group(group)]
        table, first = np.asarray(vectors, dtype=np.float64), np.asarray(actions)
        if table.shape != (len(first), len(self.model.states_of(group))) or not np.isfinite(table).all():
            raise ValueError("vectors of another group, or not finite")
        for vector, action in zip(table, [self._action(a) for a in first.tolist()], strict=True):
            self.origins_of.note_foreign(self.next_vector)
            held.add(vector, action, self.next_vector)
            self.next_vector += 1

    def add_points(
        self, begins: npt.NDArray[np.int64], states: npt.NDArray[np.int32], weights: Array, values: Array
    ) -> None:
        """Take over points, as `points` gives them: the value is at most values[k] at belief k.

        That has the states and weights from begins[k] to before begins[k + 1].
        """
        if len(begins) != len(values) + 1 or begins[0] != 0 or not begins[-1] == len(states) == len(weights):
            raise ValueError("the points do not add up")
        if not np.isfinite(values).all():
            raise ValueError("the value of a point is finite")
        beliefs = [
            self.model.sparse_belief(np.asarray(states)[begin:end], np.asarray(weights)[begin:end])
            for begin, end in pairwise(np.asarray(begins).tolist())
        ]
        for belief, value in zip(beliefs, np.asarray(values, dtype=np.float64).tolist(), strict=True):
            self.sawtooth.add(belief, value)

    def refresh(self, node: int) -> None:
        """Bring the bounds of a node up to date with the vectors and points since its last visit."""
        refresh(self, self._node(node))

    def look(self, node: int, below: bool) -> int:
        """The action to follow, best in the upper or the lower bound, with both its bounds up to date."""
        return look(self, self._node(node), below)

    def lower_at(self, node: int) -> float:
        """The value at a node that the alpha vectors give by themselves."""
        held = self._node(node)
        witness(self, held)
        return held.held

    def upper_at(self, node: int) -> float:
        """The upper bound at a node: its own or, where it is lower, that of the points."""
        held = self._node(node)
        newer = float(self.sawtooth.bound(held.belief, held.seen_surface)[0])
        held.surface, held.seen_surface = min(held.surface, newer), self.sawtooth.next_stamp
        return min(held.surface, held.high)

    def backup(self, node: int) -> None:
        """Add the alpha vector that is best at a node, and lower the upper bound there."""
        self._node(node)
        backup(self, node)

    def trial(
        self,
        prediction: Prediction,
        root: int,
        target: float,
        depth: int,
        seconds: float,
        greedy_below: bool,
    ) -> int:
        """Sample a path and back up along it; how many nodes it had. See sampling.py."""
        self._node(root)
        if not target >= 0 or isnan(seconds):
            raise ValueError("target and seconds are numbers, the target not negative")
        return trial(self, prediction, root, target, depth, seconds, greedy_below)

    def prune(self, roots: Sequence[int], delta: float, cap: float, growth: float) -> None:
        """Keep the vectors that are best, or nearly, at a belief that matters; see pruning.py."""
        for root in roots:
            self._node(root)
        if not (delta >= 0 and cap >= 0 and growth >= 0):
            raise ValueError("delta, cap and growth are numbers, not negative")
        prune(self, roots, delta, cap, growth)

    def _node_of(self, belief: Beliefs) -> int:
        weights = np.floor(belief.weights[0] * ALIKE + 0.5)
        inside = weights > 0
        key = belief.states[inside].tobytes(), weights[inside].tobytes()
        if key not in self._known:
            self.nodes.append(self._made(belief))
            self._known[key] = len(self.nodes) - 1
        return self._known[key]

    def _made(self, belief: Beliefs) -> Node:
        p, model = belief.weights[0], self.model
        entropy = -sum(q * log(q) for q in p.tolist()) / max(log(model.states), 1e-300)
        upper = self.sawtooth.informed(belief)[0]
        informed, surface = float(upper.max()), float(self.sawtooth.bound(belief)[0])
        return Node(
            belief=belief,
            immediate=model.reward[:, belief.states] @ p,
            lower=np.full(model.actions, -np.inf),
            upper=upper,
            high=min(informed, surface),
            surface=surface,
            seen_surface=self.sawtooth.next_stamp,
            informed=informed,
            entropy=min(max(int(entropy * BINS), 0), BINS - 1),
        )

    def _node(self, number: int) -> Node:
        if not 0 <= number < len(self.nodes):
            raise IndexError("there is no such node")
        return self.nodes[number]

    def _action(self, action: int) -> int:
        if not 0 <= action < self.model.actions:
            raise IndexError("there is no such action")
        return action

    def _group(self, group: int) -> int:
        if not 0 <= group < len(self.sets):
            raise IndexError("there is no such group")
        return group
