"""SARSOP by bounded amounts of work, instead of until a time limit."""

from __future__ import annotations

from math import inf

import numpy as np

from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.sarsop.bounded_search import BoundedSearch
from lcorpp.planning.sarsop.bounded_tree import BoundedTree
from lcorpp.planning.sarsop.look_ahead import LookAhead
from lcorpp.values import Array


class PacedSearch:
    """A search whose state depends on the model, the starts and the number of trials alone, not on a clock.

    improvement: the largest rise of the lower bound at a start while the number of trials doubled last, in
    reward units; infinite before 2 N trials. It estimates what the policy loses: the lower bound converges
    long before the upper one, and its rises get smaller.

    Args:
        pomdp: the problem.
        starts: (N, S) beliefs for which the policy is optimised.
        precision: the search ends when upper - lower is at most this at every start, in reward units.

    Source: as `lcorpp.planning.sarsop.solver`.
    """

    def __init__(self, pomdp: Pomdp, starts: Array, precision: float) -> None:
        self.pomdp = pomdp
        bounds = BoundedTree(pomdp, list(starts), precision=precision, seconds=inf)
        self._search = BoundedSearch(bounds, starts, precision=precision, began=0.0, time_limit=inf)
        self._paths = LookAhead(self._search)
        self.improvement, self._lower_bounds, self._next_check = inf, np.full(len(starts), -inf), len(starts)

    @property
    def work(self) -> int:
        """The work so far, in the unit of `BoundedSearch`."""
        return self._search.work

    @property
    def trials(self) -> int:
        """The number of sampled paths so far."""
        return self._search.trials

    @property
    def gap(self) -> float:
        """The widest gap between the bounds at a start, in reward units."""
        return self._search.gap

    @property
    def converged(self) -> bool:
        """Whether the bounds are as close as requested."""
        return self.gap <= self._search.precision

    def advance(self, *, work: float = inf, trials: float = inf) -> None:
        """Sample paths until the search converges or a limit is reached.

        Args:
            work: limit of the work of this call. trials: limit of the trials of all calls.

        Raises:
            KeyboardInterrupt: as usual; the search can go on.
        """
        limit = self.work + work

        def step() -> str | None:
            if self.work >= limit or self.trials >= trials:
                return "limit"
            self._paths.sample()
            if self.trials == self._next_check:
                self._measure_improvement()
            return None

        if self._search.run(step) == "interrupted":
            raise KeyboardInterrupt

    def make_policy(self) -> Policy:
        """Return the best policy so far."""
        return self._search.make_solution("").policy

    def _measure_improvement(self) -> None:
        tree = self._search.bounds.tree
        lower_bounds = np.array([tree.lower_bound(root) for root in self._search.roots])
        self.improvement = float((lower_bounds - self._lower_bounds).max())
        self._lower_bounds, self._next_check = lower_bounds, 2 * self._next_check
