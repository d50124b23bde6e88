"""Trials of two kinds, by what they gain: paths with vectors and points, and trials in the graph of beliefs.

Points and vectors generalise to other beliefs, but each belief costs as much as there are of them. Trials in
the graph cost the beliefs that they add. Where a hidden value does not change, the same answers in another
order, and symmetric ones, lead to one node of the graph, and trials lower the upper bound much faster.
"""

from __future__ import annotations

from math import inf

from lcorpp.planning.sarsop.bounded_search import BoundedSearch, SampleFunction
from lcorpp.planning.sarsop.look_ahead import LookAhead
from lcorpp.planning.sarsop.work_shares import WorkShares

START_WORK = 30_000_000
"""Work of the tree, in numbers read (some 30 ms), after which a problem is examined for hidden values."""

MIN_GRAPH_WORK = 100_000
"""Smallest work of one search of the graph; other searches work as much as paths did recently."""

MAX_STARTS = 4
"""Number of starts, those with the widest gaps, at which the new bounds shall be low."""

MIN_WORK_SHARE = 0.1
"""Smallest share of the recent work of each kind."""

PATH, GRAPH = 0, 1
"""The kinds of trials, as numbers of `WorkShares`."""

TARGET_SHARE = 0.5
"""A trial in the graph aims at this share of the gap at its root."""

GRAPH_MEMORY_SHARE = 0.4
"""Largest share of the memory limit for the graph."""


class Trials:
    """Samples the paths and trials of a search; its choices depend on the search alone, not on a clock.

    Args:
        search: whose tree is improved.
        memory_limit: of the whole search, in bytes.
        function: samples each path instead of `Tree.sample`; there are no trials in the graph then.
        seconds: time limit of the search, with which the work before the first trial in the graph grows.
    """

    def __init__(
        self,
        search: BoundedSearch,
        *,
        memory_limit: float,
        seconds: float,
        function: SampleFunction | None = None,
    ) -> None:
        self._search, self._paths = search, LookAhead(search, function)
        self._memory_limit, self._seconds = GRAPH_MEMORY_SHARE * memory_limit, seconds
        self._may_use_graph = function is None
        self._shares = WorkShares(2, MIN_WORK_SHARE)
        self._path_began, self._path_gap = 0, 0.0

    def sample(self, max_work: float = inf) -> None:
        """Sample a path; after every second one, search the graph while its gain by work is larger.

        Args:
            max_work: largest work of the search of the graph.
        """
        search, tree = self._search, self._search.bounds.tree
        if self._may_use_graph and search.bounds.has_graph is None and tree.work >= START_WORK:
            widest = sorted(search.roots, key=lambda root: tree.lower_bound(root) - tree.upper_bound(root))
            starts = [tree.belief(root) for root in widest[:MAX_STARTS]]
            search.bounds.sharpen(starts, seconds=self._seconds)
            search.refresh_record()
        if self._may_use_graph and search.bounds.has_graph and search.trials % 2 == 0:
            if self._path_began:
                self._shares.record(PATH, self._path_gap, search.gap, tree.work - self._path_began)
                self._search_graph(max_work)
            self._path_began, self._path_gap = max(1, tree.work), search.gap
        self._paths.sample()

    def _search_graph(self, max_work: float) -> None:
        """Search the graph while this gains more than paths."""
        search, tree = self._search, self._search.bounds.tree
        expanded, limit = 1, tree.work + max_work
        while expanded and self._shares.choose() == GRAPH and tree.graph_memory <= self._memory_limit:
            if search.gap <= search.precision or search.seconds_left <= 0 or tree.work >= limit:
                break
            gap, began = search.gap, tree.work
            work = min(max(self._shares.work[PATH], MIN_GRAPH_WORK), limit - began)
            expanded = search.search_graph(TARGET_SHARE, work)
            self._shares.record(GRAPH, gap, search.gap, tree.work - began)
