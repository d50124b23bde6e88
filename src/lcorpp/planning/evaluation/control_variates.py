"""Monte Carlo estimate of a policy's value, with the policy's own vectors as control variates."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from lcorpp.planning.evaluation.belief_graph import BeliefGraph, mean_row_size
from lcorpp.planning.evaluation.sampling import CounterRng, InverseCdfSampler, Words
from lcorpp.planning.evaluation.sparse_beliefs import segment_sum
from lcorpp.values import Array, Indices

MAX_GRAPH_SIZE = 2**25
"""The trials' belief graph is cleared when it contains this many numbers; one step may add about as many."""

MAX_BLOCK_TRIALS = 2**10
"""The maximal number of trials that are simulated in step."""


class MeanEstimate(NamedTuple):
    """mean: of the discounted reward. half_width: of its symmetric confidence interval."""

    mean: float
    half_width: float


def estimate_value(
    graph: BeliefGraph, roots: Indices, weights: Array, *, trials: int, confidence: float, seed: int
) -> MeanEstimate:
    """Estimate the discounted reward of a policy from a random root.

    A trial simulates beliefs, not states: each step earns the expected reward at the belief, and the trial
    continues with the discount as its probability, so that its undiscounted sum is an unbiased estimate
    without truncation. There are two control variates: the vectors' value at the root, less its mean; and
    that value plus the sum of its expected changes along the trial. Both have a known mean for any vectors,
    and regression removes the variance that they explain: all of it, if the vectors are exact.

    Args:
        graph: of the policy; it is not changed.
        roots: k of its nodes. weights: (k,) of each, up to a factor.
        trials: how many, from 4. confidence: of the interval. seed: an integer from 0.

    Source: control variates with regression: Owen, Monte Carlo theory, methods and examples, 2013, section
    8.9; the discount as survival: Derman, Finite state Markovian decision processes, 1970.
    """
    from scipy.special import stdtrit

    rollout = _BeliefRollout(graph, roots, weights, seed)
    rewards, corrected, initial = (np.concatenate(part) for part in zip(*rollout.blocks(trials), strict=True))
    mean_initial = float(weights @ _vector_values(graph, roots) / weights.sum())
    regressors = np.stack([np.ones(trials), initial - mean_initial, corrected], axis=1)
    coefficients = np.linalg.lstsq(regressors, rewards, rcond=1e-9)[0]
    residuals = rewards - regressors @ coefficients
    freedom = trials - regressors.shape[1]
    deviation = float(np.sqrt(residuals @ residuals / freedom))
    quantile = float(stdtrit(freedom, (1 + confidence) / 2))
    return MeanEstimate(float(coefficients[0]), quantile * deviation / trials**0.5)


class _BeliefRollout:
    """Trials over beliefs; all children of a belief are computed together."""

    def __init__(self, graph: BeliefGraph, roots: Indices, weights: Array, seed: int) -> None:
        self._pomdp, self._graph = graph.pomdp, graph.empty_copy()
        self._source, self._roots, self._rng = graph, roots, CounterRng(seed)
        count = np.array([0, len(weights)])
        self._root = InverseCdfSampler(count, np.arange(len(weights), dtype=np.int32), weights)
        step_size = len(self._pomdp.states) * mean_row_size(self._pomdp.observation)
        self._block = min(max(MAX_GRAPH_SIZE // step_size, 16), MAX_BLOCK_TRIALS)

    def blocks(self, trials: int) -> Iterator[tuple[Array, Array, Array]]:
        """Yield the rewards (n,) of each block's trials, and the vectors' value (n,) at their roots with and
        without the sum of its expected changes."""
        for first in range(0, trials, self._block):
            yield self._run(self._rng.trial_keys(first, min(self._block, trials - first)))

    def _run(self, keys: Words) -> tuple[Array, Array, Array]:
        root = self._root.draw(np.zeros(len(keys), dtype=np.intp), self._rng.uniforms(keys, 0))
        nodes = self._graph.import_nodes(self._source, self._roots[root])
        initial, rewards = _vector_values(self._graph, nodes), np.zeros(len(keys))
        corrected = initial.copy()
        trials = np.arange(len(keys))
        step = 0
        while True:
            running = np.flatnonzero(~self._graph.absorbing[nodes])
            trials, nodes = trials[running], nodes[running]
            if not len(trials):
                return rewards, corrected, initial
            reward, change, nodes = self._step(nodes, self._rng.uniforms(keys[trials], 2 * step + 1))
            rewards[trials] += reward
            corrected[trials] += change
            survives = self._rng.uniforms(keys[trials], 2 * step + 2) < self._pomdp.discount
            trials, nodes = trials[survives], nodes[survives]
            step += 1
            if self._graph.memory_size > MAX_GRAPH_SIZE:
                full, self._graph = self._graph, self._graph.empty_copy()
                nodes = self._graph.import_nodes(full, nodes)

    def _step(self, nodes: Indices, uniforms: Array) -> tuple[Array, Array, Indices]:
        """Return the expected rewards at nodes (n,), the expected change of the vectors' value, and the
        next nodes."""
        distinct, place = np.unique(nodes, return_inverse=True)
        parent, _, probability, child = self._graph.expand(distinct)
        begins = np.searchsorted(parent, np.append(distinct, len(self._graph)))
        ahead = segment_sum(
            np.searchsorted(distinct, parent), probability * _vector_values(self._graph, child), len(distinct)
        )
        change = self._pomdp.discount * ahead - _vector_values(self._graph, distinct)
        reward = self._graph.rewards(distinct)
        children = InverseCdfSampler(begins, child.astype(np.int32), probability).draw(place, uniforms)
        return reward[place], change[place], children


def _vector_values(graph: BeliefGraph, nodes: Indices) -> Array:
    """Return (k,) the value of the best vector at some nodes; 0 at absorbing nodes."""
    return np.where(graph.absorbing[nodes], 0.0, graph.values[nodes])
