"""Discounted occupancy of the beliefs that a policy reaches: expected discounted visits, hence its value."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from lcorpp.planning.evaluation.belief_graph import BeliefGraph
from lcorpp.planning.evaluation.budget import Budget
from lcorpp.values import Array, Indices

MAX_SLICE_PRODUCTS = 2**28
"""Maximal number of products of vector and belief entries between two checks of the limits."""

EXPANSION_SHARE = 0.4
"""Share of the time limit that the expansion may use; the trials use the rest."""

MIN_BATCH = 256
"""Beliefs are expanded in batches of at most this many, plus a quarter of those that are known."""

MIN_EXPANDED = 100
"""Beliefs that are expanded whatever the time limit, if there are as many."""

MAX_PATH_WIDTH = 2
"""Up to this many new beliefs are expanded at once, without ranking them first."""

MAX_PUSHES = 50
"""The maximal number of pushes before more beliefs are expanded."""

MAX_FACTORISED = 5_000
"""The maximal number of nodes for a sparse LU factorisation: its fill-in takes at most 300 MB."""

GMRES_TOLERANCE, MAX_RESTARTS = 1e-12, 10
"""Relative residual at which GMRES stops; maximal number of its cycles of 40 steps."""

SOLUTION_SHARE = 0.6
"""Share of the time limit after which GMRES starts no further cycle."""


class DiscountedOccupancy:
    """Expected discounted visits of the beliefs of a graph, pushed from the root to the children.

    At any time, the value at the root is the sum over nodes of visits times expected reward, plus the sum
    over nodes of residual times value. The residual is the visits that are not pushed to the children yet; at
    its nodes only bounds on the value are known.

    graph: of the beliefs. budget: at its limits the expansion ends.
    visits, residual: (n,) by node; `residual` may contain rounding errors of either sign.

    Source: the dual of policy evaluation (Puterman, 1994, section 6.9), with pushes as in Andersen, Chung and
    Lang, Local graph partitioning using PageRank vectors, 2006.
    """

    def __init__(
        self, graph: BeliefGraph, root: int, low: Array, high: Array, budget: Budget | None = None
    ) -> None:
        self.graph, self._budget = graph, Budget() if budget is None else budget
        self._root, self._state_bounds = root, (low, high)
        self.visits, self.residual = np.zeros(0), np.zeros(0)
        self._expanded = np.zeros(0, dtype=bool)
        self._rewards, self._low, self._high = np.zeros(0), np.zeros(0), np.zeros(0)
        none = np.zeros(0, dtype=np.intp)
        self._edges: tuple[Indices, Indices, Array] = none, none, np.zeros(0)
        self._append_new_nodes()
        self._update_matrix()
        self.residual[root] = 1.0

    @property
    def expanded(self) -> int:
        """The number of expanded beliefs, including absorbing ones."""
        return int(np.count_nonzero(self._expanded))

    @property
    def complete(self) -> bool:
        """Whether all reachable beliefs are expanded."""
        return bool(self._expanded.all())

    @property
    def coverage(self) -> float:
        """Share of the discounted future, in [0, 1], before the policy leaves the expanded beliefs."""
        return 1.0 - float(np.maximum(self.residual[~self._expanded], 0.0).sum())

    @property
    def memory_size(self) -> int:
        """Bytes of the graph and the edges; arrays are copied when they grow or are sorted."""
        edges = sum(column.nbytes for column in self._edges)
        return 2 * self.graph.memory_size + 4 * edges

    def expand(self, precision: float, max_nodes: int, show: Callable[[], None] = lambda: None) -> None:
        """Expand beliefs until the bounds differ by less than `precision` or a limit is reached.

        Args:
            show: called after each expansion.
        """
        while True:
            for _ in range(MAX_PUSHES):
                inside, outside = self._gaps()
                if inside <= 0.1 * max(outside, precision) or self._is_spent():
                    break
                self._push()
            if self._gaps()[1] <= 0.9 * precision:
                self._solve(precision)
            if len(self.graph) >= max_nodes or self._gaps()[1] <= 0.9 * precision or self._is_spent():
                break
            show()
            gaps = self.residual * (self._high - self._low)
            self._expand_nodes(np.where(self._expanded, 0.0, gaps), max_nodes)
        self._solve(precision)

    def expected_reward(self) -> float:
        """Return the discounted reward of the pushed visits."""
        return float(self.visits @ self._rewards)

    def bounds(self) -> tuple[float, float]:
        """Return bounds on the value at the root."""
        positive, negative = np.maximum(self.residual, 0.0), np.minimum(self.residual, 0.0)
        reward = self.expected_reward()
        return (
            reward + float(positive @ self._low + negative @ self._high),
            reward + float(positive @ self._high + negative @ self._low),
        )

    def shortfalls(self) -> Array:
        """Return (n,) the visits of each expanded node times its vector's value less its one-step backup.

        The backup is the expected reward plus the discounted values of the vectors at the children.
        """
        values = np.where(self.graph.absorbing, 0.0, self.graph.values)
        backups = self._rewards + self._push_matrix.T @ values
        return np.where(self._expanded, self.visits * (values - backups), 0.0)

    def _is_spent(self) -> bool:
        at_minimum = np.count_nonzero(self._expanded) >= MIN_EXPANDED
        return self._budget.is_spent(self.memory_size, share=EXPANSION_SHARE, at_minimum=bool(at_minimum))

    def _gaps(self) -> tuple[float, float]:
        """Return the gap between the bounds due to the residual at expanded nodes, and at other nodes."""
        gaps = self.residual * (self._high - self._low)
        inside = float(gaps[self._expanded].sum())
        return inside, float(gaps.sum()) - inside

    def _expand_nodes(self, gaps: Array, max_nodes: int) -> None:
        """Expand the beliefs with the largest gaps, up to half of the total, and narrow paths below them."""
        order = np.argsort(-gaps, kind="stable")
        sums = np.cumsum(gaps[order])
        count = 1 + int(np.searchsorted(sums, 0.5 * sums[-1]))
        limit = MIN_BATCH + len(self._expanded) // 4
        nodes = np.sort(order[: min(count, max_nodes, limit)])
        edges = [self._edges]
        while True:
            before, count = len(self.graph), 0
            for part in self._slice(nodes):
                parent, _, probability, child = self.graph.expand(part)
                edges.append((parent, child, probability))
                self._expanded[part] = True
                count += len(part)
                if self._is_spent():
                    break
            self._append_new_nodes()
            # a narrow path is expanded further; wider sets of beliefs are ranked first
            nodes, limit = np.flatnonzero(~self._expanded[before:]) + before, limit - count
            full = len(self.graph) >= max_nodes or self._is_spent()
            if full or not 0 < len(nodes) <= min(MAX_PATH_WIDTH, limit):
                break
        parents, children, probabilities = (np.concatenate(column) for column in zip(*edges, strict=True))
        self._edges = parents, children, probabilities
        self._update_matrix()

    def _slice(self, nodes: Indices) -> list[Indices]:
        """Split nodes (k,) into slices of at most `MAX_SLICE_PRODUCTS`, but at least one node."""
        step = max(1, MAX_SLICE_PRODUCTS // self.graph.expansion_products)
        return [nodes[begin : begin + step] for begin in range(0, len(nodes), step)]

    def _append_new_nodes(self) -> None:
        """Extend all arrays to the new nodes of the graph."""
        begin, n = len(self._expanded), len(self.graph)
        beliefs = self.graph.beliefs.take(np.arange(begin, n))
        absorbing = self.graph.absorbing[begin:]
        low, high = (
            np.where(absorbing, 0.0, beliefs.average(bound[beliefs.states])) for bound in self._state_bounds
        )
        self._rewards = np.concatenate([self._rewards, self.graph.rewards(np.arange(begin, n))])
        self._low, self._high = np.concatenate([self._low, low]), np.concatenate([self._high, high])
        self._expanded = np.concatenate([self._expanded, absorbing])
        zeros = np.zeros(n - begin)
        self.visits = np.concatenate([self.visits, zeros])
        self.residual = np.concatenate([self.residual, zeros])

    def _update_matrix(self) -> None:
        """Build the matrix (n, n) of discounted transition probabilities, from column to row."""
        from scipy.sparse import csr_array

        owner, child, probability = self._edges
        n = len(self._expanded)
        entries = self.graph.pomdp.discount * probability
        self._push_matrix = csr_array((entries, (child, owner)), shape=(n, n))

    def _push(self) -> None:
        """Move the residual of all expanded nodes to their visits and their children's residual."""
        moved = np.where(self._expanded, self.residual, 0.0)
        self.visits += moved
        self.residual = self.residual - moved + self._push_matrix @ moved

    def _solve(self, precision: float) -> None:
        """Solve visits = root + gamma P' visits on the expanded nodes, so that their residual vanishes.

        The residual is computed from the solution, rounding included: the bounds hold for any solution.
        """
        expanded = np.flatnonzero(self._expanded)
        begin = np.zeros(len(self._expanded))
        begin[self._root] = 1.0
        solvers = (partial(solve_gmres, budget=self._budget), solve_lu)
        for solve in solvers[: 1 if len(expanded) > MAX_FACTORISED else 2]:
            before = self.visits, self.residual, self._gaps()[0]
            if before[2] <= 0.05 * precision:
                return
            self.visits = np.zeros(len(begin))
            matrix = self._push_matrix[expanded][:, expanded]
            self.visits[expanded] = solve(matrix, begin[expanded])
            self.residual = begin - self.visits + self._push_matrix @ self.visits
            if not abs(self._gaps()[0]) <= before[2]:
                self.visits, self.residual, _ = before


