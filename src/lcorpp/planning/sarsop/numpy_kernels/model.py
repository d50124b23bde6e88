"""A POMDP in compressed rows, and what its observations may leave open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from lcorpp.errors import ModelError
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array, Belief

Indices = npt.NDArray[np.intp]

ROW_TOLERANCE = 1e-6
"""How far a row may be from summing to 1: a wrong table is found, rounding is not."""


@dataclass(frozen=True, eq=False)
class Beliefs:
    """m beliefs of one group, each times a probability.

    group: their block; one more than the last where they are over several.
    states: (n,) the states that any of them holds possible, rising.
    places: (n,) where these are in the group.
    weights: (m, n) not negative.
    """

    group: int
    states: Indices
    places: Indices
    weights: Array


class Model:
    """The problem.

    What an observation may leave open partitions the states into blocks: after every action and observation
    the belief lies in one block. A model whose parts are observed fully (a MOMDP; Ong, Png, Hsu and Lee,
    2010) falls into many blocks, and all that is kept of a belief or a vector is its own block.

    actions, states, observations: A, S and O.
    transition: (A, S, S) P(s' | s, a). observation: (A, S, O) P(o | a, s'). reward: (A, S). discount: gamma.
    block: (S,) the block of each state. local: (S,) its place within the block.
    members: the states of each block, rising.

    Raises:
        ValueError: shapes or indices do not fit together, a row is no distribution, a number is not finite.
    """

    def __init__(
        self,
        actions: int,
        states: int,
        observations: int,
        t_begins: npt.NDArray[np.int64],
        t_column: npt.NDArray[np.int32],
        t_value: Array,
        o_begins: npt.NDArray[np.int64],
        o_column: npt.NDArray[np.int32],
        o_value: Array,
        reward: Array,
        discount: float,
    ) -> None:
        if not 0 < discount < 1:
            raise ValueError("the discount is between 0 and 1, both excluded")
        if min(actions, states, observations) < 1:
            raise ValueError("a model has states, actions and observations")
        self.actions, self.states, self.observations = actions, states, observations
        self.transition = _distributions((actions, states, states), t_begins, t_column, t_value)
        self.observation = _distributions((actions, states, observations), o_begins, o_column, o_value)
        self.reward = np.array(reward, dtype=np.float64)
        if self.reward.shape != (actions, states) or not np.isfinite(self.reward).all():
            raise ValueError("expected a table of actions by states, of finite numbers")
        self.discount = discount
        self._everything = np.arange(states)
        self.block = self._find_blocks()
        order = np.argsort(self.block, kind="stable")
        begins = np.searchsorted(self.block[order], np.arange(int(self.block.max()) + 1))
        self.members: list[Indices] = np.split(order, begins[1:])
        self.local = np.empty(states, dtype=np.intp)
        self.local[order] = np.arange(states) - np.repeat(begins, [len(block) for block in self.members])

    def blocks(self) -> npt.NDArray[np.int32]:
        """(S,) the block of each state."""
        return self.block.astype(np.int32)

    def states_of(self, group: int) -> Indices:
        """The states of a group: those of a block, or all in the group of beliefs over several."""
        return self.members[group] if group < len(self.members) else self._everything

    def places(self, group: int, states: Indices) -> Indices:
        """(n,) where states (n,) are in a group."""
        return self.local[states] if group < len(self.members) else states

    def _beliefs(self, states: Indices, weights: Array) -> Beliefs:
        blocks = self.block[states]
        group = int(blocks[0]) if (blocks == blocks[0]).all() else len(self.members)
        return Beliefs(group, states, self.places(group, states), weights)

    def belief(self, belief: Belief) -> Beliefs:
        """One belief (S,).

        Raises:
            ValueError: it is no distribution over the states.
        """
        given = np.asarray(belief, dtype=np.float64)
        if given.shape != (self.states,):
            raise ValueError("a belief has one number for each state")
        if not (np.isfinite(given).all() and given.min() >= 0):
            raise ValueError("a belief holds finite numbers, not negative")
        states = np.flatnonzero(given)
        return self.sparse_belief(states, given[states])

    def sparse_belief(self, states: npt.NDArray[np.integer], weights: Array) -> Beliefs:
        """One belief: states (n,) rising, with weights (n,).

        Raises:
            ValueError: it is no distribution over the states.
        """
        if states.shape != weights.shape or not (weights > 0).all() or abs(weights.sum() - 1) > ROW_TOLERANCE:
            raise ValueError("a belief has positive weights that sum to 1")
        if (np.diff(states) <= 0).any() or states[0] < 0 or states[-1] >= self.states:
            raise ValueError("a belief has rising states")
        return self._beliefs(states.astype(np.intp), weights[None].astype(np.float64))

    def _find_blocks(self) -> Indices:
        """(S,) states that the same action can reach and the same observation can follow are in one block."""
        A, S, observations = self.actions, self.states, self.observations
        reached = np.zeros((A, S), dtype=bool)
        reached[self.transition.rows // S, self.transition.columns] = True
        action, state = np.divmod(self.observation.rows, S)
        sees = reached[action, state]
        seen = S + action[sees] * observations + self.observation.columns[sees]
        size = S + A * observations
        graph = coo_array((np.ones(len(seen), dtype=bool), (state[sees], seen)), shape=(size, size))
        label = connected_components(graph, directed=False)[1][:S]
        # blocks are numbered by their first state
        first, inverse = np.unique(label, return_index=True, return_inverse=True)[1:]
        return np.argsort(np.argsort(first))[inverse]


def entries(rows: SparseTables, wanted: Indices) -> tuple[Indices, Indices]:
    """Where the entries of the rows `wanted` (n,) are, end to end, and which of the n each belongs to."""
    return ranges(rows.begins[wanted], rows.begins[wanted + 1])


def ranges(begins: Indices, ends: Indices) -> tuple[Indices, Indices]:
    """All numbers from begins[i] to before ends[i], end to end, and the i of each."""
    counts = ends - begins
    owner = np.repeat(np.arange(len(counts)), counts)
    return np.arange(len(owner)) + np.repeat(begins - (np.cumsum(counts) - counts), counts), owner


def _distributions(
    shape: tuple[int, int, int],
    begins: npt.NDArray[np.int64],
    column: npt.NDArray[np.int32],
    value: Array,
) -> SparseTables:
    try:
        rows = SparseTables(shape, begins, column, value)
    except ModelError as error:
        raise ValueError(str(error)) from None
    if not (np.isfinite(rows.values).all() and (rows.values >= 0).all()):
        raise ValueError("probabilities are finite numbers, not negative")
    if (np.abs(rows.row_sums() - 1) > ROW_TOLERANCE).any():
        raise ValueError("a row of a table does not sum to 1")
    return rows
