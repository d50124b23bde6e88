"""Figures of solutions and policies; the only modules of `planning` that import matplotlib.

bounds          bounds over time          belief_figures  a policy on the beliefs over two or three states
policy_graph    a policy as a graph

belief_regions, graph_layout and graph_drawing are their parts.
"""