def solve_gmres(matrix: Any, begin: Array, budget: Budget | None = None) -> Array:
    """Return (n,) an approximate solution of x = begin + matrix x by GMRES, preconditioned by a sweep.

    A Gauss-Seidel sweep in the order of the nodes solves an acyclic graph exactly. The iteration ends when
    the budget is spent.

    Args:
        matrix: (n, n) sparse, with column sums below 1. begin: (n,).

    Source: Saad and Schultz, 1986.
    """
    from scipy.sparse import eye_array, tril
    from scipy.sparse.linalg import LinearOperator, gmres, splu

    n = len(begin)
    equations = (eye_array(n) - matrix).tocsc()
    forward = splu(tril(equations, format="csc"), permc_spec="NATURAL", diag_pivot_thresh=0.0)
    sweep = LinearOperator((n, n), forward.solve, dtype=np.float64)
    solution: Any = np.zeros(n)
    for _ in range(MAX_RESTARTS):
        solution, is_open = gmres(
            equations, begin, solution, M=sweep, rtol=GMRES_TOLERANCE, restart=40, maxiter=1
        )
        if not is_open or (budget is not None and budget.is_spent(share=SOLUTION_SHARE)):
            break
    return np.asarray(solution, dtype=np.float64)


def solve_lu(matrix: Any, begin: Array) -> Array:
    """Return (n,) the solution of x = begin + matrix x by sparse LU factorisation.

    GMRES converges slowly on long and narrow graphs, whose factors are sparse. Arguments as `solve_gmres`.
    """
    from scipy.sparse import eye_array
    from scipy.sparse.linalg import splu

    solution = splu((eye_array(len(begin)) - matrix).tocsc()).solve(begin)
    return np.asarray(solution, dtype=np.float64)
