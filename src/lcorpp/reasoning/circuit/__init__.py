"""Steps 3 to 5 of compilation: transition system -> decision diagram -> matrices -> answers.

`trellis` expands the transition system to a decision diagram with arc probabilities; `compiler` multiplies
the levels between the observed terms out to sparse matrices (`matrices`), which `Circuit` evaluates by
forward and backward passes for new evidence. `world_queries` answers questions about whole worlds on the
diagram itself.
"""
