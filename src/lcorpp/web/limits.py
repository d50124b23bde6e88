"""The plan of LCORPP+limits on the page: as JSON for its engine, and the start node that a server draws."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lcorpp.assembly.strategies.limited_plan import LimitedPlan
from lcorpp.decision.strategies import make_generator
from lcorpp.values import Belief


def describe_plan(plan: LimitedPlan) -> dict[str, Any]:
    """Return the plan for the engine of the page (`page/engine/limits.js`)."""
    policy = plan.policy
    starts = [[[int(node), float(row[node])] for node in np.flatnonzero(row)] for row in policy.probabilities]
    return {
        "names": list(plan.names),
        "cases": {"|".join(row): start for row, start in plan.cases.items()},
        "priors": policy.starts.tolist(),
        "starts": starts,
        "actions": [policy.action_names[action] for action in policy.controller.actions],
        "successors": policy.controller.successors.tolist(),
    }


def draw_start_node(
    plan: LimitedPlan, evidence: Mapping[str, str], prior: Belief, seed: tuple[int, ...]
) -> int:
    """Return the node that a planner of this plan draws with a seed (`make_generator`)."""
    return plan.policy.draw_node(plan.find_start(evidence), prior, make_generator(*seed))
