"""Pruning: alpha vectors that are best nowhere are dropped, and what that costs is known.

Sources: Lark's algorithm, in White, A survey of solution techniques for the partially observed Markov
decision process, 1991; Cassandra, Littman and Zhang, Incremental pruning, UAI 1997, section 2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.planning.solvers.exact.dominance_lp import Margins, check, margins
from lcorpp.values import Array, Belief

BATCH = 384
"""Vectors whose programs are solved before the set that they are compared with is brought up to date."""

BLOCK = 1 << 22
"""Numbers worked on at once."""

INWARD = 1e-3
"""How far beliefs are moved inwards before the best vector is looked up: on the border many are equal."""

EQUAL = 1e-12
"""Values that differ by less than this share of the largest are equal."""

GOLDEN = 0.6180339887498949
"""Its multiples, modulo 1, lie evenly and never fall together."""

Indices = npt.NDArray[np.intp]


class Pruned(NamedTuple):
    """What is left of a set of vectors.

    rows: (k,) the vectors kept. witnesses: (k, S) for each a belief where it was best when it was chosen.
    loss: at no belief are those that were dropped further above those that were kept.
    """

    rows: Indices
    witnesses: Array
    loss: float


def prune(vectors: Array, beliefs: Array, *, tolerance: float, deadline: float = np.inf) -> Pruned:
    """Drop vectors that are nowhere above the others by more than a tolerance.

    Args:
        vectors: (K, S), at least one.
        beliefs: (n, S) where some may be best; there may be none.
        tolerance: what may be lost at any belief.
        deadline: on the monotonic clock.

    Raises:
        OutOfTime: the deadline passed first.
    """
    points = _inner(_with_corners(beliefs, vectors.shape[1]))
    rows, witnesses = _best_at(vectors, points, tolerance, deadline)
    others, loss = _not_below(vectors, np.setdiff1d(np.arange(len(vectors)), rows), rows, tolerance, deadline)
    while len(others):
        batch, waiting = others[:BATCH], others[BATCH:]
        near = np.concatenate([points, witnesses])
        margin = margins(vectors[batch], vectors[rows], near, tolerance=tolerance, deadline=deadline)
        below = margin.most <= tolerance
        loss = max(loss, float(margin.most[below].max(initial=0.0)))
        waiting = np.concatenate([batch[~below], waiting])
        chosen, where = _chosen(vectors, rows, batch, margin, waiting, tolerance)
        rows, witnesses = np.concatenate([rows, chosen]), np.concatenate([witnesses, where])
        others, lost = _not_below(vectors, np.setdiff1d(waiting, chosen), chosen, tolerance, deadline)
        loss = max(loss, lost)
    return Pruned(rows, witnesses, loss)


def excess(
    vectors: Array, others: Array, beliefs: Array, *, tolerance: float, deadline: float = np.inf
) -> float:
    """A bound on how far the best of some vectors is above the best of others at any belief, not below 0.

    It is above the truth by a tenth of it and the tolerance at most, unless rounding is worse than that.

    Args:
        vectors: (K, S). others: (m, S). beliefs: (n, S) where vectors may be best; there may be none.

    Raises:
        OutOfTime: the deadline passed first.
    """
    points = _inner(_with_corners(beliefs, vectors.shape[1]))
    gaps = (vectors @ points.T - (others @ points.T).max(axis=0)).max(axis=1)
    known, most = max(0.0, float(gaps.max())), 0.0
    waiting = np.argsort(-gaps, kind="stable")
    while len(waiting):
        batch, waiting = waiting[:BATCH], waiting[BATCH:]
        allowed = 1.1 * known + tolerance
        margin = margins(vectors[batch], others, points, tolerance=allowed, deadline=deadline)
        known = max(known, float(margin.least.max()))
        again = (margin.least > allowed) & (margin.most > 1.1 * known + tolerance)
        most = max(most, float(margin.most[~again].max(initial=0.0)))
        waiting = np.concatenate([waiting, batch[again]])
    return most


def _chosen(
    vectors: Array, rows: Indices, batch: Indices, margin: Margins, waiting: Indices, tolerance: float
) -> tuple[Indices, Array]:
    """The best of those that wait at each belief where one of the batch was found above those chosen before.

    A vector of which rounding leaves open where it is, is chosen itself: keeping it costs nothing.
    """
    open_ = (margin.most > tolerance) & (margin.least <= tolerance)
    chosen, where = batch[open_].tolist(), list(margin.beliefs[open_])
    candidates = vectors[waiting]
    for belief in margin.beliefs[margin.least > tolerance]:
        best = int(waiting[_best(candidates, belief)])
        level = float((vectors[rows] @ belief).max())
        if chosen:
            level = max(level, float((vectors[chosen] @ belief).max()))
        if best not in chosen and (not chosen or vectors[best] @ belief - level > tolerance):
            chosen.append(best)
            where.append(belief)
    return np.array(chosen, dtype=np.intp), np.array(where).reshape(-1, vectors.shape[1])


def _best(vectors: Array, belief: Belief) -> int:
    """The vector that is best at a belief and, of several, just inside of it."""
    values = vectors @ belief
    most = values.max()
    equal = np.flatnonzero(values >= most - EQUAL * max(1.0, abs(most)))
    return int(equal[(vectors[equal] @ _inner(belief[None])[0]).argmax()])


def _best_at(vectors: Array, points: Array, tolerance: float, deadline: float) -> tuple[Indices, Array]:
    """A few vectors that are best at all of some beliefs, to within a tolerance, the widest gap first."""
    best = np.empty(len(points))
    leader = np.empty(len(points), dtype=np.intp)
    step = max(1, BLOCK // len(vectors))
    for begin in range(0, len(points), step):
        check(deadline)
        values = points[begin : begin + step] @ vectors.T
        leader[begin : begin + step] = values.argmax(axis=1)
        best[begin : begin + step] = values.max(axis=1)
    rows, where = list[int](), list[int]()
    level = np.full(len(points), -np.inf)
    while True:
        i = int((best - level).argmax())
        if rows and best[i] - level[i] <= tolerance:
            return np.array(rows, dtype=np.intp), points[where]
        rows.append(int(leader[i]))
        where.append(i)
        # the leader itself is at its own best there, whatever the rounding of another product
        level = np.maximum(level, points @ vectors[leader[i]])
        level[i] = best[i]


def _not_below(
    vectors: Array, others: Indices, rows: Indices, tolerance: float, deadline: float
) -> tuple[Indices, float]:
    """Those of some vectors that none of `rows` alone dominates, and by how much any that is was above it."""
    if not len(rows):
        return others, 0.0
    chosen = vectors[rows]
    most = np.empty(len(others))
    step = max(1, BLOCK // max(1, chosen.size))
    for begin in range(0, len(others), step):
        check(deadline)
        part = vectors[others[begin : begin + step]]
        most[begin : begin + step] = (part[:, None, :] - chosen).max(axis=2).min(axis=1)
    below = most <= tolerance
    return others[~below], float(most[below].max(initial=0.0))


def _with_corners(beliefs: Array, states: int) -> Array:
    """The beliefs, those that know the state and the one that knows nothing."""
    return np.concatenate([np.eye(states), np.full((1, states), 1 / states), beliefs])


def _inner(beliefs: Array) -> Array:
    """(n, S) beliefs moved a little towards an inner one in which no two states are alike."""
    middle = 1 + np.arange(1, beliefs.shape[1] + 1) * GOLDEN % 1
    return np.asarray((1 - INWARD) * beliefs + INWARD * middle / middle.sum())
