"""Compilation, step 1: ground a P-log program to clauses over numbered terms, and simplify them.

`grounder` -> `simplification`; the result, `GroundProgram`, is the input of `reasoning.transitions`.
"""
