"""Figures of solutions and policies; the only modules of `planning` that import matplotlib.

bounds        bounds over time                 two_states    a policy on the beliefs over two states
policy_graph  a policy as a graph              three_states  a policy on the beliefs over three states

belief_regions, graph_layout and graph_drawing are their parts.
"""
