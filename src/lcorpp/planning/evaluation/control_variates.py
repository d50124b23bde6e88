"""The value of a policy from some beliefs on, by trials that its own vectors make precise."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lcorpp.planning.evaluation.belief_graph import BeliefGraph, branching
from lcorpp.planning.evaluation.sampling import CounterRng, InverseCdfSampler
from lcorpp.planning.evaluation.sparse_beliefs import Indices, segment_sum
from lcorpp.planning.evaluation.splitmix64 import Words
from lcorpp.values import Array

MOST_NUMBERS = 2**25
"""Numbers that the belief graph of the trials may keep, and about what one of their steps may add."""

MOST_TRIALS = 2**10
"""Trials that take their steps together."""


class Estimate(NamedTuple):
    """mean: of what is earned. half: of its confidence interval, which reaches as far to both sides."""

    mean: float
    half: float


def estimate(
    graph: BeliefGraph, roots: Indices, chances: Array, *, trials: int, confidence: float, seed: int
) -> Estimate:
    """The discounted reward that a policy earns from a belief drawn from some.

    A trial follows beliefs, not states: at each it earns the mean reward, and it goes on with the discount
    as its probability, so what it earns in all has the mean that is sought, without an end where it is cut
    off. What the vectors promise goes along with it: the promise where it begins, less its mean; and the
    promise where it begins plus all that the promise is expected to change by on the way. Both have mean 0,
    whatever the vectors are, so what they explain of the noise is taken out by regression; were the promise
    the truth, nothing would be left of it.

    Args:
        graph: of the policy; it is left as it is.
        roots: k of its nodes. chances: (k,) of each, up to a factor.
        trials: how many, from 4. confidence: of the interval. seed: a whole number from 0.

    Source: control variates with regression: Owen, Monte Carlo theory, methods and examples, 2013, section
    8.9; the discount as survival: Derman, Finite state Markovian decision processes, 1970.
    """
    from scipy.special import stdtrit

    walk = _Walk(graph, roots, chances, seed)
    earned, promised, begun = (np.concatenate(kind) for kind in zip(*walk.blocks(trials), strict=True))
    mean_promise = float(chances @ _promise(graph, roots) / chances.sum())
    explaining = np.stack([np.ones(trials), begun - mean_promise, promised], axis=1)
    fit = np.linalg.lstsq(explaining, earned, rcond=1e-9)[0]
    off = earned - explaining @ fit
    free = trials - explaining.shape[1]
    deviation = float(np.sqrt(off @ off / free))
    return Estimate(float(fit[0]), float(stdtrit(free, (1 + confidence) / 2)) * deviation / trials**0.5)


class _Walk:
    """Trials over beliefs, the children of each worked out all together."""

    def __init__(self, graph: BeliefGraph, roots: Indices, chances: Array, seed: int) -> None:
        self._pomdp, self._graph = graph.pomdp, graph.empty_copy()
        self._given, self._roots, self._rng = graph, roots, CounterRng(seed)
        self._root = InverseCdfSampler(
            np.array([0, len(chances)]), np.arange(len(chances), dtype=np.int32), chances
        )
        wide = len(self._pomdp.states) * branching(self._pomdp.observation)
        self._block = min(max(MOST_NUMBERS // wide, 16), MOST_TRIALS)

    def blocks(self, trials: int) -> Iterator[tuple[Array, Array, Array]]:
        """(n,) what the trials of each block earn, (n,) their promise and all that is expected to become of
        it, and (n,) the promise alone."""
        for first in range(0, trials, self._block):
            yield self._run(self._rng.trial_keys(first, min(self._block, trials - first)))

    def _run(self, lots: Words) -> tuple[Array, Array, Array]:
        root = self._root.draw(np.zeros(len(lots), dtype=np.intp), self._rng.numbers(lots, 0))
        nodes = self._graph.import_nodes(self._given, self._roots[root])
        begun, earned = _promise(self._graph, nodes), np.zeros(len(lots))
        promised = begun.copy()
        trials = np.arange(len(lots))
        step = 0
        while True:
            going = np.flatnonzero(~self._graph.over[nodes])
            trials, nodes = trials[going], nodes[going]
            if not len(trials):
                return earned, promised, begun
            paid, change, nodes = self._step(nodes, self._rng.numbers(lots[trials], 2 * step + 1))
            earned[trials] += paid
            promised[trials] += change
            goes_on = self._rng.numbers(lots[trials], 2 * step + 2) < self._pomdp.discount
            trials, nodes = trials[goes_on], nodes[goes_on]
            step += 1
            if self._graph.size > MOST_NUMBERS:
                fuller, self._graph = self._graph, self._graph.empty_copy()
                nodes = self._graph.import_nodes(fuller, nodes)

    def _step(self, nodes: Indices, numbers: Array) -> tuple[Array, Array, Indices]:
        """At nodes (n,): the mean rewards, how the promise changes on average, and the nodes that follow."""
        met, place = np.unique(nodes, return_inverse=True)
        owner, _, probability, child = self._graph.expand(met)
        begins = np.searchsorted(owner, np.append(met, len(self._graph)))
        ahead = segment_sum(np.searchsorted(met, owner), probability * _promise(self._graph, child), len(met))
        change = self._pomdp.discount * ahead - _promise(self._graph, met)
        paid = self._graph.rewards(met)
        following = InverseCdfSampler(begins, child.astype(np.int32), probability).draw(place, numbers)
        return paid[place], change[place], following


def _promise(graph: BeliefGraph, nodes: Indices) -> Array:
    """(k,) what the vectors say of some nodes; nothing, where nothing is paid any more."""
    return np.where(graph.over[nodes], 0.0, graph.values[nodes])
