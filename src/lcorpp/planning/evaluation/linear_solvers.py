"""x = b + M x for a sparse M whose columns add up to less than 1: how often each node of a graph is met."""

from __future__ import annotations

from typing import Any

import numpy as np

from lcorpp.values import Array

MOST_FACTORISED = 20_000
"""Nodes up to which factors are worth a try: where nodes are linked far and wide, they fill up."""

ACCURACY = 1e-12
"""How small what is left of b should be, by Euclid's measure."""


def solve_gmres(inner: Any, begin: Array) -> Array:
    """(n,) an approximate solution, by GMRES on sweeps along the graph.

    A sweep passes everything on from lower numbers to higher ones, which solves a graph without cycles at
    once; what goes round mixes the faster the more it is linked, and GMRES needs few sweeps.

    Args:
        inner: (n, n) sparse. begin: (n,).

    Source: Saad and Schultz, 1986; the sweep is that of Gauss and Seidel.
    """
    from scipy.sparse import eye_array, tril
    from scipy.sparse.linalg import LinearOperator, gmres, splu

    n = len(begin)
    equations = (eye_array(n) - inner).tocsc()
    forward = splu(tril(equations, format="csc"), permc_spec="NATURAL", diag_pivot_thresh=0.0)
    sweep = LinearOperator((n, n), forward.solve, dtype=np.float64)
    found, _ = gmres(equations, begin, M=sweep, rtol=ACCURACY, restart=40, maxiter=10)
    return np.asarray(found, dtype=np.float64)


def solve_lu(inner: Any, begin: Array) -> Array:
    """(n,) the solution by sparse LU factors.

    Where sweeps mix slowly, a graph is long and narrow, and its factors stay sparse.

    Args:
        inner: (n, n) sparse. begin: (n,).
    """
    from scipy.sparse import eye_array
    from scipy.sparse.linalg import splu

    solved = splu((eye_array(len(begin)) - inner).tocsc()).solve(begin)
    return np.asarray(solved, dtype=np.float64)
