"""Programs of plingo and LPMLN: answer sets with weights.

`asp_weights` reads the numbers of weights, `plingo_reader` rewrites a program to rules of clingo,
`asp_grounding` grounds it with clingo, and `asp_translation` writes the ground rules as P-log. Probabilities
are then computed as of every program; clingo solves nothing.
"""
