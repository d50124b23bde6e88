"""How far ahead a search aims, chosen by what it has gained.

A path aims at a gap at its root of discount**k times the present one, for a look-ahead of k steps: under a
slow discount, a wider aim is reached only far below the root, where most steps gain little. In some mazes
(pentagon, cit), long paths narrow the gap several times faster than short ones; in other problems (network)
short ones do. So both are tried all the time, the better one more often.
"""

from __future__ import annotations

from lcorpp.planning.sarsop.bounded_search import BoundedSearch, SampleFunction
from lcorpp.planning.sarsop.work_shares import WorkShares

LOOK_AHEADS = (10, 40)
"""The look-aheads, in steps."""

MIN_WORK_SHARE = 0.2
"""Smallest share of the recent work of each of them."""

MAX_DOUBLINGS = 6
"""How often the look-ahead is doubled while two paths change nothing."""

MAX_DEPTH = 1000
"""Maximal number of nodes on a path. Any value gives valid bounds; later paths reach what one misses."""


class LookAhead:
    """Samples the paths of a search, two at a time: one follows the upper bound, one the lower.

    Its choices depend on the search alone, not on a clock.

    Args:
        search: the paths go to its tree.
        function: samples a path instead of `Tree.sample`.
    """

    def __init__(self, search: BoundedSearch, function: SampleFunction | None = None) -> None:
        self._search, self._function = search, function
        self._current, self._doublings, self._nodes = 0, 0, 0
        self._shares = WorkShares(len(LOOK_AHEADS), MIN_WORK_SHARE)
        self._before = self._describe()

    def sample(self) -> None:
        """Sample one path."""
        search = self._search
        if search.trials % 2 == 0:
            self._choose()
        steps = LOOK_AHEADS[self._current] * 2**self._doublings
        share = search.bounds.pomdp.discount**steps
        self._nodes += search.sample(share, MAX_DEPTH, self._function)

    def _choose(self) -> None:
        """Record what the last two paths gained, and choose the look-ahead of the next two."""
        now, gap_before = self._describe(), self._before[0]
        if self._nodes:
            # a path under a slow discount may go in circles, where no bound changes
            stuck = now == self._before
            self._doublings = min(self._doublings + 1, MAX_DOUBLINGS) if stuck else 0
            self._shares.record(self._current, gap_before, now[0], self._nodes)
        self._before, self._nodes = now, 0
        self._current = self._shares.choose()

    def _describe(self) -> tuple[float, int, int, int]:
        """Return the gap, and numbers that change with the search."""
        tree = self._search.bounds.tree
        return self._search.gap, tree.node_count, tree.vector_count, tree.point_count
