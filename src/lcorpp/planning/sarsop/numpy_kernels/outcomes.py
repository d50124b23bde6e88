"""Where one action leads from a belief, by what is observed then."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcorpp.planning.belief import MIN_PROBABILITY
from lcorpp.planning.sarsop.numpy_kernels.model import Beliefs, Indices, Model, entries
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class Outcomes:
    """The n children of a belief and an action, in the order of the observations.

    observation, probability, group: (n,) of each child.
    parts: the next beliefs times their probabilities, those of one group together: which children, and they.
    """

    observation: Indices
    probability: Array
    group: Indices
    parts: tuple[tuple[Indices, Beliefs], ...]

    @property
    def size(self) -> int:
        """How many numbers it keeps."""
        return sum(beliefs.weights.size for _, beliefs in self.parts)

    def belief(self, child: int) -> tuple[Indices, Array]:
        """The states of a child's belief and their probabilities."""
        for children, beliefs in self.parts:
            found = np.flatnonzero(children == child)
            if len(found):
                weights = beliefs.weights[found[0]]
                inside = np.flatnonzero(weights)
                return beliefs.states[inside], weights[inside] / self.probability[child]
        raise IndexError("there is no such child")


def spread(model: Model, belief: Beliefs, action: int) -> tuple[Indices, Array]:
    """The states that an action reaches from a belief (1, n) and their weights, nothing being observed."""
    index, owner = entries(model.transition, action * model.states + belief.states)
    shares = belief.weights[0, owner] * model.transition.values[index]
    mass = np.bincount(model.transition.columns[index], shares, minlength=model.states)
    states = np.flatnonzero(mass)
    return states, np.asarray(mass[states], dtype=np.float64)


def outcomes(model: Model, belief: Beliefs, action: int) -> Outcomes:
    """Where an action leads from a belief (1, n)."""
    reached, mass = spread(model, belief, action)
    index, owner = entries(model.observation, action * model.states + reached)
    seen = model.observation.columns[index]
    order = np.argsort(seen, kind="stable")
    observation, child = np.unique(seen[order], return_inverse=True)
    owner, weights = owner[order], (mass[owner] * model.observation.values[index])[order]
    probability: Array = np.asarray(np.bincount(child, weights, minlength=len(observation)), dtype=np.float64)
    # children whose probability has no digits are left out; the others move up
    possible = probability >= MIN_PROBABILITY
    inside = possible[child] & (weights > 0)
    child, owner, weights = (np.cumsum(possible) - 1)[child[inside]], owner[inside], weights[inside]
    group = np.empty(int(possible.sum()), dtype=np.intp)
    group[child] = model.block[reached[owner]]
    parts = []
    for g in np.unique(group):
        children, own = np.flatnonzero(group == g), group[child] == g
        held, place = np.unique(owner[own], return_inverse=True)
        table = np.zeros((len(children), len(held)))
        table[np.searchsorted(children, child[own]), place] = weights[own]
        states = reached[held]
        parts.append((children, Beliefs(int(g), states, model.local[states], table)))
    return Outcomes(observation[possible].astype(np.intp), probability[possible], group, tuple(parts))
