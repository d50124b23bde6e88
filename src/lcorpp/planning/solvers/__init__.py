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

from lcorpp.errors import ModelError, check_type, expected_one_of
from lcorpp.planning.arguments import check_limits
from lcorpp.planning.solution import Solution
from lcorpp.planning.solver_table import SOLVER_NAMES, SOLVERS
from lcorpp.user_code import UserFunction


@dataclass(frozen=True)
class SolverOptions:
    """The choice of a solver and its limits.

    name: one of `SOLVER_NAMES`, or ``FILE.py:NAME``, see `load_solver`.
    precision: stop at this gap between the bounds, in reward units. time_limit: wall-clock seconds.

    Raises:
        ModelError: the name is unknown, the file of an own solver is wrong, or a limit is not positive, or
            the precision not finite.

    Examples:
        >>> from lcorpp.planning import SolverOptions
        >>> SolverOptions("qmdp", time_limit=10)
        SolverOptions(name='qmdp', precision=0.0005, time_limit=10)
    """

    name: str = "sarsop"
    precision: float = 5e-4
    time_limit: float = 60.0

    def __post_init__(self) -> None:
        check_type(self.name, str, "the solver", ModelError)
        check_limits(self.precision, self.time_limit)
        if self.name not in SOLVERS:
            load_solver(self.name)


def load_solver(name: str) -> Callable[..., Solution]:
    """Import a solver and return its function `solve(pomdp, start=None, *, precision, time_limit, callback)`.

    Args:
        name: one of `SOLVER_NAMES`, or ``FILE.py:NAME``, a function in the user's file: see
            `lcorpp.planning.solvers.own`.

    Raises:
        ModelError: the name is unknown, or the user's file cannot be loaded or has no such function.

    Examples:
        >>> from lcorpp import load_domain
        >>> from lcorpp.planning import load_solver
        >>> round(load_solver("fib")(load_domain("intention").pomdp).upper, 1)  # the fast informed bound
        77.2
    """
    if name in SOLVERS:
        module, own = SOLVERS[name]
        solver: Callable[..., Solution] = getattr(import_module(module), own)
        return solver
    function = UserFunction.parse(name, ModelError)
    if function is None:
        raise ModelError(f"unknown solver {name!r}; {expected_one_of(SOLVER_NAMES)}, or FILE.py:NAME")
    from lcorpp.planning.solvers.own import OwnSolver  # imports the kernels

    return OwnSolver(function)
