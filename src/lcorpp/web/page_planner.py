"""The planner of a decision that a page has made: the policy, or the page's action if it is as good."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from lcorpp.planning import Planner
from lcorpp.planning.planner import ModelPlanner
from lcorpp.values import Belief

MAX_ROUNDING = 2.0**-28
"""Difference up to which values are equal, in shares of the largest number of the vectors: the page has whole
numbers of 2^-30 of it, and sums in another order."""


class PagePlanner(ModelPlanner):
    """The actions of a page where they are best but for rounding, else those of the policy.

    Symmetric problems have equally good actions, between which rounding decides.

    Args:
        planner: the policy with its model. actions: of the page, in order.
    """

    def __init__(self, planner: Planner, actions: Iterable[str]) -> None:
        self.pomdp, self._policy, self._actions = planner.pomdp, planner.policy, iter(actions)
        numbers = [np.abs(part.vectors).max() for part in planner.policy.vector_sets]
        self._tolerance = MAX_ROUNDING * float(max(numbers))

    def action(self, belief: Belief) -> str:
        """Return the name of the next action at a belief (S,)."""
        named, (best, action) = next(self._actions, None), self._policy.value_and_action(belief)
        if named in self.pomdp.actions:
            value = self._policy.value_of_action(belief, self.pomdp.action_index(named))
            if value >= best - self._tolerance:
                return named
        return self.pomdp.actions[action]
