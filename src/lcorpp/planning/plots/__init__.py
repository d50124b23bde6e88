"""Pictures of what a planner found. They load matplotlib, and are therefore imported by nothing else here.

bounds    both bounds over time                    line      what is done between two states
triangle  what is done among three states          graph     what is done after each observation

slices, layers and arrows are what they are made of.
"""

from __future__ import annotations

from lcorpp.planning.plots.bounds import draw_bounds
from lcorpp.planning.plots.policy_graph import draw_graph
from lcorpp.planning.plots.three_states import draw_triangle
from lcorpp.planning.plots.two_states import draw_line

__all__ = ["draw_bounds", "draw_graph", "draw_line", "draw_triangle"]
