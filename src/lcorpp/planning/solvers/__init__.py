"""Solvers besides SARSOP.

Infinite horizon, one signature, by name in `load_solver`:
perseus       randomised point-based backups
table_policy  QMDP and the fast informed bound as policies
exact         value iteration with incremental pruning: the value at every belief, for small problems

finite_horizon    one policy per number of remaining steps
heuristic_search  online planning with bounds
pomcp             online planning by simulation
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.planning.solution import Solution

_FUNCTIONS = {
    "sarsop": ("lcorpp.planning.sarsop", "solve"),
    "exact": ("lcorpp.planning.solvers.exact.value_iteration", "solve_exact"),
    "perseus": ("lcorpp.planning.solvers.perseus", "solve_perseus"),
    "qmdp": ("lcorpp.planning.solvers.table_policy", "solve_qmdp"),
    "fib": ("lcorpp.planning.solvers.table_policy", "solve_fib"),
}

SOLVER_NAMES = tuple(_FUNCTIONS)
"""The names that `load_solver` accepts. To add one: a row above, and its name in `lcorpp solve --help`."""


def load_solver(name: str) -> Callable[..., Solution]:
    """Import a solver and return its function `solve(pomdp, start=None, *, precision, time_limit, callback)`.

    Raises:
        ModelError: the name is unknown.
    """
    if name not in _FUNCTIONS:
        raise ModelError(f"unknown solver {name!r}; {expected_one_of(SOLVER_NAMES)}")
    module, function = _FUNCTIONS[name]
    solver: Callable[..., Solution] = getattr(import_module(module), function)
    return solver
