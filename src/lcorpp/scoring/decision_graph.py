"""The points of decisions as numbers, found as they are reached, for many decisions at once."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Sequence

import numpy as np

from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, expected_one_of
from lcorpp.scoring.decision_nodes import DecisionNodes
from lcorpp.values import Indices

ENDED = -1
"""The action at a node where the decision has ended without a report."""

MAX_TOGETHER = 5000
"""The robot acts and updates its belief at this many points at once; more take memory and save no time."""


class DecisionGraph:
    """The points at which a robot acts, numbered; equal points are one.

    However many decisions pass a point, the robot decides there once.
    """

    def __init__(self, domain: Domain, nodes: DecisionNodes) -> None:
        self._nodes, self._pomdp = nodes, domain.pomdp
        self._action_index = {name: a for a, name in enumerate(domain.pomdp.actions)}
        self._numbers: dict[Hashable, int] = {}
        self._found: list[Hashable] = []
        self._actions: list[int] = []
        self._children: dict[int, int] = {}  # node * number of observations + observation -> node

    def __len__(self) -> int:
        return len(self._found)

    @property
    def n_arcs(self) -> int:
        """The number of known steps from one node to another."""
        return len(self._children)

    def find_numbers(self, nodes: Sequence[Hashable]) -> list[int]:
        """Return the numbers of some nodes; the robot decides at those that are new."""
        numbers = self._numbers
        new = [node for node in dict.fromkeys(nodes) if node not in numbers]
        for node, action in zip(new, self._nodes.find_actions(new), strict=True) if new else ():
            if action is not None and action not in self._action_index:
                known = expected_one_of(self._pomdp.actions)
                raise DecisionError(f"the robot chose the action {action!r}; {known}")
            numbers[node] = len(self._found)
            self._found.append(node)
            self._actions.append(ENDED if action is None else self._action_index[action])
        return [numbers[node] for node in nodes]

    def find_actions(self, nodes: Indices) -> Indices:
        """Return the index of the action at each node; `ENDED` where there is none."""
        actions = self._actions
        return np.array([actions[node] for node in nodes.tolist()], np.intp)

    def list_known_children(self, nodes: Indices, observations: Indices) -> Indices:
        """Return the nodes (n, k) after the actions at nodes (n,) and observations (k,); -1 if unknown."""
        keys = np.add.outer(nodes * len(self._pomdp.observations), observations)
        known = [self._children.get(key, -1) for key in keys.ravel().tolist()]
        return np.array(known, np.intp).reshape(keys.shape)

    def find_children(self, nodes: Indices, observations: Indices) -> Indices:
        """Return the node after the action at each node and an observation.

        Raises:
            ObservationError: an observation is impossible under the robot's model.
            DecisionError: the robot chooses an unknown action.
        """
        size, known = len(self._pomdp.observations), self._children
        keys = (nodes * size + observations).tolist()
        new = [key for key in dict.fromkeys(keys) if key not in known]
        for i in range(0, len(new), MAX_TOGETHER):
            part = new[i : i + MAX_TOGETHER]
            here = [self._found[key // size] for key in part]
            done = [self._pomdp.actions[self._actions[key // size]] for key in part]
            seen = [self._pomdp.observations[key % size] for key in part]
            known.update(zip(part, self.find_numbers(self._nodes.extend(here, done, seen)), strict=True))
        return np.array([known[key] for key in keys], np.intp)

    def describe_root(self, roots: Iterable[int], node: int) -> str:
        """Return the first of some nodes before the first action from which a node is reached, in words."""
        parents = defaultdict[int, list[int]](list)
        for key, child in self._children.items():
            parents[child].append(key // len(self._pomdp.observations))
        ancestors, waiting = {node}, [node]
        for each in waiting:  # grows
            new = [parent for parent in parents[each] if parent not in ancestors]
            ancestors.update(new)
            waiting += new
        return self._nodes.describe(self._found[next(root for root in roots if root in ancestors)])
