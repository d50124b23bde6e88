"""Figures of solutions and policies; the only modules of `planning` that import matplotlib.

bounds        bounds over time                 two_states    a policy on the beliefs over two states
policy_graph  a policy as a graph              three_states  a policy on the beliefs over three states

belief_regions, graph_layout and graph_drawing are their parts.
"""

from __future__ import annotations

from lcorpp.planning.plots.bounds import draw_bounds
from lcorpp.planning.plots.policy_graph import draw_graph
from lcorpp.planning.plots.three_states import draw_triangle
from lcorpp.planning.plots.two_states import draw_line

__all__ = ["draw_bounds", "draw_graph", "draw_line", "draw_triangle"]
