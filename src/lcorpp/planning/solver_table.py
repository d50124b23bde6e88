"""The table of solvers, which load on first use, so that a command can list the names."""

from __future__ import annotations

from collections.abc import Mapping

SOLVERS: Mapping[str, tuple[str, str]] = {
    "sarsop": ("lcorpp.planning.sarsop", "solve"),
    "exact": ("lcorpp.planning.solvers.exact.value_iteration", "solve_exact"),
    "perseus": ("lcorpp.planning.solvers.perseus", "solve_perseus"),
    "qmdp": ("lcorpp.planning.solvers.table_policy", "solve_qmdp"),
    "fib": ("lcorpp.planning.solvers.table_policy", "solve_fib"),
}
"""Name -> module and function; the functions have one signature, see `lcorpp.planning.load_solver`."""

SOLVER_NAMES = tuple(SOLVERS)

ONLINE = "online"
"""The solver of robots that search at each step, from SARSOP's bounds; see `OnlinePlanner`."""
