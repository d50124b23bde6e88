"""Where one alpha vector rises above others, and by how much at most: the linear programs of pruning.

The program of a vector v against vectors w is: over beliefs b and numbers u, the most of v.b - u with
u >= w.b for every w. Many small programs are solved together as the blocks of one, for the cost of a call to
the library is that of many pivots; and each is given only those w that matter, found by adding the one that
is violated most.

Nothing depends on the tolerances of the library. A belief that it finds is scaled to sum to 1 and the margin
worked out there: a bound from below. From its dual solution a mixture of the w is made, and no belief can lie
further above the mixture than the best corner: a bound from above.

Source: Cassandra, Littman and Zhang, UAI 1997, section 2.2 (the program).
"""

from __future__ import annotations

from time import monotonic
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lcorpp.values import Array

TOGETHER = 192
"""Programs solved in one call."""

NEAREST = 12
"""Vectors that a program begins with, chosen by the beliefs where its vector comes closest to the best."""

TINY = 1e-300
"""Keeps a division from being one by 0."""

FINE = 1e-10
"""Tolerance that the library is asked for; the least that it takes."""

Indices = npt.NDArray[np.intp]


class OutOfTime(Exception):
    """The deadline has passed; the solvers catch it."""


def check(deadline: float) -> None:
    """Raise OutOfTime if a deadline on the monotonic clock has passed."""
    if monotonic() >= deadline:
        raise OutOfTime


class Margins(NamedTuple):
    """How far vectors rise above others.

    beliefs: (n, S) where each rises most, as far as is known. least: (n,) how far it rises there.
    most: (n,) it rises nowhere further, proven.
    """

    beliefs: Array
    least: Array
    most: Array


def margins(
    vectors: Array, others: Array, beliefs: Array, *, tolerance: float, deadline: float = np.inf
) -> Margins:
    """How far each of some vectors rises above all of the others anywhere in the space of beliefs.

    A vector is looked at until its margin is known to be above the tolerance, or not to be; where rounding
    leaves that open, `most` alone is above it.

    Args:
        vectors: (n, S). others: (m, S), at least one.
        beliefs: (k, S) where vectors are often best, at least one; the search begins there.
        tolerance: in the vectors' unit.
        deadline: on the monotonic clock.

    Raises:
        OutOfTime: the deadline passed first.
    """
    found = Margins(np.empty_like(vectors), np.full(len(vectors), -np.inf), np.full(len(vectors), np.inf))
    level = others @ beliefs.T
    leader, best = level.argmax(axis=0), level.max(axis=0)
    part, rivals, waiting = np.zeros(0, dtype=np.intp), list[Indices](), np.arange(len(vectors))
    while len(part) or len(waiting):
        check(deadline)
        # programs that are settled make room for others
        room = TOGETHER - len(part)
        new, waiting = waiting[:room], waiting[room:]
        short = best - vectors[new] @ beliefs.T
        near = np.argsort(short, axis=1, kind="stable")[:, :NEAREST]
        part, rivals = np.append(part, new), rivals + [np.unique(row) for row in leader[near]]
        part, rivals = _advanced(found, vectors, others, part, rivals, tolerance)
    return found


def _advanced(
    found: Margins, vectors: Array, others: Array, part: Indices, rivals: list[Indices], tolerance: float
) -> tuple[Indices, list[Indices]]:
    """Solve the programs of some vectors; those that are not settled, with the rival that was overlooked."""
    beliefs, most = _solve(vectors[part], others, rivals)
    level = beliefs @ others.T
    above = np.einsum("ns,ns->n", vectors[part], beliefs) - level.max(axis=1)
    better = above > found.least[part]
    found.beliefs[part[better]] = beliefs[better]
    found.least[part[better]] = above[better]
    found.most[part] = np.minimum(found.most[part], most)
    leader = level.argmax(axis=1)
    open_ = [
        i
        for i in np.flatnonzero((found.least[part] <= tolerance) & (found.most[part] > tolerance))
        if leader[i] not in rivals[i]
    ]
    return part[open_], [np.append(rivals[i], leader[i]) for i in open_]


def _solve(vectors: Array, others: Array, rivals: list[Indices]) -> tuple[Array, Array]:
    """(n, S) the beliefs that solve the programs, and (n,) what their duals prove."""
    n, S = vectors.shape
    sizes = np.array([len(rows) for rows in rivals])
    begins, block = np.cumsum(sizes) - sizes, np.repeat(np.arange(n), sizes)
    rows = others[np.concatenate(rivals)]
    beliefs, shares = _programs(rows - vectors[block], block, begins)
    totals = beliefs.sum(axis=1, keepdims=True)
    beliefs = np.where(totals > 0, beliefs / np.maximum(totals, TINY), 1 / S)
    weights = np.add.reduceat(shares, begins)
    shares = np.where(weights[block] > 0, shares / np.maximum(weights[block], TINY), 1 / sizes[block])
    mixture = np.add.reduceat(shares[:, None] * rows, begins, axis=0)
    return beliefs, (vectors - mixture).max(axis=1)


def _programs(lower: Array, block: Indices, begins: Indices) -> tuple[Array, Array]:
    """Solve n programs: over beliefs b, the least of the most of lower.b.

    Args:
        lower: (m, S) by how much each rival is above the vector. block: (m,) the program of each, rising.
        begins: (n,) where the rivals of each begin.

    Returns:
        (n, S) the beliefs and (m,) the shares of the rivals, not below 0 but not scaled to sum to 1.
    """
    from scipy.optimize import linprog
    from scipy.sparse import csr_array

    m, S = lower.shape
    n = len(begins)
    # all numbers are brought to size 1, for the library's tolerances are absolute
    scale = np.maximum.reduceat(np.maximum(np.abs(lower).max(axis=1), TINY), begins)
    entries = np.concatenate([lower / scale[block][:, None], np.full((m, 1), -1.0)], axis=1)
    columns = block[:, None] * (S + 1) + np.arange(S + 1)
    above = csr_array((entries.ravel(), columns.ravel(), np.arange(m + 1) * (S + 1)), shape=(m, n * (S + 1)))
    inside = np.arange(n)[:, None] * (S + 1) + np.arange(S)
    sums = csr_array((np.ones(n * S), inside.ravel(), np.arange(n + 1) * S), shape=(n, n * (S + 1)))
    lowest = np.tile(np.append(np.zeros(S), -np.inf), n)
    # the published types of linprog know neither sparse matrices nor an array of bounds
    solve: Any = linprog
    result = solve(
        np.tile(np.append(np.zeros(S), 1.0), n),
        A_ub=above,
        b_ub=np.zeros(m),
        A_eq=sums,
        b_eq=np.ones(n),
        bounds=np.stack([lowest, np.full(len(lowest), np.inf)], axis=1),
        method="highs",
        options={"primal_feasibility_tolerance": FINE, "dual_feasibility_tolerance": FINE},
    )
    if result.x is None or result.ineqlin.marginals is None:
        # it has given up: any belief and any mixture do, they only prove less
        return np.ones((n, S)), np.ones(m)
    beliefs = np.maximum(result.x.reshape(n, S + 1)[:, :S], 0.0)
    return beliefs, np.maximum(-result.ineqlin.marginals, 0.0)
