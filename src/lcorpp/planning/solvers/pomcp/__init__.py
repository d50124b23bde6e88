"""POMCP: online planning by Monte-Carlo tree search (Silver and Veness, NIPS 2010)."""

from __future__ import annotations

from lcorpp.planning.solvers.pomcp.planners import ParticlePlanner, PomcpPlanner
from lcorpp.planning.solvers.pomcp.simulator import Simulator, TableSimulator

__all__ = ["ParticlePlanner", "PomcpPlanner", "Simulator", "TableSimulator"]
