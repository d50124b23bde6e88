"""Batch rollouts of a policy: many trials in step, with one graph of beliefs for all."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.planning.evaluation.belief_graph import BeliefGraph
from lcorpp.planning.evaluation.mdp import zero_reward_states
from lcorpp.planning.evaluation.sampling import CounterRng, InverseCdfSampler
from lcorpp.planning.evaluation.sparse_beliefs import SparseBeliefs
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array, Indices

MAX_BLOCK_TRIALS = 2**15
"""The maximal number of trials of a block: their state fits into a core's cache."""

MAX_GRAPH_SIZE = 2**28
"""The belief graph is cleared, except for the current beliefs, when it takes this many bytes."""


class RolloutStep(NamedTuple):
    """One step of the n running trials of a block.

    number: from 0. trials: (n,) indices within the block, increasing.
    rows: (n,) action times S plus the hidden state before the action.
    states: (n,) hidden states after the action. observations: (n,).
    ended: (n,) whether all further rewards of a trial are zero.
    """

    number: int
    trials: Indices
    rows: npt.NDArray[np.int64]
    states: npt.NDArray[np.int64]
    observations: npt.NDArray[np.int64]
    ended: npt.NDArray[np.bool_]


class BatchRollout:
    """Trials of a policy in blocks.

    roots: k beliefs, one of which is the start of each trial. weights: (k,) of each, up to a factor.
    world: what happens; the model of the policy when None. Its hidden states start by its own start belief.
    beliefs: how many beliefs were computed.
    """

    def __init__(
        self,
        pomdp: Pomdp,
        policy: Policy,
        roots: SparseBeliefs,
        weights: Array,
        seed: int,
        world: Pomdp | None = None,
    ) -> None:
        self.pomdp, self.beliefs = pomdp if world is None else world, 0
        self._roots, self._rng, self._zero_reward = roots, CounterRng(seed), zero_reward_states(self.pomdp)
        count = np.array([0, len(weights)])
        self._root = InverseCdfSampler(count, np.arange(len(weights), dtype=np.int32), weights)
        states = roots if world is None else SparseBeliefs.of(world.start[None])
        self._state = InverseCdfSampler(states.begins, states.states, states.weights)
        self._transition, self._observation = (
            InverseCdfSampler(table.begins, table.columns, table.values)
            for table in (self.pomdp.transition, self.pomdp.observation)
        )
        self._graph, self._has_world = BeliefGraph(pomdp, policy), world is not None
        block = MAX_GRAPH_SIZE // (8 * (len(pomdp.states) + len(pomdp.observations)))
        self._block = min(max(block, 256), MAX_BLOCK_TRIALS)

    def blocks(self, trials: int) -> Iterator[slice]:
        """Yield slices of the trials. The results of a trial do not depend on the slices."""
        for first in range(0, trials, self._block):
            yield slice(first, min(first + self._block, trials))

    def steps(self, block: slice, limit: int) -> Iterator[RolloutStep]:
        """Yield at most `limit` steps of a block of trials, until all have ended.

        Raises:
            ObservationError: an observation is impossible because rounding has removed the hidden state from
                the belief; the message names belief, action and observation.
        """
        S = len(self.pomdp.states)
        keys = self._rng.trial_keys(block.start, block.stop - block.start)
        trials = np.arange(len(keys))
        roots, states = self.start_states(block)
        nodes = self._add_roots(roots)
        ended = self._find_ended(states, nodes)
        for number in range(limit):
            if ended.any():
                running = np.flatnonzero(~ended)
                trials, keys, states, nodes = trials[running], keys[running], states[running], nodes[running]
            if not len(trials):
                return
            bases = self._graph.actions.take(nodes) * np.int64(S)
            rows = bases + states
            states = self._transition.draw(rows, self._rng.uniforms(keys, 2 * number + 2))
            bases += states
            observations = self._observation.draw(bases, self._rng.uniforms(keys, 2 * number + 3))
            nodes = self._follow(nodes, observations)
            ended = self._find_ended(states, nodes)
            yield RolloutStep(number, trials, rows, states, observations, ended)

    def start_states(self, block: slice) -> tuple[Indices, Indices]:
        """Return (n,) the root and (n,) the initial hidden state of each trial of a block."""
        keys = self._rng.trial_keys(block.start, block.stop - block.start)
        roots = self._root.draw(np.zeros(len(keys), dtype=np.intp), self._rng.uniforms(keys, 0))
        places = np.zeros_like(roots) if self._has_world else roots
        return roots, self._state.draw(places, self._rng.uniforms(keys, 1))

    def _find_ended(self, states: Indices, nodes: Indices) -> npt.NDArray[np.bool_]:
        """Return (n,) whether all further rewards are zero; in another world a belief may be wrong there."""
        ended: npt.NDArray[np.bool_] = self._zero_reward.take(states)
        return ended if self._has_world else ended | self._graph.absorbing.take(nodes)

    def _add_roots(self, roots: Indices) -> Indices:
        before = len(self._graph)
        distinct, place = np.unique(roots, return_inverse=True)
        nodes = self._graph.add(self._roots.take(distinct))[place]
        self.beliefs += len(self._graph) - before
        return nodes

    def _follow(self, nodes: Indices, observations: npt.NDArray[np.int64]) -> Indices:
        before = len(self._graph)
        children = self._graph.follow(nodes, observations)
        self.beliefs += len(self._graph) - before
        if self._graph.memory_size > MAX_GRAPH_SIZE:
            full, self._graph = self._graph, self._graph.empty_copy()
            children = self._graph.import_nodes(full, children)
        return children
