"""Compilation, steps 3 to 5: transition system -> decision diagram -> layers -> sums.

`decision_diagram` expands the transition system to an AND/OR graph with arc probabilities; `layers` sums the
steps between the observed terms out, and evaluates what remains by upward and downward passes for new
evidence. `world_queries` answers questions about whole worlds on the diagram itself.
"""
