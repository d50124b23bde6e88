"""Solvers for a finite number of steps: from start beliefs by SARSOP, or exactly at every belief."""

from __future__ import annotations

from lcorpp.planning.solvers.finite_horizon.exact import solve_finite_horizon_exact
from lcorpp.planning.solvers.finite_horizon.sarsop import solve_finite_horizon
from lcorpp.planning.solvers.finite_horizon.solution import FiniteHorizonSolution

__all__ = ["FiniteHorizonSolution", "solve_finite_horizon", "solve_finite_horizon_exact"]
