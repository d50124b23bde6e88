"""Steps 3 to 5 of compilation: transition system -> decision diagram -> layers -> answers.

`decision_diagram` expands the transition system to an AND/OR graph with arc probabilities; `layers` sums the
steps between the observed terms out, and evaluates what remains by upward and downward passes for new
evidence, as `Circuit` asks; `compiler` chooses between these and tables. `world_queries` answers questions
about whole worlds on the diagram itself.
"""
