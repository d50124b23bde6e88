"""Answers over all combinations of choices: the best decisions, and bounds of probabilities.

`combinations` answers a program given each combination; `decision_problems` compares expected utilities,
`credal` adds up the combinations all or some of whose answer sets satisfy a query.
"""
