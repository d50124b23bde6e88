"""Solvers besides SARSOP.

Infinite horizon, one signature, by name in `load_solver`:
perseus       randomised point-based backups
table_policy  QMDP and the fast informed bound as policies
exact         value iteration with incremental pruning: the value at every belief, for small problems
own           a function in the user's file

finite_horizon    one policy per number of remaining steps
heuristic_search  online planning with bounds
pomcp             online planning by simulation
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from lcorpp.errors import ModelError, check_type, expected_one_of
from lcorpp.planning.arguments import check_limits, check_positive
from lcorpp.planning.planner import Planner
from lcorpp.planning.policy import Policy
from lcorpp.planning.pomdp import Pomdp
from lcorpp.planning.solution import Solution
from lcorpp.planning.solver_table import ONLINE, SOLVER_NAMES, SOLVERS
from lcorpp.user_code import UserFunction

if TYPE_CHECKING:
    from lcorpp.planning.solvers.heuristic_search import OnlinePlanner


@dataclass(frozen=True)
class SolverOptions:
    """The choice of a solver and its limits.

    name: one of `SOLVER_NAMES`, or ``FILE.py:NAME``, see `load_solver`; or "online": SARSOP within the
        limits, and a search at each step.
    precision: stop at this gap between the bounds, in reward units. time_limit: wall-clock seconds.
    step_seconds: of "online": about the time of the search at each step; its amount of work is fixed.

    Raises:
        ModelError: the name is unknown, the file of an own solver is wrong, or a limit is not positive, or
            the precision not finite.

    Examples:
        >>> from lcorpp.planning import SolverOptions
        >>> SolverOptions("qmdp", time_limit=10)
        SolverOptions(name='qmdp', precision=0.0005, time_limit=10, step_seconds=0.1)
    """

    name: str = "sarsop"
    precision: float = 5e-4
    time_limit: float = 60.0
    step_seconds: float = 0.1

    def __post_init__(self) -> None:
        check_type(self.name, str, "the solver", ModelError)
        check_limits(self.precision, self.time_limit)
        check_positive("step time", self.step_seconds)
        if self.name not in SOLVERS:
            load_solver(self.name)

    def make_planner(self, policy: Policy, pomdp: Pomdp) -> Planner | OnlinePlanner:
        """Return the planner that acts by a policy of this solver."""
        if self.name != ONLINE:
            return Planner(policy, pomdp)
        from lcorpp.planning.solvers.heuristic_search import MAX_WORK, WORK_PER_SECOND, OnlinePlanner

        work = max(1, int(min(self.step_seconds * WORK_PER_SECOND, MAX_WORK)))
        return OnlinePlanner(pomdp, policy=policy, precision=self.precision, work=work)


def load_solver(name: str) -> Callable[..., Solution]:
    """Import a solver and return its function `solve(pomdp, start=None, *, precision, time_limit, callback)`.

    Args:
        name: one of `SOLVER_NAMES`, or ``FILE.py:NAME``, a function in the user's file: see
            `lcorpp.planning.solvers.own`. For "online" it is SARSOP, with whose bounds the search begins.

    Raises:
        ModelError: the name is unknown, or the user's file cannot be loaded or has no such function.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import load_solver
        >>> round(load_solver("fib")(load_domain("intention").pomdp).upper, 1)  # the fast informed bound
        77.2
    """
    if name in (*SOLVERS, ONLINE):
        module, own = SOLVERS["sarsop" if name == ONLINE else name]
        solver: Callable[..., Solution] = getattr(import_module(module), own)
        return solver
    function = UserFunction.parse(name, ModelError)
    if function is None:
        raise ModelError(f"unknown solver {name!r}; {expected_one_of(SOLVER_NAMES)}, or FILE.py:NAME")
    from lcorpp.planning.solvers.own import OwnSolver  # imports the kernels

    return OwnSolver(function)
