"""Scores of all sets of attributes, from which the score of any Bayesian network follows.

The score of an attribute with parents is f(parents and it) - f(parents), where f is a sum of logarithms of
the gamma function over the counts of the joint values (BDeu score: the probability of the data under a prior
of a few equivalent records). So networks that imply the same independences have the same score.

Source: Heckerman, Geiger and Chickering, Learning Bayesian networks, Machine Learning 20, 1995; Buntine,
Theory refinement on Bayesian networks, UAI 1991.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import gammaln

from lcorpp.values import Array, Indices

EQUIVALENT_RECORDS = 4.0
"""Strength of the prior: of 1, 4, 10 and the Bayesian information criterion the one whose probabilities of
edges agreed best with their frequencies, in random networks of five attributes and 50 to 1,000 records."""


def score_sets(rows: Indices, weights: Array, sizes: Sequence[int]) -> Array:
    """Return (2^n,) the score of each set of n attributes; bit i of an index is attribute i.

    rows: (M, n) indices of values. weights: (M,) how much each row counts.
    """
    n = len(sizes)
    scores = np.zeros(1 << n)

    def visit(first: int, members: int, codes: Indices, count: int, size: int) -> None:
        scores[members] = _summarise(np.bincount(codes, weights, count).astype(np.float64), size)
        for i in range(first, n):
            own = codes * sizes[i] + rows[:, i]
            total = count * sizes[i]
            if total > 4 * len(rows):
                found, own = np.unique(own, return_inverse=True)
                total = len(found)
            visit(i + 1, members | 1 << i, own, total, size * sizes[i])

    visit(0, 0, np.zeros(len(rows), dtype=np.intp), 1, 1)
    return scores


def _summarise(counts: Array, size: int) -> float:
    """Return the score of a set with `size` joint values, from the counts of those that occur."""
    own = EQUIVALENT_RECORDS / size
    return float((gammaln(counts + own) - gammaln(own)).sum())
