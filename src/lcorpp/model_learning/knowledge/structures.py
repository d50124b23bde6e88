"""Bayesian networks of the best score, and the probability of each edge among all networks.

A network of n attributes is scored by a set function, see `scores`. The best network follows by dynamic
programming over the sets of attributes: each has an attribute that no other one depends on. The same
programme sums over all networks, by inclusion and exclusion over these attributes; its terms stay within the
number of networks of the best one, so that they do not cancel. Probabilities of edges are its derivatives.

Source: Silander and Myllymäki, A simple approach for finding the globally optimal Bayesian network structure,
UAI 2006; Tian and He, Computing posterior probabilities of structural features in Bayesian networks, UAI
2009.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from lcorpp.values import Array, Indices

TIE = 1e-9
"""Scores of families that differ by less are equal, and those of networks that differ by this share."""

Parents = tuple[tuple[int, ...], ...]
"""The parents of each attribute, increasing."""


def find_best(scores: Array, before: Collection[tuple[int, int]] = ()) -> Parents:
    """Return the network of the best score; of equal ones, edges go from earlier attributes to later ones.

    scores: (2^n,) of the sets of n attributes, -inf for those that no attribute with parents may be.
    before: (i, j): the first is not after the second, in some order of all attributes in which edges go
    forwards.
    """
    n = len(scores).bit_length() - 1
    families = [_find_families(scores, j) for j in range(n)]
    best_sets = [_take_best(own, n) for own in families]
    after = _list_after(n, before)
    best, sinks = np.zeros(1 << n), np.zeros(1 << n, dtype=np.intp)
    tie = TIE * (1 + np.abs(scores[np.isfinite(scores)]).max())
    for members in range(1, 1 << n):
        best[members] = -np.inf
        for j in reversed(range(n)):
            if members >> j & 1 and not after[j] & members:
                rest = members ^ 1 << j
                score = best[rest] + families[j][best_sets[j][rest]]
                if score > best[members] + tie:
                    best[members], sinks[members] = score, j
    parents = list[tuple[int, ...]]([()] * n)
    members = (1 << n) - 1
    while members:
        j = int(sinks[members])
        members ^= 1 << j
        chosen = int(best_sets[j][members])
        parents[j] = tuple(i for i in range(n) if chosen >> i & 1)
    return tuple(parents)


def average_edges(scores: Array, before: Collection[tuple[int, int]] = ()) -> Array:
    """Return (n, n) the probability of each edge from i to j, if exp(score) is the weight of a network.

    scores, before: as of `find_best`.
    """
    n = len(scores).bit_length() - 1
    after = _list_after(n, before)
    sums = np.array([_sum_subsets(_find_families(scores, j), n) for j in range(n)])
    top, total, terms = np.zeros(1 << n), np.ones(1 << n), dict[int, tuple[Indices, Indices, Array]]()
    for members in range(1, 1 << n):
        last = _list_subsets(members)[1:]
        free = sum(1 << j for j in range(n) if members >> j & 1 and not after[j] & members)
        last = last[last & ~free == 0]
        rest = members ^ last
        logs, odd = top[rest].copy(), np.zeros(len(last), dtype=np.bool_)
        for j in range(n):
            chosen = (last >> j & 1).astype(np.bool_)
            logs[chosen] += sums[j][rest[chosen]]
            odd ^= chosen
        top[members] = logs.max()
        signed = np.where(odd, 1.0, -1.0) * np.exp(logs - top[members])
        total[members] = signed @ total[rest]
        terms[members] = last, rest, signed
    slopes, by_family = np.zeros(1 << n), np.zeros((n, 1 << n))
    slopes[-1] = 1 / total[-1]
    for members in range((1 << n) - 1, 0, -1):
        last, rest, signed = terms.pop(members)
        flow = slopes[members] * signed
        np.add.at(slopes, rest, flow)
        for j in range(n):
            chosen = (last >> j & 1).astype(np.bool_)
            np.add.at(by_family[j], rest[chosen], (flow * total[rest])[chosen])
    edges = np.zeros((n, n))
    everything = np.arange(1 << n)
    for j in range(n):
        for i in range(n):
            if i != j:
                own = np.where(everything >> i & 1, _find_families(scores, j), -np.inf)
                with np.errstate(invalid="ignore"):
                    share = np.exp(_sum_subsets(own, n) - sums[j])
                edges[i, j] = by_family[j] @ np.where(np.isfinite(share), share, 0.0)
    clipped: Array = np.clip(edges, 0.0, 1.0)
    return clipped


def _find_families(scores: Array, j: int) -> Array:
    """Return (2^n,) the score of attribute j with each set of parents; -inf where none is possible."""
    sets = np.arange(len(scores))
    possible = (sets >> j & 1 == 0) & np.isfinite(scores[sets | 1 << j])  # then that of the parents is finite
    found = np.full(len(scores), -np.inf)
    found[possible] = scores[sets[possible] | 1 << j] - scores[possible]
    return found


def _take_best(family: Array, n: int) -> Indices:
    """Return (2^n,) the best subset of each set; of equal ones a smaller one."""
    best = np.arange(1 << n)
    for i in range(n):
        pairs = best.reshape(-1, 2, 1 << i)
        without, within = pairs[:, 0], pairs[:, 1]
        is_better = family[within] > family[without] + TIE
        pairs[:, 1] = np.where(is_better, within, without)
    return best


def _sum_subsets(logs: Array, n: int) -> Array:
    """Return (2^n,) the logarithm of the sum over the subsets of each set."""
    sums = logs.copy()
    for i in range(n):
        pairs = sums.reshape(-1, 2, 1 << i)
        pairs[:, 1] = np.logaddexp(pairs[:, 0], pairs[:, 1])
    return sums


def _list_subsets(members: int) -> Indices:
    """Return all subsets of a set, the empty one first."""
    subsets = np.zeros(1, dtype=np.intp)
    while members:
        lowest = members & -members
        subsets = np.concatenate([subsets, subsets | lowest])
        members ^= lowest
    return subsets


def _list_after(n: int, before: Collection[tuple[int, int]]) -> list[int]:
    """Return for each attribute the set of those that come after it."""
    after = [0] * n
    for i, j in before:
        after[i] |= 1 << j
    return after
