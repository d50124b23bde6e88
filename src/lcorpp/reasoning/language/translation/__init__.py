"""Programs of ProbLog and plingo: recognised, then translated to P-log or refused by name.

`recognition` chooses the system, `problog` and `plingo` read its text as statements of P-log, and
`declarations` adds what these systems do not write: the sorts and the attributes.
"""
