"""Online planning by Monte-Carlo tree search: POMCP (NIPS 2010), and POMCPOW (ICAPS 2018)."""

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
