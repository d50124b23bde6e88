"""How often a policy meets each belief, discounted: from that follows what it earns."""

from __future__ import annotations

import numpy as np

from lcorpp.planning.evaluation.belief_graph import BeliefGraph
from lcorpp.planning.evaluation.linear_solvers import MOST_FACTORISED, solve_gmres, solve_lu
from lcorpp.planning.evaluation.sparse_beliefs import Indices
from lcorpp.values import Array

MOST_NUMBERS = 2**26
"""Numbers that the belief graph may keep."""

ROUND = 256
"""Beliefs that are worked out at a time, and a quarter of those that are known in addition."""

NARROW = 2
"""A path of so many beliefs side by side is followed without being weighed at each step."""

PASSES = 50
"""Times that visits are passed on before more beliefs are worked out."""


class DiscountedOccupancy:
    """Discounted visits of the beliefs of a graph, passed on from the root to the children.

    At any time, the value at the root is the sum over nodes of visits times the mean reward there, plus the
    sum of the visits left times the value there: visits are left where they have not been passed on, and
    the value there is known by its bounds alone.

    graph: whose beliefs they are.
    visits, left: (n,) by node; `left` may hold rounding of either sign.

    Source: the dual of policy evaluation (Puterman, 1994, section 6.9), passed on as in Andersen, Chung and
    Lang, Local graph partitioning using PageRank vectors, 2006.
    """

    def __init__(self, graph: BeliefGraph, root: int, low: Array, high: Array) -> None:
        self.graph = graph
        self._root, self._range = root, (low, high)
        self.visits, self.left = np.zeros(0), np.zeros(0)
        self._worked = np.zeros(0, dtype=bool)
        self._paid, self._low, self._high = np.zeros(0), np.zeros(0), np.zeros(0)
        none = np.zeros(0, dtype=np.intp)
        self._edges: tuple[Indices, Indices, Array] = none, none, np.zeros(0)
        self._note_new()
        self._link()
        self.left[root] = 1.0

    @property
    def expanded(self) -> int:
        """How many beliefs were worked out, those of which nothing is left to work out included."""
        return int(np.count_nonzero(self._worked))

    @property
    def closed(self) -> bool:
        """Whether all beliefs that can be met were worked out."""
        return bool(self._worked.all())

    def expand(self, precision: float, max_nodes: int) -> None:
        """Work beliefs out until what is left open is less than the precision, or there are too many."""
        while True:
            for _ in range(PASSES):
                inside, outside = self._open()
                if inside <= 0.1 * max(outside, precision):
                    break
                self._pass_on()
            if self._open()[1] <= 0.9 * precision:
                self._settle(precision)
            full = len(self.graph) >= max_nodes or self.graph.size >= MOST_NUMBERS
            if full or self._open()[1] <= 0.9 * precision:
                break
            self._expand(np.where(self._worked, 0.0, self.left * (self._high - self._low)), max_nodes)
        self._settle(precision)

    def _open(self) -> tuple[float, float]:
        """How far the bounds are apart for visits left where they can be passed on, and elsewhere."""
        weighs = self.left * (self._high - self._low)
        inside = float(weighs[self._worked].sum())
        return inside, float(weighs.sum()) - inside

    def _expand(self, weighs: Array, max_nodes: int) -> None:
        """Work out the beliefs of which half of what is open depends, and paths that follow them."""
        order = np.argsort(-weighs, kind="stable")
        sums = np.cumsum(weighs[order])
        count = 1 + int(np.searchsorted(sums, 0.5 * sums[-1]))
        room = ROUND + len(self._worked) // 4
        nodes = np.sort(order[: min(count, max_nodes, room)])
        edges = [self._edges]
        while True:
            before = len(self.graph)
            owner, _, probability, child = self.graph.expand(nodes)
            edges.append((owner, child, probability))
            self._worked[nodes] = True
            self._note_new()
            # a narrow path is followed on; anything wider is weighed first
            nodes, room = np.flatnonzero(~self._worked[before:]) + before, room - len(nodes)
            if not 0 < len(nodes) <= min(NARROW, room) or len(self.graph) >= max_nodes:
                break
        owners, children, probabilities = (np.concatenate(kind) for kind in zip(*edges, strict=True))
        self._edges = owners, children, probabilities
        self._link()

    def _note_new(self) -> None:
        """Make room for the beliefs that were met, and note what is known of them."""
        begin, n = len(self._worked), len(self.graph)
        beliefs = self.graph.beliefs.take(np.arange(begin, n))
        over = self.graph.over[begin:]
        low, high = (np.where(over, 0.0, beliefs.average(bound[beliefs.states])) for bound in self._range)
        self._paid = np.concatenate([self._paid, self.graph.rewards(np.arange(begin, n))])
        self._low, self._high = np.concatenate([self._low, low]), np.concatenate([self._high, high])
        self._worked = np.concatenate([self._worked, over])
        empty = np.zeros(n - begin)
        self.visits, self.left = np.concatenate([self.visits, empty]), np.concatenate([self.left, empty])

    def _link(self) -> None:
        """How visits are passed on, as a matrix."""
        from scipy.sparse import csr_array

        owner, child, probability = self._edges
        n = len(self._worked)
        self._onward = csr_array((self.graph.pomdp.discount * probability, (child, owner)), shape=(n, n))

    def _pass_on(self) -> None:
        moved = np.where(self._worked, self.left, 0.0)
        self.visits += moved
        self.left = self.left - moved + self._onward @ moved

    def _settle(self, precision: float) -> None:
        """Leave no visits where they can be passed on, or next to none: visits = root + gamma P' visits.

        What is left is what the found visits lack, rounding included, so the bounds hold however good the
        solution is.
        """
        worked = np.flatnonzero(self._worked)
        begin = np.zeros(len(self._worked))
        begin[self._root] = 1.0
        for solved in (solve_gmres, solve_lu)[: 1 if len(worked) > MOST_FACTORISED else 2]:
            before = self.visits, self.left, self._open()[0]
            if before[2] <= 0.05 * precision:
                return
            self.visits = np.zeros(len(begin))
            self.visits[worked] = solved(self._onward[worked][:, worked], begin[worked])
            self.left = begin - self.visits + self._onward @ self.visits
            if not abs(self._open()[0]) <= before[2]:
                self.visits, self.left, _ = before

    def earned(self) -> float:
        """What the visits passed on have earned."""
        return float(self.visits @ self._paid)

    def bounds(self) -> tuple[float, float]:
        """Bounds on the value at the root."""
        more, less = np.maximum(self.left, 0.0), np.minimum(self.left, 0.0)
        earned = self.earned()
        return (
            earned + float(more @ self._low + less @ self._high),
            earned + float(more @ self._high + less @ self._low),
        )

    def shortfalls(self) -> Array:
        """(n,) how much less than its vector promises a belief that was worked out gives, times its visits.

        What it gives is its mean reward, and what the vectors promise at the next beliefs.
        """
        promise = np.where(self.graph.over, 0.0, self.graph.values)
        given = self._paid + self._onward.T @ promise
        return np.where(self._worked, self.visits * (promise - given), 0.0)
