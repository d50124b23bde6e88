"""Solvers beside SARSOP, behind one signature.

exact           `incremental_pruning`: the value at every belief, of small problems, by `steps` of dynamic
                programming; vectors that are best nowhere are found by linear programs (`pruning`,
                `margins`), and between two steps plans are made better at some beliefs (`point_based`)
perseus         backups at beliefs met by chance
qmdp, fib       the two tables that are upper bounds, as policies, and what these earn (`informed`)
finite_horizon  for a number of steps, around a start belief (SARSOP in `layers`)
finite_exact    the same at every belief
online          no policy at all: a search from the belief at hand, by `pomcp` in a simulator
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

from lcorpp.errors import ModelError, expected_one_of
from lcorpp.planning.solution import Solution

_HOMES = {
    "sarsop": ("lcorpp.planning.sarsop", "solve"),
    "exact": ("lcorpp.planning.solvers.exact.incremental_pruning", "solve_exact"),
    "perseus": ("lcorpp.planning.solvers.perseus", "solve_perseus"),
    "qmdp": ("lcorpp.planning.solvers.qmdp", "solve_qmdp"),
    "fib": ("lcorpp.planning.solvers.fib", "solve_fib"),
}

NAMES = tuple(_HOMES)
"""The solvers for problems without end, by which `solver` knows them."""


def solver(name: str) -> Callable[..., Solution]:
    """The function `solve(pomdp, start=None, *, precision, time_limit, callback)` of a solver.

    Raises:
        ModelError: there is none of that name.
    """
    if name not in _HOMES:
        raise ModelError(f"unknown solver {name!r}; {expected_one_of(NAMES)}")
    home, function = _HOMES[name]
    found: Callable[..., Solution] = getattr(import_module(home), function)
    return found
