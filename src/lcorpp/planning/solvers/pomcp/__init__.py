"""Online planning for simulated models: POMCP (NIPS 2010), POMCPOW (ICAPS 2018), and a search with bounds."""

from __future__ import annotations

from lcorpp.planning.solvers.pomcp.generative_planner import GenerativePlanner, SearchOptions
from lcorpp.planning.solvers.pomcp.planners import ParticlePlanner, PomcpPlanner
from lcorpp.planning.solvers.pomcp.search import Widening
from lcorpp.planning.solvers.pomcp.simulator import ObservedSimulator, Simulator, TableSimulator

__all__ = [
    "GenerativePlanner",
    "ObservedSimulator",
    "ParticlePlanner",
    "PomcpPlanner",
    "SearchOptions",
    "Simulator",
    "TableSimulator",
    "Widening",
]
