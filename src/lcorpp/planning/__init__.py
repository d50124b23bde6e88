"""Planning: from a prior belief to actions.

The problem (`Pomdp`, in parts `Factored`), the belief update, the policy and the solver are kept apart. The
names that not every program needs load their part of the package when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from lcorpp.planning.belief import checked_belief, observation_probabilities, update
from lcorpp.planning.formats.alpha_file import read_alphas, write_alphas
from lcorpp.planning.formats.policy_file import read_policy, write_policy
from lcorpp.planning.formats.pomdp_file import parse_pomdp, read_pomdp
from lcorpp.planning.formats.pomdp_writer import format_pomdp, write_pomdp
from lcorpp.planning.planner import Planner
from lcorpp.planning.policy import Piece, Policy, UpperBound
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.rows import Rows
from lcorpp.planning.solution import Progress, Solution

if TYPE_CHECKING:
    from lcorpp.planning.certification import Certificate, certificate
    from lcorpp.planning.controller import PolicyGraph, policy_graph
    from lcorpp.planning.evaluation import Evaluation, evaluate
    from lcorpp.planning.factored import Factored, given
    from lcorpp.planning.formats.pomdpx import parse_pomdpx, read_factored, read_pomdpx
    from lcorpp.planning.formats.pomdpx_writer import format_pomdpx, write_pomdpx
    from lcorpp.planning.sarsop import solve
    from lcorpp.planning.simulation import Simulated, simulate
    from lcorpp.planning.solvers import solver

_HOMES = {
    "Certificate": "certification",
    "PolicyGraph": "controller",
    "certificate": "certification",
    "policy_graph": "controller",
    "solver": "solvers",
    "Evaluation": "evaluation",
    "Simulated": "simulation",
    "evaluate": "evaluation",
    "simulate": "simulation",
    "Factored": "factored",
    "format_pomdpx": "formats.pomdpx_writer",
    "given": "factored",
    "parse_pomdpx": "formats.pomdpx",
    "read_factored": "formats.pomdpx",
    "read_pomdpx": "formats.pomdpx",
    "solve": "sarsop",
    "write_pomdpx": "formats.pomdpx_writer",
}

__all__ = [
    "Certificate",
    "Evaluation",
    "Factored",
    "Piece",
    "Planner",
    "Policy",
    "PolicyGraph",
    "Pomdp",
    "Progress",
    "Rows",
    "Simulated",
    "Solution",
    "UpperBound",
    "certificate",
    "checked_belief",
    "evaluate",
    "format_pomdp",
    "format_pomdpx",
    "given",
    "observation_probabilities",
    "parse_pomdp",
    "parse_pomdpx",
    "policy_graph",
    "read_alphas",
    "read_factored",
    "read_policy",
    "read_pomdp",
    "read_pomdpx",
    "simulate",
    "solve",
    "solver",
    "update",
    "write_alphas",
    "write_policy",
    "write_pomdp",
    "write_pomdpx",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
