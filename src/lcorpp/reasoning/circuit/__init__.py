"""Steps 3 to 5 of compilation: transition system -> decision diagram -> matrices -> answers.

`decision_diagram` expands the transition system to an AND/OR graph with arc probabilities; `compiler`
multiplies the steps between the observed terms out to sparse matrices (`matrices`), which `Circuit` evaluates
by upward and downward passes for new evidence. `world_queries` answers questions about whole worlds on the
diagram itself.
"""
