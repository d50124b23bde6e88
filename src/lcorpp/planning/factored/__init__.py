"""Factored POMDPs: variables, and conditional probability tables over them.

model       the problem, `Factored`                    cpt            conditional probability tables from text
table       sparse tables over variables               table_builder  a table from rules and their exceptions
variables   parts of state, action and observation     validation     checks of all tables together
flatten     from variables to a single state           joint          products of tables
"""
