"""Planning: from a prior belief to actions.

The problem (`Pomdp`), the belief update, the policy and the solver are kept apart. The solver loads scipy and
is therefore imported when `solve` is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from lcorpp.planning.belief import checked_belief, observation_probabilities, update
from lcorpp.planning.planner import Planner
from lcorpp.planning.policy import Policy
from lcorpp.planning.policy_file import read_policy, write_policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.pomdp_file import parse_pomdp, read_pomdp
from lcorpp.planning.pomdp_writer import format_pomdp, write_pomdp

if TYPE_CHECKING:
    from lcorpp.planning.sarsop import Progress, Solution, solve

__all__ = [
    "Planner",
    "Policy",
    "Pomdp",
    "Progress",
    "Solution",
    "checked_belief",
    "format_pomdp",
    "observation_probabilities",
    "parse_pomdp",
    "read_policy",
    "read_pomdp",
    "solve",
    "update",
    "write_policy",
    "write_pomdp",
]


def __getattr__(name: str) -> Any:
    if name not in ("Progress", "Solution", "solve"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("lcorpp.planning.sarsop"), name)
