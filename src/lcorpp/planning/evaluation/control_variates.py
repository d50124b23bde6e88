"""Monte Carlo estimate of a policy's value, with the policy's own vectors as control variates."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from lcorpp.planning.evaluation.belief_graph import BeliefGraph, mean_row_size
from lcorpp.planning.evaluation.budget import Budget
from lcorpp.planning.evaluation.sampling import CounterRng, InverseCdfSampler, Words
from lcorpp.planning.evaluation.sparse_beliefs import segment_sum
from lcorpp.values import Array, Indices

MAX_GRAPH_SIZE = 2**27
"""The trials' belief graph is cleared when it takes this many bytes; one step may add about as many."""

MAX_BLOCK_TRIALS, MIN_BLOCK_TRIALS = 2**10, 2**4
"""Maximal and minimal number of trials in a block, which are simulated in step."""

MAX_STEP_PRODUCTS = 2**25
"""Maximal number of products of vector and belief entries in one step of a block under a time limit."""

MIN_TRIALS = 4
"""Minimal number of trials of an estimate: the regression has three coefficients."""


class MeanEstimate(NamedTuple):
    """mean: of the discounted reward. low, high: its interval with `confidence`. trials: their number."""

    mean: float
    low: float
    high: float
    confidence: float
    trials: int


def estimate_value(
    graph: BeliefGraph,
    roots: Indices,
    weights: Array,
    *,
    trials: int,
    confidence: float,
    seed: int,
    state_bounds: tuple[Array, Array],
    budget: Budget,
    show: Callable[[int], None] | None = None,
) -> MeanEstimate | None:
    """Estimate the discounted reward of a policy from a random root.

    A trial simulates beliefs, not states: each step earns the expected reward at the belief, and the trial
    continues with the discount as its probability, so that its undiscounted sum is an unbiased estimate
    without truncation. There are two control variates: the vectors' value at the root, less its mean; and
    that value plus the sum of its expected changes along the trial. Both have a known mean for any vectors,
    and regression removes the variance that they explain: all of it, if the vectors are exact.

    A trial that the budget truncates contributes both bounds on its remaining reward, and the interval covers
    both. Leaving it out would bias the estimate towards short trials.

    Args:
        graph: of the policy; it is not changed.
        roots: k of its nodes. weights: (k,) of each, up to a factor.
        trials: how many, from 4. confidence: of the interval. seed: an integer from 0.
        state_bounds: (S,) lower and (S,) upper bounds on the value of any policy, by state.
        show: called with the number of trials after each block.

    Returns:
        None if the budget allows fewer than four trials.

    Source: control variates with regression: Owen, Monte Carlo theory, methods and examples, 2013, section
    8.9; the discount as survival: Derman, Finite state Markovian decision processes, 1970.
    """
    from scipy.special import stdtrit

    rollout = _BeliefRollout(graph, roots, weights, seed, state_bounds, budget)
    blocks, n = list[_Block](), 0
    for block in rollout.blocks(trials):
        blocks.append(block)
        n += len(block.initial)
        if show is not None:
            show(n)
    if n < MIN_TRIALS:
        return None
    low, high, corrected, initial = (np.concatenate(part) for part in zip(*blocks, strict=True))
    mean_initial = float(weights @ _vector_values(graph, roots) / weights.sum())
    regressors = np.stack([np.ones(n), initial - mean_initial, corrected], axis=1)
    quantile = float(stdtrit(n - regressors.shape[1], (1 + confidence) / 2))
    means, errors = zip(*(_regress(rewards, regressors) for rewards in (low, high)), strict=True)
    return MeanEstimate(
        mean=(means[0] + means[1]) / 2,
        low=means[0] - quantile * errors[0],
        high=means[1] + quantile * errors[1],
        confidence=confidence,
        trials=n,
    )


def _regress(rewards: Array, regressors: Array) -> tuple[float, float]:
    """Return the mean of the rewards (n,) by regression, and its standard error."""
    coefficients = np.linalg.lstsq(regressors, rewards, rcond=1e-9)[0]
    residuals = rewards - regressors @ coefficients
    n, k = regressors.shape
    return float(coefficients[0]), float(np.sqrt(residuals @ residuals / (n - k) / n))


class _Block(NamedTuple):
    """n trials. low, high: (n,) bounds on the reward, equal if the trial ended.

    corrected, initial: (n,) the vectors' value at the root with and without the sum of its expected changes.
    """

    low: Array
    high: Array
    corrected: Array
    initial: Array


class _BeliefRollout:
    """Trials over beliefs; all children of a belief are computed together."""

    def __init__(
        self,
        graph: BeliefGraph,
        roots: Indices,
        weights: Array,
        seed: int,
        state_bounds: tuple[Array, Array],
        budget: Budget,
    ) -> None:
        self._pomdp, self._graph = graph.pomdp, graph.empty_copy()
        self._source, self._roots, self._rng = graph, roots, CounterRng(seed)
        self._state_bounds, self._budget = state_bounds, budget
        count = np.array([0, len(weights)])
        self._root = InverseCdfSampler(count, np.arange(len(weights), dtype=np.int32), weights)
        size = 8 * len(self._pomdp.states) * mean_row_size(self._pomdp.observation)
        limit = MAX_GRAPH_SIZE // size
        if budget.is_limited:
            limit = min(limit, MAX_STEP_PRODUCTS // graph.expansion_products)
        self._block = min(max(limit, MIN_BLOCK_TRIALS), MAX_BLOCK_TRIALS)

    def blocks(self, trials: int) -> Iterator[_Block]:
        """Yield blocks of trials, until the budget is spent."""
        for first in range(0, trials, self._block):
            if self._budget.is_spent():
                return
            yield self._run(self._rng.trial_keys(first, min(self._block, trials - first)))

    def _run(self, keys: Words) -> _Block:
        root = self._root.draw(np.zeros(len(keys), dtype=np.intp), self._rng.uniforms(keys, 0))
        nodes = self._graph.import_nodes(self._source, self._roots[root])
        initial, low = _vector_values(self._graph, nodes), np.zeros(len(keys))
        corrected = initial.copy()
        trials = np.arange(len(keys))
        step = 0
        while True:
            running = np.flatnonzero(~self._graph.absorbing[nodes])
            trials, nodes = trials[running], nodes[running]
            if not len(trials) or self._budget.is_spent():
                break
            reward, change, nodes = self._step(nodes, self._rng.uniforms(keys[trials], 2 * step + 1))
            low[trials] += reward
            corrected[trials] += change
            survives = self._rng.uniforms(keys[trials], 2 * step + 2) < self._pomdp.discount
            trials, nodes = trials[survives], nodes[survives]
            step += 1
            if self._graph.memory_size > MAX_GRAPH_SIZE:
                full, self._graph = self._graph, self._graph.empty_copy()
                nodes = self._graph.import_nodes(full, nodes)
        high = low.copy()
        if len(trials):  # truncated: the control variate has mean 0 only if it is stopped at the last belief
            corrected[trials] -= _vector_values(self._graph, nodes)
            beliefs = self._graph.beliefs.take(nodes)
            for rewards, bound in zip((low, high), self._state_bounds, strict=True):
                rewards[trials] += beliefs.average(bound[beliefs.states])
        return _Block(low, high, corrected, initial)

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
