"""The rules of an attribute: values of its parents that the data do not distinguish share one.

The rules are the leaves of a tree whose nodes ask whether a parent has a value. It is grown until all
observed values of the parents are distinguished, and pruned: a node remains if the data are more probable
with it, each rule having a prior of `PSEUDO_RECORDS` records of equal values.

Source: Friedman and Goldszmidt, Learning Bayesian networks with local structure, UAI 1996.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from lcorpp.model_learning.knowledge.cases import PSEUDO_RECORDS, Cases
from lcorpp.values import Array, Indices


@dataclass(frozen=True, eq=False)
class Rule:
    """The distribution of an attribute in a context.

    context: parent -> the values that it may have; parents with all values are left out.
    counts: (r,) expected number of records with each value of the attribute.
    """

    context: dict[int, frozenset[int]]
    counts: Array


def find_rules(cases: Cases, weights: Array, attribute: int, parents: Sequence[int]) -> list[Rule]:
    """Return the rules of an attribute, which exclude each other and together apply always.

    weights: (M,) of the completed rows.
    """
    size = cases.sizes[attribute]
    given, places = np.unique(cases.rows[:, parents], axis=0, return_inverse=True)
    counts = np.zeros((len(given), size))
    np.add.at(counts, (places.reshape(-1), cases.rows[:, attribute]), weights)
    ranges = [frozenset(range(cases.sizes[i])) for i in parents]
    _, leaves = _split(given, counts, ranges)
    leaves.sort(key=lambda leaf: [sorted(own) for own in leaf[0]])
    return [
        Rule({i: own for i, own, all_of in zip(parents, context, ranges, strict=True) if own != all_of}, sums)
        for context, sums in leaves
    ]


_Leaves = list[tuple[list[frozenset[int]], Array]]


def _split(given: Indices, counts: Array, context: list[frozenset[int]]) -> tuple[float, _Leaves]:
    """Return the score of the best tree for some values of the parents, and its leaves.

    given: (q, parents). counts: (q, r).
    """
    total = counts.sum(axis=0)
    score, leaves = _measure(total), [(context, total)]
    best, place = -np.inf, (0, 0)
    for p, own in enumerate(context):
        for value in sorted(own) if len(own) > 1 else ():
            chosen = given[:, p] == value
            if chosen.any() and not chosen.all():
                gain = _measure(counts[chosen].sum(axis=0)) + _measure(counts[~chosen].sum(axis=0))
                if gain > best:
                    best, place = gain, (p, value)
    if best == -np.inf:
        return score, leaves
    p, value = place
    chosen = given[:, p] == value
    scores, parts = 0.0, _Leaves()
    for rows, kept in ((chosen, frozenset([value])), (~chosen, context[p] - {value})):
        inner = [*context[:p], kept, *context[p + 1 :]]
        own_score, own_leaves = _split(given[rows], counts[rows], inner)
        scores, parts = scores + own_score, parts + own_leaves
    return (scores, parts) if scores > score else (score, leaves)


def _measure(counts: Array) -> float:
    """Return the logarithm of the probability of values with these counts under one rule."""
    own = PSEUDO_RECORDS / len(counts)
    first = gammaln(PSEUDO_RECORDS) - gammaln(PSEUDO_RECORDS + counts.sum())
    return float(first + (gammaln(counts + own) - gammaln(own)).sum())
