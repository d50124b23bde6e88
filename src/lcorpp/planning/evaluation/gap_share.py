"""The gap between the bounds of a solution, compared with what planning gains."""

from __future__ import annotations

from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solution import Solution

TOLERANCE = 1e-3
"""Of the value of repeating an action, relative to the gap."""

MAX_SECONDS = 5.0
"""Time limit of that value, which is a lower bound then."""


def compute_gap_share(solution: Solution) -> float | None:
    """Return the widest gap of the starts as a share of what planning gains at the model's start belief.

    That is the value of the policy minus that of the best policy that repeats one action. Where reports end a
    problem, the latter reports at once.

    Returns:
        None if the policy gains nothing there, or the discount is 1.
    """
    pomdp, gap = solution.pomdp, solution.upper - solution.lower
    if pomdp.discount == 1:
        return None
    tolerance = TOLERANCE * max(gap, TOLERANCE)
    gain = solution.policy.value(pomdp.start) - compute_repeated_value(pomdp, tolerance)
    return gap / gain if gain > tolerance else None


def compute_repeated_value(pomdp: Pomdp, tolerance: float) -> float:
    """Return the value, at the model's start belief, of the best policy that repeats one action."""
    from lcorpp.planning._native import blind_policies
    from lcorpp.planning.sarsop.kernel_model import build_model

    values = blind_policies(build_model(pomdp), tolerance, MAX_SECONDS)
    return float((values @ pomdp.start).max())
