"""Programs of ProbLog and plingo: recognised, then translated to P-log or refused by name.

`recognition` chooses the system, `problog` reads its text as statements of P-log.
"""
