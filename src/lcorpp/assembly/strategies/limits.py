"""The strategy LCORPP+limits: it acts by a randomised policy that keeps the limits of its domain."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from lcorpp.assembly.strategies.strategy_table import LIMITS_NAME
from lcorpp.decision import Robot, Strategy
from lcorpp.domains import Domain
from lcorpp.errors import DecisionError, check_type

if TYPE_CHECKING:
    from lcorpp.assembly.strategies.limited_plan import LimitedPlan


@dataclass(frozen=True)
class KeepLimits:
    """Changes a robot into one that keeps the limits of its domain; plan: None searches it once."""

    plan: LimitedPlan | None = None

    def __call__(self, robot: Robot, rng: np.random.Generator) -> Robot:
        domain = robot.domain
        check_type(domain, Domain, f"the domain of the strategy {LIMITS_NAME!r}", DecisionError)
        assert isinstance(domain, Domain)
        from lcorpp.assembly.strategies.limited_plan import NotingReasoner, StartingPlanner, find_plan

        plan = self.plan or find_plan(domain, getattr(robot.reasoner, "program", domain.program))
        planner = StartingPlanner(plan, domain.pomdp, rng)
        return replace(robot, reasoner=NotingReasoner(robot.reasoner, planner), planner=planner)


WITH_LIMITS = Strategy(LIMITS_NAME, learns=True, reasons=True, plans=True, change=KeepLimits(), draws=True)
"""LCORPP within the limits of its domain; found by its name."""


def bind_limits(strategies: Iterable[Strategy], plan: LimitedPlan) -> tuple[Strategy, ...]:
    """Return strategies of which LCORPP+limits has a plan, so that processes share it."""
    return tuple(
        replace(row, change=KeepLimits(plan)) if isinstance(row.change, KeepLimits) else row
        for row in strategies
    )


def require_limits(domain: Domain, strategies: Iterable[Strategy]) -> None:
    """Check that a domain has limits if LCORPP+limits is among some strategies.

    Raises:
        DomainError: it has none.
    """
    if not domain.planning.limits and any(keeps_limits(row) for row in strategies):
        from lcorpp.assembly.strategies.limited_plan import make_missing_error

        raise make_missing_error(domain)


def get_plan(strategies: Iterable[Strategy]) -> LimitedPlan | None:
    """Return the plan that `bind_limits` gave LCORPP+limits; None if it is not among the strategies."""
    return next((row.change.plan for row in strategies if isinstance(row.change, KeepLimits)), None)


def keeps_limits(strategy: Strategy) -> bool:
    """Whether a strategy is LCORPP+limits."""
    return isinstance(strategy.change, KeepLimits)
