"""The reference reasoner: enumerate all possible worlds with clingo and measure them with exact fractions.

`asp_translation` translates the logical part of a program, `worlds` enumerates its answer sets and gives them
probabilities, `reasoner.Enumeration` answers queries. With the compiled path (`grounding`, `transitions`,
`circuit`) it shares `conditions`, the probabilities of a random value and the checks of P-log, and the form
of answers. Variables, sorts, arithmetic, dynamic ranges, interventions and stable models are computed apart,
and tests compare the two. That is why the source program is translated and not its ground form, which would
take less code.
"""
