"""Many trials of a policy in step: hidden states drawn, beliefs followed through the graph they share."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.planning.evaluation.absorbing import zero_reward_states
from lcorpp.planning.evaluation.belief_graph import BeliefGraph
from lcorpp.planning.evaluation.sampling import CounterRng, InverseCdfSampler
from lcorpp.planning.evaluation.sparse_beliefs import Indices, SparseBeliefs
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.values import Array

MOST_TRIALS = 2**15
"""Trials that walk together: their numbers stay in the cache of a core."""

MOST_NUMBERS = 2**25
"""Numbers that the belief graph may keep before all but the beliefs at hand are forgotten."""


class Step(NamedTuple):
    """One step of the n trials of a block that still run.

    number: counted from 0. trials: (n,) which of the block they are, rising.
    rows: (n,) the action taken times S plus the hidden state it was taken in.
    states: (n,) the hidden states reached. observations: (n,) what was observed there.
    ended: (n,) whether nothing more can be earned.
    """

    number: int
    trials: Indices
    rows: npt.NDArray[np.int64]
    states: npt.NDArray[np.int64]
    observations: npt.NDArray[np.int64]
    ended: npt.NDArray[np.bool_]


class BatchRollout:
    """What blocks of trials of one policy share.

    roots: k beliefs that a trial may begin at. chances: (k,) of each, up to a factor.
    made: how many beliefs have been worked out.
    """

    def __init__(self, pomdp: Pomdp, policy: Policy, roots: SparseBeliefs, chances: Array, seed: int) -> None:
        self.pomdp, self.made = pomdp, 0
        self._roots, self._rng, self._over = roots, CounterRng(seed), zero_reward_states(pomdp)
        count = np.array([0, len(chances)])
        self._root = InverseCdfSampler(count, np.arange(len(chances), dtype=np.int32), chances)
        self._state = InverseCdfSampler(roots.begins, roots.states, roots.weights)
        self._transition, self._observation = (
            InverseCdfSampler(table.begins, table.columns, table.values)
            for table in (pomdp.transition, pomdp.observation)
        )
        self._graph = BeliefGraph(pomdp, policy)
        room = MOST_NUMBERS // (len(pomdp.states) + len(pomdp.observations))
        self._block = min(max(room, 256), MOST_TRIALS)

    def blocks(self, trials: int) -> Iterator[slice]:
        """Runs of trials that walk together. What comes of a trial does not depend on where they are cut."""
        for first in range(0, trials, self._block):
            yield slice(first, min(first + self._block, trials))

    def steps(self, block: slice, most: int) -> Iterator[Step]:
        """The steps of a block of trials until all of them have ended, at most some.

        Raises:
            ObservationError: a belief has lost the hidden state to rounding, so that what is observed is
                impossible in it; belief, action and observation are named.
        """
        S = len(self.pomdp.states)
        lots = self._rng.trial_keys(block.start, block.stop - block.start)
        trials = np.arange(len(lots))
        roots, states = self.starts(block)
        nodes = self._nodes(roots)
        ended = self._over.take(states) | self._graph.over.take(nodes)
        for number in range(most):
            if ended.any():
                runs = np.flatnonzero(~ended)
                trials, lots, states, nodes = trials[runs], lots[runs], states[runs], nodes[runs]
            if not len(trials):
                return
            bases = self._graph.actions.take(nodes) * np.int64(S)
            rows = bases + states
            states = self._transition.draw(rows, self._rng.numbers(lots, 2 * number + 2))
            bases += states
            observations = self._observation.draw(bases, self._rng.numbers(lots, 2 * number + 3))
            nodes = self._follow(nodes, observations)
            ended = self._over.take(states) | self._graph.over.take(nodes)
            yield Step(number, trials, rows, states, observations, ended)

    def starts(self, block: slice) -> tuple[Indices, Indices]:
        """(n,) the roots at which the trials of a block begin, and (n,) their hidden states."""
        lots = self._rng.trial_keys(block.start, block.stop - block.start)
        roots = self._root.draw(np.zeros(len(lots), dtype=np.intp), self._rng.numbers(lots, 0))
        return roots, self._state.draw(roots, self._rng.numbers(lots, 1))

    def _nodes(self, roots: Indices) -> Indices:
        before = len(self._graph)
        met, place = np.unique(roots, return_inverse=True)
        nodes = self._graph.add(self._roots.take(met))[place]
        self.made += len(self._graph) - before
        return nodes

    def _follow(self, nodes: Indices, observations: npt.NDArray[np.int64]) -> Indices:
        before = len(self._graph)
        found = self._graph.follow(nodes, observations)
        self.made += len(self._graph) - before
        if self._graph.size > MOST_NUMBERS:
            fuller, self._graph = self._graph, self._graph.empty_copy()
            found = self._graph.import_nodes(fuller, found)
        return found
