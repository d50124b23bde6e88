"""A number of steps as a problem without end: the state tells the step, and the step can be seen.

Layer t holds the states with t steps done; the last step leads to a state where nothing is paid any more. So
whatever solves problems without end solves those with one. Rewards are weighed so that their sum is
discounted as is wished, the factor 1 not excluded, whatever the factor of the layered problem.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lcorpp.errors import ModelError
from lcorpp.planning.policy import UpperBound
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sparse import MAX_BYTES, SparseTables
from lcorpp.values import Array, Belief


@dataclass(frozen=True, eq=False)
class Layers:
    """The layered problem of H steps.

    pomdp: H S + 1 states, state s with t steps done being t S + s, and the end; H O + 1 observations.
    weights: (H,) what the values of a layer are multiplied by.
    """

    pomdp: Pomdp
    weights: Array

    @property
    def horizon(self) -> int:
        """H."""
        return len(self.weights)

    @property
    def states(self) -> int:
        """S."""
        return (len(self.pomdp.states) - 1) // self.horizon

    def belief(self, belief: Belief, layer: int) -> Belief:
        """(H S + 1,) a belief (S,) in a layer."""
        within = np.zeros(len(self.pomdp.states))
        within[layer * self.states : (layer + 1) * self.states] = belief
        return within


@dataclass(frozen=True, eq=False)
class LayerBound:
    """The upper bound of a layered problem in one of its layers: `lcorpp.planning.policy.UpperBound`."""

    layers: Layers
    layer: int
    bound: UpperBound

    def value(self, belief: Belief) -> float:
        """The bound at a belief (S,)."""
        within = self.layers.belief(belief, self.layer)
        return self.bound.value(within) / float(self.layers.weights[self.layer])


def layered(pomdp: Pomdp, horizon: int, discount: float) -> Layers:
    """The problem of a number of steps.

    Args:
        horizon: H, from 1. discount: of the H steps, 0 < discount <= 1.

    Raises:
        ModelError: the tables would be too large.
    """
    A, S = pomdp.reward.shape
    entries = horizon * (len(pomdp.transition.values) + len(pomdp.observation.values) + 2 * A * S)
    if 16 * entries > MAX_BYTES:
        raise ModelError(
            f"{horizon} steps of a problem of {S} states take tables of {entries} numbers, which is too many"
        )
    # close enough to the factor wished for that no layer weighs much more than another
    own = discount if discount < 1 else 1 - 1 / (2 * horizon + 2)
    weights: Array = np.power(discount / own, np.arange(horizon, dtype=np.float64))
    transition = _stacked(pomdp.transition, horizon, ahead=1)
    observation = _stacked(pomdp.observation, horizon, ahead=0)
    reward = np.concatenate([pomdp.reward * weight for weight in weights] + [np.zeros((A, 1))], axis=1)
    flat = Pomdp(
        states=(*(f"{name}@{t}" for t in range(horizon) for name in pomdp.states), "end"),
        actions=pomdp.actions,
        observations=(*(f"{name}@{t}" for t in range(horizon) for name in pomdp.observations), "end"),
        transition=transition,
        observation=observation,
        reward=reward,
        discount=own,
        start=np.append(pomdp.start, np.zeros((horizon - 1) * S + 1)),
        file=pomdp.file,
    )
    return Layers(flat, weights)


def _stacked(table: SparseTables, horizon: int, *, ahead: int) -> SparseTables:
    """(A, H S + 1, H N + 1) a table (A, S, N) in every layer, leading `ahead` layers on or to the end."""
    A, S, N = table.shape
    inner = horizon - ahead
    sizes, columns, values = [], [], []
    for a in range(A):
        part = table.action_slice(a)
        counts = np.diff(table.begins[a * S : (a + 1) * S + 1])
        sizes += [np.tile(counts, inner), np.ones(ahead * S + 1, dtype=np.int64)]
        shifts = np.repeat((np.arange(inner) + ahead) * N, part.stop - part.start)
        columns += [np.tile(table.columns[part], inner) + shifts, np.full(ahead * S + 1, horizon * N)]
        values += [np.tile(table.values[part], inner), np.ones(ahead * S + 1)]
    begins = np.concatenate([[0], np.cumsum(np.concatenate(sizes))])
    shape = (A, horizon * S + 1, horizon * N + 1)
    return SparseTables(shape, begins, np.concatenate(columns).astype(np.int32), np.concatenate(values))
