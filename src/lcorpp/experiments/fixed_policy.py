"""A policy that does not change with the estimated observation model, e.g. from a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lcorpp.planning import Planner, Pomdp


class FixedPolicy:
    """Returns the planner of the stated model for each estimated model."""

    def __init__(self, planner: Planner) -> None:
        self._planner = planner

    def __call__(self, model: Pomdp) -> Planner:
        """Return the planner."""
        return self._planner

    def state(self) -> dict[str, Any]:
        """Return the state, which is empty."""
        return {}

    def restore(self, state: Mapping[str, Any]) -> Planner:
        """Return the planner."""
        return self._planner
