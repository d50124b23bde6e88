"""Gaps between the bounds of a policy, at the priors of decisions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache

import numpy as np

from lcorpp.decision import Robot, Strategy
from lcorpp.domains import Domain
from lcorpp.planning import Planner, Policy
from lcorpp.scoring.cases import Case
from lcorpp.scoring.decision_nodes import RoundedBeliefNodes
from lcorpp.values import Belief

NO_GAP = -1.0
"""Instead of a gap: a decision without the experiment's policy, or a policy without an upper bound."""


def find_gap(robot: Robot, strategy: Strategy, prior: Belief) -> float:
    """Return the gap between the bounds of the full robot's policy at a prior (S,), or `NO_GAP`."""
    planner, is_own = robot.planner, strategy.start is not None or strategy.change is not None
    if is_own or not strategy.plans or not isinstance(planner, Planner):
        return NO_GAP
    return NO_GAP if planner.policy.upper_bound is None else _compute_gap(planner.policy, prior.tobytes())


def find_gaps(domain: Domain, robot: Robot, strategy: Strategy, cases: Sequence[Case]) -> list[float]:
    """Return the gap at the prior of each case, see `find_gap`."""
    if not strategy.plans or strategy.change is not None:
        return []
    nodes = RoundedBeliefNodes(domain, strategy.robot(robot))
    priors = dict.fromkeys(nodes.root(case.context, case.labels) for case in cases)
    return [find_gap(robot, strategy, np.frombuffer(prior)) for prior in priors]


def take_gap(gaps: Iterable[float]) -> float | None:
    """Return the largest of some gaps; None if one is `NO_GAP`, or there is none."""
    own = list(gaps)
    return float(max(own)) if own and min(own) > NO_GAP else None


@lru_cache(maxsize=1000)
def _compute_gap(policy: Policy, prior: bytes) -> float:
    """Compute a gap, once for all people with equal facts and labels."""
    return policy.gap(np.frombuffer(prior))
