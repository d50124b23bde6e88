"""Nodes of the belief tree: a belief, its actions, and the next belief after each action and observation."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from lcorpp.planning.belief import MIN_PROBABILITY
from lcorpp.planning.sarsop.numpy_kernels.model import BeliefBatch, Model
from lcorpp.values import Array, Indices

PREDICTOR_BINS = 32
"""Bins of the value predictor, for the initial upper bound and for the entropy."""


@dataclass(frozen=True, eq=False)
class Outcomes:
    """The n children of a belief and an action, by rising observation.

    observation, probability, group: (n,) of each child.
    batches: for each group, the numbers of its children and their beliefs times their probabilities.
    """

    observation: Indices
    probability: Array
    group: Indices
    batches: tuple[tuple[Indices, BeliefBatch], ...]

    @property
    def size(self) -> int:
        """The number of stored weights."""
        return sum(beliefs.weights.size for _, beliefs in self.batches)

    def belief(self, child: int) -> tuple[Indices, Array]:
        """Return the states of a child's belief and their probabilities."""
        for children, beliefs in self.batches:
            rows = np.flatnonzero(children == child)
            if len(rows):
                weights = beliefs.weights[rows[0]]
                inside = np.flatnonzero(weights)
                return beliefs.states[inside], weights[inside] / self.probability[child]
        raise IndexError("unknown child")


@dataclass(eq=False, slots=True)
class Branch:
    """One action at a belief and its n children, by rising observation.

    observation, probability, group: (n,) of each child.
    child_nodes: (n,) node of the next belief, -1 before the first visit.
    lipschitz_slack: (n,) largest difference between the values of the next belief and of its node, because
        nearly equal beliefs share a node.
    lower, upper: (n,) bounds of the next beliefs times their probability.
    best_vectors: (n,) stamps of the vectors that give `lower`.
    vectors_version, points_version: the bounds include all vectors and points with smaller stamps.
    refreshed: whether the upper bounds were computed.
    outcomes: the next beliefs, cached up to MAX_CACHED_OUTCOMES, because most visits need them.
    """

    observation: Indices
    probability: Array
    group: Indices
    child_nodes: Indices
    lipschitz_slack: Array
    lower: Array
    upper: Array
    best_vectors: npt.NDArray[np.int64]
    vectors_version: int = 0
    points_version: int = 0
    refreshed: bool = False
    outcomes: Outcomes | None = None

    @classmethod
    def of(cls, outcomes: Outcomes) -> Branch:
        """Return a branch whose children have no bounds yet."""
        n = len(outcomes.observation)
        return cls(
            observation=outcomes.observation,
            probability=outcomes.probability,
            group=outcomes.group,
            child_nodes=np.full(n, -1, dtype=np.intp),
            lipschitz_slack=np.zeros(n),
            lower=np.full(n, -np.inf),
            upper=np.full(n, np.inf),
            best_vectors=np.full(n, -1, dtype=np.int64),
        )


@dataclass(eq=False, slots=True)
class BeliefNode:
    """A belief and its bounds.

    belief: a batch of one. expected_rewards: (A,) of each action.
    q_lower, q_upper: (A,) bounds on the value of each action. lower, upper: the best bounds so far.
    branches: the expanded actions.
    best_vector, lower_value: stamp and value of the best vector; vectors_version as in a branch.
    sawtooth_value: upper bound by the points with stamps before sawtooth_version.
    point_stamp: stamp of this belief's point in the upper bound, -1 for none.
    informed_value, entropy_bin: the initial upper bound and a bin, the inputs of `ValuePredictor`.
    """

    belief: BeliefBatch
    expected_rewards: Array
    q_lower: Array
    q_upper: Array
    upper: float
    sawtooth_value: float
    sawtooth_version: int
    informed_value: float
    entropy_bin: int
    branches: dict[int, Branch] = field(default_factory=dict)
    lower: float = -np.inf
    lower_value: float = -np.inf
    best_vector: int = -1
    vectors_version: int = 0
    point_stamp: int = -1


def predict(model: Model, belief: BeliefBatch, action: int) -> tuple[Indices, Array]:
    """Return the states (n,) that an action reaches from one belief, and their probabilities (n,), before any
    observation."""
    index, owner = model.transition.row_entries(action * model.states + belief.states)
    shares = belief.weights[0, owner] * model.transition.values[index]
    mass = np.bincount(model.transition.columns[index], shares, minlength=model.states)
    states = np.flatnonzero(mass)
    return states, np.asarray(mass[states], dtype=np.float64)


def compute_outcomes(model: Model, belief: BeliefBatch, action: int) -> Outcomes:
    """Return the children of one belief under an action."""
    reached, mass = predict(model, belief, action)
    index, owner = model.observation.row_entries(action * model.states + reached)
    seen = model.observation.columns[index]
    order = np.argsort(seen, kind="stable")
    observation, child = np.unique(seen[order], return_inverse=True)
    owner, weights = owner[order], (mass[owner] * model.observation.values[index])[order]
    probability: Array = np.asarray(np.bincount(child, weights, minlength=len(observation)), dtype=np.float64)
    # drop the children whose probability has no significant digits
    possible = probability >= MIN_PROBABILITY
    inside = possible[child] & (weights > 0)
    child, owner, weights = (np.cumsum(possible) - 1)[child[inside]], owner[inside], weights[inside]
    group = np.empty(int(possible.sum()), dtype=np.intp)
    group[child] = model.block[reached[owner]]
    batches = []
    for g in np.unique(group):
        children, own = np.flatnonzero(group == g), group[child] == g
        support, position = np.unique(owner[own], return_inverse=True)
        table = np.zeros((len(children), len(support)))
        table[np.searchsorted(children, child[own]), position] = weights[own]
        states = reached[support]
        batches.append((children, BeliefBatch(int(g), states, model.local[states], table)))
    return Outcomes(observation[possible].astype(np.intp), probability[possible], group, tuple(batches))
