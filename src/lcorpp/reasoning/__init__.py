"""Evidence to marginal: P-log programs, read, checked, compiled and answered.

program = read_plog("knowledge.plog")
marginal = Reasoner(program).posterior("intention", {"time": "afternoon", "classifier": "zero"})

The names below load their part of the room when they are first used: a command that asks one question need
not wait for numpy or clingo.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
