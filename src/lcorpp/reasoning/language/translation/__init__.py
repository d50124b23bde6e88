"""Programs of ProbLog and Markov logic: recognised, then translated to P-log or refused by name.

`recognition` chooses the system, `problog` reads its text as statements of P-log.
"""
