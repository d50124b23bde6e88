"""The reference reasoner: enumerate all possible worlds with clingo and measure them with exact fractions.

`asp_translation` enumerates the answer sets of a program's logical part, `measures` gives them probabilities,
`reasoner.Enumeration` answers queries. It shares no code with the compiled path (`grounding`, `transitions`,
`circuit`); tests compare the two.
"""
