"""Linear programs of pruning: where and by how much an alpha vector exceeds others.

The program of a vector v against vectors w maximises v.b - u over beliefs b and numbers u, subject to
u >= w.b for every w. Many small programs are solved as the blocks of one, because a call to the library costs
as much as many pivots. Each program contains only the w that matter: the most violated one is added until
none is violated.

No result depends on the tolerances of the library. A belief that it returns is scaled to sum to 1, and the
margin there is a lower bound. Its dual solution gives a mixture of the w; at no belief does v exceed the
mixture by more than at the best corner of the belief simplex: an upper bound.

Source: Cassandra, Littman and Zhang, UAI 1997, section 2.2 (the program).
"""

from __future__ import annotations

from time import monotonic
from typing import Any, NamedTuple

import numpy as np

from lcorpp.values import Array, Indices

MAX_PROGRAMS = 192
"""Programs solved in one call."""

INITIAL_RIVALS = 12
"""A program starts with the best vectors at this many beliefs, where its vector is closest to the best."""

MIN_DIVISOR = 1e-300
"""Replaces 0 as a divisor."""

LP_TOLERANCE = 1e-10
"""Tolerance passed to the library, the smallest that it accepts."""


class DeadlineExceeded(Exception):
    """The deadline has passed; the solvers catch it."""


def check_deadline(deadline: float) -> None:
    """Raise DeadlineExceeded if a deadline on the monotonic clock has passed."""
    if monotonic() >= deadline:
        raise DeadlineExceeded


class Margins(NamedTuple):
    """By how much vectors exceed others.

    beliefs: (n, S) where each vector exceeds the others most, as far as known.
    lower, upper: (n,) the margin at that belief, and a proven upper bound at all beliefs.
    """

    beliefs: Array
    lower: Array
    upper: Array


def dominance_margins(
    vectors: Array, others: Array, beliefs: Array, *, tolerance: float, deadline: float = np.inf
) -> Margins:
    """Compute how far each vector exceeds all of the others at any belief.

    The computation for a vector stops when its margin is known to be above the tolerance or not above it; if
    rounding leaves that open, only `upper` is above the tolerance.

    Args:
        vectors: (n, S). others: (m, S), at least one.
        beliefs: (k, S) where vectors are often best, at least one; the search starts there.
        tolerance: in the unit of the vectors.
        deadline: on the monotonic clock.

    Raises:
        DeadlineExceeded: the deadline passed.
    """
    n = len(vectors)
    margins = Margins(np.empty_like(vectors), np.full(n, -np.inf), np.full(n, np.inf))
    values = others @ beliefs.T
    best_other, best = values.argmax(axis=0), values.max(axis=0)
    active, rivals, waiting = np.zeros(0, dtype=np.intp), list[Indices](), np.arange(n)
    while len(active) or len(waiting):
        check_deadline(deadline)
        # waiting programs replace those that are settled
        free = MAX_PROGRAMS - len(active)
        new, waiting = waiting[:free], waiting[free:]
        shortfall = best - vectors[new] @ beliefs.T
        nearest = np.argsort(shortfall, axis=1, kind="stable")[:, :INITIAL_RIVALS]
        active, rivals = np.append(active, new), rivals + [np.unique(row) for row in best_other[nearest]]
        active, rivals = _solve_active(margins, vectors, others, active, rivals, tolerance)
    return margins


def _solve_active(
    margins: Margins, vectors: Array, others: Array, active: Indices, rivals: list[Indices], tolerance: float
) -> tuple[Indices, list[Indices]]:
    """Solve the active programs; return those that are not settled, with the missing rival added."""
    beliefs, upper = _solve(vectors[active], others, rivals)
    values = beliefs @ others.T
    lower = np.einsum("ns,ns->n", vectors[active], beliefs) - values.max(axis=1)
    better = lower > margins.lower[active]
    margins.beliefs[active[better]] = beliefs[better]
    margins.lower[active[better]] = lower[better]
    margins.upper[active] = np.minimum(margins.upper[active], upper)
    best_other = values.argmax(axis=1)
    unsettled = [
        i
        for i in np.flatnonzero((margins.lower[active] <= tolerance) & (margins.upper[active] > tolerance))
        if best_other[i] not in rivals[i]
    ]
    return active[unsettled], [np.append(rivals[i], best_other[i]) for i in unsettled]


def _solve(vectors: Array, others: Array, rivals: list[Indices]) -> tuple[Array, Array]:
    """Return (n, S) the beliefs that solve the programs, and (n,) the upper bounds of their duals."""
    n, S = vectors.shape
    sizes = np.array([len(rows) for rows in rivals])
    begins, block = np.cumsum(sizes) - sizes, np.repeat(np.arange(n), sizes)
    rows = others[np.concatenate(rivals)]
    beliefs, shares = _solve_programs(rows - vectors[block], block, begins)
    totals = beliefs.sum(axis=1, keepdims=True)
    beliefs = np.where(totals > 0, beliefs / np.maximum(totals, MIN_DIVISOR), 1 / S)
    weights = np.add.reduceat(shares, begins)
    shares = np.where(weights[block] > 0, shares / np.maximum(weights[block], MIN_DIVISOR), 1 / sizes[block])
    mixture = np.add.reduceat(shares[:, None] * rows, begins, axis=0)
    return beliefs, (vectors - mixture).max(axis=1)


def _solve_programs(differences: Array, block: Indices, begins: Indices) -> tuple[Array, Array]:
    """Solve n programs: minimise the maximum of differences.b over beliefs b.

    Args:
        differences: (m, S) each rival minus the vector. block: (m,) the program of each, rising.
        begins: (n,) index of the first rival of each program.

    Returns:
        (n, S) the beliefs and (m,) the shares of the rivals, not negative but not scaled to sum to 1.
    """
    from scipy.optimize import linprog
    from scipy.sparse import csr_array

    m, S = differences.shape
    n = len(begins)
    # scale all numbers to size 1, because the tolerances of the library are absolute
    scale = np.maximum.reduceat(np.maximum(np.abs(differences).max(axis=1), MIN_DIVISOR), begins)
    entries = np.concatenate([differences / scale[block][:, None], np.full((m, 1), -1.0)], axis=1)
    columns = block[:, None] * (S + 1) + np.arange(S + 1)
    above = csr_array((entries.ravel(), columns.ravel(), np.arange(m + 1) * (S + 1)), shape=(m, n * (S + 1)))
    inside = np.arange(n)[:, None] * (S + 1) + np.arange(S)
    sums = csr_array((np.ones(n * S), inside.ravel(), np.arange(n + 1) * S), shape=(n, n * (S + 1)))
    lowest = np.tile(np.append(np.zeros(S), -np.inf), n)
    # the published types of linprog accept neither sparse matrices nor an array of bounds
    solve: Any = linprog
    result = solve(
        np.tile(np.append(np.zeros(S), 1.0), n),
        A_ub=above,
        b_ub=np.zeros(m),
        A_eq=sums,
        b_eq=np.ones(n),
        bounds=np.stack([lowest, np.full(len(lowest), np.inf)], axis=1),
        method="highs",
        options={"primal_feasibility_tolerance": LP_TOLERANCE, "dual_feasibility_tolerance": LP_TOLERANCE},
    )
    if result.x is None or result.ineqlin.marginals is None:
        # the library failed: any belief and any mixture are valid, they only prove less
        return np.ones((n, S)), np.ones(m)
    beliefs = np.maximum(result.x.reshape(n, S + 1)[:, :S], 0.0)
    return beliefs, np.maximum(-result.ineqlin.marginals, 0.0)
