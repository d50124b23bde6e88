"""A POMDP as sparse tables, and its partition into blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from lcorpp.errors import ModelError
from lcorpp.planning.sparse import SparseTables
from lcorpp.values import Array, Belief, Indices

ROW_TOLERANCE = 1e-6
"""Largest deviation of the sum of a row from 1: detects wrong tables, ignores rounding."""


@dataclass(frozen=True, eq=False)
class BeliefBatch:
    """m beliefs of one group, each times a probability.

    group: see `Model`.
    states: (n,) the states with weight in any belief, rising.
    positions: (n,) positions of these states in the group.
    weights: (m, n) not negative.
    """

    group: int
    states: Indices
    positions: Indices
    weights: Array


class Model:
    """A POMDP as sparse tables, and the partition of its states into blocks.

    Blocks partition the states: after every action and observation the belief lies within one block. A model
    with fully observed parts (a MOMDP; Ong, Png, Hsu and Lee, 2010) has many blocks, and beliefs and vectors
    are stored over their own block only. A group is a block, or the mixed group of all states, which has the
    last number: it is for beliefs over several blocks.

    actions, states, observations: the numbers A, S and O.
    transition: (A, S, S) P(s' | s, a). observation: (A, S, O) P(o | a, s'). reward: (A, S). discount: gamma.
    block: (S,) block of each state. local: (S,) position of each state within its block.
    members: states of each block, rising.
    """

    def __init__(
        self,
        n_actions: int,
        n_states: int,
        n_observations: int,
        transition_begins: npt.NDArray[np.int64],
        transition_columns: npt.NDArray[np.int32],
        transition_values: Array,
        observation_begins: npt.NDArray[np.int64],
        observation_columns: npt.NDArray[np.int32],
        observation_values: Array,
        reward: Array,
        discount: float,
    ) -> None:
        """
        Args:
            transition_begins: (A S + 1,) compressed sparse rows: the entries of row a S + s, each a next
                state (column) and its probability (value), are begins[a S + s] to before begins[a S + s + 1].
            observation_begins: the same for rows a S + s' and observations.

        Raises:
            ValueError: shapes or indices do not fit together, a row is not a distribution, or a number is
                not finite.
        """
        if not 0 <= discount < 1:
            raise ValueError("the discount must be at least 0 and below 1")
        if min(n_actions, n_states, n_observations) < 1:
            raise ValueError("a model needs states, actions and observations")
        self.actions, self.states, self.observations = n_actions, n_states, n_observations
        self.transition = _check_distributions(
            (n_actions, n_states, n_states), transition_begins, transition_columns, transition_values
        )
        self.observation = _check_distributions(
            (n_actions, n_states, n_observations), observation_begins, observation_columns, observation_values
        )
        self.reward = np.array(reward, dtype=np.float64)
        if self.reward.shape != (n_actions, n_states) or not np.isfinite(self.reward).all():
            raise ValueError("expected a table of finite numbers of actions by states")
        self.discount = discount
        self._all_states = np.arange(n_states)
        self.block = self._find_blocks()
        order = np.argsort(self.block, kind="stable")
        begins = np.searchsorted(self.block[order], np.arange(int(self.block.max()) + 1))
        self.members: list[Indices] = np.split(order, begins[1:])
        self.local = np.empty(n_states, dtype=np.intp)
        self.local[order] = np.arange(n_states) - np.repeat(begins, [len(block) for block in self.members])

    @property
    def mixed_group(self) -> int:
        """The number of the group for beliefs over several blocks, which is the number of blocks."""
        return len(self.members)

    def export_blocks(self) -> npt.NDArray[np.int32]:
        """Return (S,) the block of each state, a copy."""
        return self.block.astype(np.int32)

    def group_states(self, group: int) -> Indices:
        """Return (n,) the states of a group, rising."""
        return self.members[group] if group < self.mixed_group else self._all_states

    def find_positions(self, group: int, states: Indices) -> Indices:
        """Return (n,) the positions of states (n,) in a group."""
        return self.local[states] if group < self.mixed_group else states

    def _make_batch(self, states: Indices, weights: Array) -> BeliefBatch:
        """Return beliefs of states (n,) with weights (m, n), in the smallest group with all the states."""
        blocks = self.block[states]
        group = int(blocks[0]) if (blocks == blocks[0]).all() else self.mixed_group
        return BeliefBatch(group, states, self.find_positions(group, states), weights)

    def make_belief(self, belief: Belief) -> BeliefBatch:
        """Return a batch of one belief (S,); raise a ValueError if it is no distribution over the states."""
        dense = np.asarray(belief, dtype=np.float64)
        if dense.shape != (self.states,):
            raise ValueError("a belief needs one number per state")
        if not (np.isfinite(dense).all() and dense.min() >= 0):
            raise ValueError("a number of a belief is negative or not finite")
        states = np.flatnonzero(dense)
        return self.make_sparse_belief(states, dense[states])

    def make_sparse_belief(self, states: npt.NDArray[np.integer], weights: Array) -> BeliefBatch:
        """Return a batch of one belief: states (n,), strictly increasing, with weights (n,)."""
        if states.shape != weights.shape or not (weights > 0).all() or abs(weights.sum() - 1) > ROW_TOLERANCE:
            raise ValueError("a belief needs positive weights that sum to 1")
        if (np.diff(states) <= 0).any() or states[0] < 0 or states[-1] >= self.states:
            raise ValueError("the states of a belief must be strictly increasing")
        return self._make_batch(states.astype(np.intp), weights[None].astype(np.float64))

    def _find_blocks(self) -> Indices:
        """Return (S,) the block of each state.

        Two states are connected if one action reaches both and one observation can follow in both. Blocks
        are the connected components, computed on a graph with a node for each state and each pair (a, o).
        """
        A, S, observations = self.actions, self.states, self.observations
        reached = np.zeros((A, S), dtype=bool)
        reached[self.transition.rows // S, self.transition.columns] = True
        action, state = np.divmod(self.observation.rows, S)
        possible = reached[action, state]
        outcome = S + action[possible] * observations + self.observation.columns[possible]
        size = S + A * observations
        graph = coo_array((np.ones(len(outcome), dtype=bool), (state[possible], outcome)), shape=(size, size))
        label = connected_components(graph, directed=False)[1][:S]
        # number the blocks by their first state
        first, inverse = np.unique(label, return_index=True, return_inverse=True)[1:]
        return np.argsort(np.argsort(first))[inverse]


def _check_distributions(
    shape: tuple[int, int, int],
    begins: npt.NDArray[np.int64],
    columns: npt.NDArray[np.int32],
    values: Array,
) -> SparseTables:
    """Return the tables, whose rows must be distributions."""
    try:
        rows = SparseTables(shape, begins, columns, values)
    except ModelError as error:
        raise ValueError(str(error)) from None
    if not (np.isfinite(rows.values).all() and (rows.values >= 0).all()):
        raise ValueError("a probability is negative or not finite")
    if (np.abs(rows.row_sums() - 1) > ROW_TOLERANCE).any():
        raise ValueError("a row of a table does not sum to 1")
    return rows
