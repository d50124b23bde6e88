"""Pruning: drop alpha vectors that are best nowhere, with a proven bound on the loss.

Sources: Lark's algorithm, in White, A survey of solution techniques for the partially observed Markov
decision process, 1991; Cassandra, Littman and Zhang, Incremental pruning, UAI 1997, section 2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lcorpp.planning.solvers.exact.dominance_lp import Margins, check_deadline, dominance_margins
from lcorpp.values import Array, Belief, Indices

BATCH_SIZE = 384
"""Vectors whose programs are solved before the set of kept vectors is updated."""

CHUNK_SIZE = 1 << 22
"""Numbers processed at once."""

INWARD_SHIFT = 1e-3
"""Beliefs move this share inwards before the best vector is determined: on the border many are equal."""

TIE_TOLERANCE = 1e-12
"""Values count as equal if they differ by less than this share of the largest."""

GOLDEN_RATIO = 0.6180339887498949
"""Its multiples, modulo 1, are evenly spread and distinct."""


class Pruned(NamedTuple):
    """The result of pruning a set of vectors.

    rows: (k,) the kept vectors. witnesses: (k, S) for each a belief where it was best when it was chosen.
    loss: largest difference between the best dropped and the best kept vector at any belief.
    """

    rows: Indices
    witnesses: Array
    loss: float


def prune(vectors: Array, beliefs: Array, *, tolerance: float, deadline: float = np.inf) -> Pruned:
    """Drop vectors that do not exceed the others by more than a tolerance at any belief.

    Args:
        vectors: (K, S), at least one.
        beliefs: (n, S) where some may be best; may be empty.
        tolerance: largest loss at any belief.
        deadline: on the monotonic clock.

    Raises:
        DeadlineExceeded: the deadline passed.
    """
    points = _shift_inward(_add_corners(beliefs, vectors.shape[1]))
    rows, witnesses = _choose_best_at(vectors, points, tolerance, deadline)
    others, loss = _drop_dominated(
        vectors, np.setdiff1d(np.arange(len(vectors)), rows), rows, tolerance, deadline
    )
    while len(others):
        batch, waiting = others[:BATCH_SIZE], others[BATCH_SIZE:]
        near = np.concatenate([points, witnesses])
        margin = dominance_margins(
            vectors[batch], vectors[rows], near, tolerance=tolerance, deadline=deadline
        )
        dominated = margin.upper <= tolerance
        loss = max(loss, float(margin.upper[dominated].max(initial=0.0)))
        waiting = np.concatenate([batch[~dominated], waiting])
        chosen, where = _choose(vectors, rows, batch, margin, waiting, tolerance)
        rows, witnesses = np.concatenate([rows, chosen]), np.concatenate([witnesses, where])
        others, dropped_loss = _drop_dominated(
            vectors, np.setdiff1d(waiting, chosen), chosen, tolerance, deadline
        )
        loss = max(loss, dropped_loss)
    return Pruned(rows, witnesses, loss)


def excess(
    vectors: Array, others: Array, beliefs: Array, *, tolerance: float, deadline: float = np.inf
) -> float:
    """Compute an upper bound on how far the best of some vectors exceeds the best of others, not below 0.

    It exceeds the true value by at most a tenth of it plus the tolerance, unless rounding errors are larger.

    Args:
        vectors: (K, S). others: (m, S). beliefs: (n, S) where vectors may be best; may be empty.

    Raises:
        DeadlineExceeded: the deadline passed.
    """
    points = _shift_inward(_add_corners(beliefs, vectors.shape[1]))
    gaps = (vectors @ points.T - (others @ points.T).max(axis=0)).max(axis=1)
    lower, upper = max(0.0, float(gaps.max())), 0.0
    waiting = np.argsort(-gaps, kind="stable")
    while len(waiting):
        batch, waiting = waiting[:BATCH_SIZE], waiting[BATCH_SIZE:]
        allowed = 1.1 * lower + tolerance
        margin = dominance_margins(vectors[batch], others, points, tolerance=allowed, deadline=deadline)
        lower = max(lower, float(margin.lower.max()))
        again = (margin.lower > allowed) & (margin.upper > 1.1 * lower + tolerance)
        upper = max(upper, float(margin.upper[~again].max(initial=0.0)))
        waiting = np.concatenate([waiting, batch[again]])
    return upper


def _choose(
    vectors: Array, rows: Indices, batch: Indices, margin: Margins, waiting: Indices, tolerance: float
) -> tuple[Indices, Array]:
    """Choose the best waiting vector at each belief where a vector of the batch exceeds the kept ones.

    If rounding leaves open whether a vector exceeds them, that vector itself is chosen: keeping it is safe.
    """
    undecided = (margin.upper > tolerance) & (margin.lower <= tolerance)
    chosen, where = batch[undecided].tolist(), list(margin.beliefs[undecided])
    candidates = vectors[waiting]
    for belief in margin.beliefs[margin.lower > tolerance]:
        best = int(waiting[_find_best(candidates, belief)])
        reached = float((vectors[rows] @ belief).max())
        if chosen:
            reached = max(reached, float((vectors[chosen] @ belief).max()))
        if best not in chosen and (not chosen or vectors[best] @ belief - reached > tolerance):
            chosen.append(best)
            where.append(belief)
    return np.array(chosen, dtype=np.intp), np.array(where).reshape(-1, vectors.shape[1])


def _find_best(vectors: Array, belief: Belief) -> int:
    """Return the best vector at a belief; among equal ones, the best at a belief slightly inward."""
    values = vectors @ belief
    largest = values.max()
    equal = np.flatnonzero(values >= largest - TIE_TOLERANCE * max(1.0, abs(largest)))
    return int(equal[(vectors[equal] @ _shift_inward(belief[None])[0]).argmax()])


def _choose_best_at(
    vectors: Array, points: Array, tolerance: float, deadline: float
) -> tuple[Indices, Array]:
    """Choose a few vectors that are best at all points to within a tolerance, the largest gap first."""
    best = np.empty(len(points))
    winner = np.empty(len(points), dtype=np.intp)
    step = max(1, CHUNK_SIZE // len(vectors))
    for begin in range(0, len(points), step):
        check_deadline(deadline)
        values = points[begin : begin + step] @ vectors.T
        winner[begin : begin + step] = values.argmax(axis=1)
        best[begin : begin + step] = values.max(axis=1)
    rows, where = list[int](), list[int]()
    level = np.full(len(points), -np.inf)
    while True:
        i = int((best - level).argmax())
        if rows and best[i] - level[i] <= tolerance:
            return np.array(rows, dtype=np.intp), points[where]
        rows.append(int(winner[i]))
        where.append(i)
        # the winner itself is best there, independent of the rounding of another product
        level = np.maximum(level, points @ vectors[winner[i]])
        level[i] = best[i]


def _drop_dominated(
    vectors: Array, others: Indices, rows: Indices, tolerance: float, deadline: float
) -> tuple[Indices, float]:
    """Drop the vectors that a single one of `rows` dominates; return the rest and the largest loss."""
    if not len(rows):
        return others, 0.0
    chosen = vectors[rows]
    margin = np.empty(len(others))
    step = max(1, CHUNK_SIZE // max(1, chosen.size))
    for begin in range(0, len(others), step):
        check_deadline(deadline)
        part = vectors[others[begin : begin + step]]
        margin[begin : begin + step] = (part[:, None, :] - chosen).max(axis=2).min(axis=1)
    dominated = margin <= tolerance
    return others[~dominated], float(margin[dominated].max(initial=0.0))


def _add_corners(beliefs: Array, states: int) -> Array:
    """Return the beliefs, the corners and the uniform belief."""
    return np.concatenate([np.eye(states), np.full((1, states), 1 / states), beliefs])


def _shift_inward(beliefs: Array) -> Array:
    """Return (n, S) beliefs moved slightly towards an inner belief with distinct probabilities."""
    centre = 1 + np.arange(1, beliefs.shape[1] + 1) * GOLDEN_RATIO % 1
    return np.asarray((1 - INWARD_SHIFT) * beliefs + INWARD_SHIFT * centre / centre.sum())
