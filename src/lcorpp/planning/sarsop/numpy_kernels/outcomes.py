"""Belief updates of one action: the next belief after each observation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcorpp.planning.belief import MIN_PROBABILITY
from lcorpp.planning.sarsop.numpy_kernels.model import BeliefBatch, Indices, Model, find_row_entries
from lcorpp.values import Array


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


def predict(model: Model, belief: BeliefBatch, action: int) -> tuple[Indices, Array]:
    """Return the states (n,) that an action reaches from one belief, and their probabilities (n,), before any
    observation."""
    index, owner = find_row_entries(model.transition, action * model.states + belief.states)
    shares = belief.weights[0, owner] * model.transition.values[index]
    mass = np.bincount(model.transition.columns[index], shares, minlength=model.states)
    states = np.flatnonzero(mass)
    return states, np.asarray(mass[states], dtype=np.float64)


def compute_outcomes(model: Model, belief: BeliefBatch, action: int) -> Outcomes:
    """Return the children of one belief under an action."""
    reached, mass = predict(model, belief, action)
    index, owner = find_row_entries(model.observation, action * model.states + reached)
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
