"""The Bayesian network of records: its structure, and with unknown values their expectation.

With unknown values, expectation-maximisation and the search for the best structure alternate (structural EM),
from several starts, in which some of the other attributes depend on the hidden ones.

Source: Friedman, The Bayesian structural EM algorithm, UAI 1998; Cheeseman and Stutz, Bayesian classification
(AutoClass): theory and results, 1996.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from itertools import combinations
from math import prod

import numpy as np

from lcorpp.model_learning.knowledge.cases import PSEUDO_RECORDS, Cases
from lcorpp.model_learning.knowledge.scores import score_sets
from lcorpp.model_learning.knowledge.structures import Parents, find_best
from lcorpp.values import Array, Indices

STARTS = 32
"""Maximum number of sets of attributes that begin as children of the hidden ones."""

CONNECTED_SHARE = 0.7
"""Share of the attributes that follow from the hidden ones in a start."""

SEARCHED_STARTS = 3
"""The best starts, from which structures are searched."""

STRUCTURES = 10
"""Maximum number of structures of one search."""

MAX_ITERATIONS = 2000
TOLERANCE = 1e-7
"""An expectation ends when the log likelihood of a record grows by less."""

Order = Collection[tuple[int, int]]
"""Pairs of attributes: the first is not after the second."""


@dataclass(frozen=True, eq=False)
class Network:
    """A structure and the completed rows under it.

    weights: (M,) expected number of records of each row. scores: (2^n,) of the sets of attributes, with these
    weights. score: logarithm of the probability of the records given the structure; with unknown values the
    approximation of Cheeseman and Stutz.
    """

    parents: Parents
    weights: Array
    scores: Array
    score: float


def learn_network(
    cases: Cases,
    order: Order,
    rng: np.random.Generator,
    progress: Callable[[float], None] = lambda _share: None,
) -> Network:
    """Return the network of the best score among those of the order."""
    if cases.is_complete:
        scores = score_sets(cases.rows, cases.repeats, cases.sizes)
        return _expect(cases, find_best(scores, order), cases.repeats)
    begins, starts = list(_list_begins(cases, order, rng)), list[Network]()
    begins = begins or [((),) * len(cases.names)]
    for number, begin in enumerate(begins):
        starts.append(_expect(cases, begin, _draw_weights(cases, rng)))
        progress(0.5 * (number + 1) / len(begins))
    starts.sort(key=lambda own: _rank(cases, own), reverse=True)
    best = starts[0]
    for number, start in enumerate(starts[:SEARCHED_STARTS]):
        found = _search(cases, start, order)
        best = max(best, found, key=lambda own: _rank(cases, own))
        progress(0.5 + 0.5 * (number + 1) / SEARCHED_STARTS)
    return best


def _search(cases: Cases, network: Network, order: Order) -> Network:
    """Return the best network of structural EM from one on."""
    best, seen = network, {network.parents}
    for _ in range(STRUCTURES):
        parents = find_best(network.scores, order)
        if parents in seen:
            break
        seen.add(parents)
        network = _expect(cases, parents, network.weights)
        best = max(best, network, key=lambda own: _rank(cases, own))
    return best


def _rank(cases: Cases, network: Network) -> tuple[bool, float]:
    """Return the order of networks: first those in which each hidden attribute relates others."""
    edges = [(i, j) for j, own in enumerate(network.parents) for i in own]
    hidden = [i for i, name in enumerate(cases.names) if name in cases.hidden]
    is_used = all(sum(i in edge for edge in edges) > 1 for i in hidden)
    return is_used, network.score


def _list_begins(cases: Cases, order: Order, rng: np.random.Generator) -> Iterator[Parents]:
    """Yield structures of the order from which unknown values are completed.

    An attribute whose values are known by likelihoods alone begins as found with equal values for all
    records, as a parent of all others, and as their child: without such edges the completed values would not
    depend on the others, and edges would not be found. Some attributes depend on the hidden ones alone.
    """
    numbers = range(len(cases.names))
    hidden = [i for i in numbers if cases.names[i] in cases.hidden]
    soft = [i for i in numbers if i not in hidden and i in cases.uncertain]
    known = [i for i in numbers if i not in hidden and i not in soft]
    weights, _ = cases.normalise(np.zeros(len(cases.rows)))
    found = find_best(score_sets(cases.rows, weights, cases.sizes), order)
    as_parent = tuple(
        tuple(soft[: soft.index(j)] if j in soft else () if j in hidden else soft) for j in numbers
    )
    as_child = tuple(tuple([*known, *soft[: soft.index(j)]] if j in soft else ()) for j in numbers)
    begins = [found]
    if soft:
        is_small = prod(cases.sizes[i] for i in (*known, *soft)) <= cases.count
        begins += [as_parent, *([as_child] if is_small else [])]
    for children in _list_children(cases, rng):
        for begin in begins:
            parents = [hidden if j in children else begin[j] for j in numbers]
            own = tuple(tuple(i for i in of_one if (j, i) not in order) for j, of_one in enumerate(parents))
            if _is_possible(own, order):
                yield own


def _list_children(cases: Cases, rng: np.random.Generator) -> list[frozenset[int]]:
    """Return sets of children of the hidden attributes: all of two or more others, or some by chance."""
    others = [i for i, name in enumerate(cases.names) if name not in cases.hidden]
    if not cases.hidden:
        return [frozenset()]
    if 2 ** len(others) <= STARTS:
        return [frozenset(own) for size in range(2, len(others) + 1) for own in combinations(others, size)]
    chosen = rng.random((STARTS, len(others))) < CONNECTED_SHARE
    return [frozenset(np.array(others)[own].tolist()) for own in chosen]


def _is_possible(parents: Parents, order: Order) -> bool:
    """Whether edges and order together have no circle."""
    before = [{*own, *(i for i, k in order if k == j)} for j, own in enumerate(parents)]
    left = set(range(len(parents)))
    while first := {j for j in left if not before[j] & left}:
        left -= first
    return not left


def _draw_weights(cases: Cases, rng: np.random.Generator) -> Array:
    """Return random weights: each value of a hidden attribute prefers some values of each other one."""
    logs = np.zeros(len(cases.rows))
    for i, name in enumerate(cases.names):
        if name in cases.hidden:
            for j in range(len(cases.names)):
                table = rng.normal(size=(cases.sizes[i], cases.sizes[j]))
                logs += table[cases.rows[:, i], cases.rows[:, j]] if i != j else 0.0
    return cases.normalise(logs)[0]


def _expect(cases: Cases, parents: Parents, weights: Array) -> Network:
    """Return the network at a maximum of the posterior density of its numbers."""
    families = [_Family(cases, j, own) for j, own in enumerate(parents)]
    last, log_likelihood = -np.inf, 0.0
    for _ in range(MAX_ITERATIONS):
        logs = sum((family.estimate(weights) for family in families), np.zeros(len(cases.rows)))
        weights, log_likelihood = cases.normalise(logs)
        if log_likelihood - last < TOLERANCE * cases.count:
            break
        last = log_likelihood
    logs = sum((family.estimate(weights) for family in families), np.zeros(len(cases.rows)))
    scores = score_sets(cases.rows, weights, cases.sizes)
    score = log_likelihood - float(weights @ logs)
    for j, own in enumerate(parents):
        given = sum(1 << i for i in own)
        family = float(scores[given | 1 << j])
        score += family - float(scores[given]) if np.isfinite(family) else -np.inf
    return Network(parents, weights, scores, score)


class _Family:
    """An attribute given its parents, in all rows."""

    def __init__(self, cases: Cases, attribute: int, parents: tuple[int, ...]) -> None:
        self._size = cases.sizes[attribute]
        codes: Indices = np.zeros(len(cases.rows), dtype=np.intp)
        for i in parents:
            codes = codes * cases.sizes[i] + cases.rows[:, i]
        found, self._given = np.unique(codes, return_inverse=True)
        self._own = self._given * self._size + cases.rows[:, attribute]
        self._count = len(found)

    def estimate(self, weights: Array) -> Array:
        """Return (M,) the logarithm of the estimated probability of the attribute in each row."""
        given = np.bincount(self._given, weights, self._count)
        own = np.bincount(self._own, weights, self._count * self._size)
        smoothed = own.reshape(-1, self._size) + PSEUDO_RECORDS / self._size
        logs: Array = np.log(smoothed / (given[:, None] + PSEUDO_RECORDS)).ravel()[self._own]
        return logs
