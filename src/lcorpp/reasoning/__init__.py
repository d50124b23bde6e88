"""Reasoning with P-log programs: parse, compile, answer queries.

program = read_plog("knowledge.plog")
marginal = Reasoner(program).posterior("intention", {"time": "afternoon", "classifier": "zero"})

Exported names are imported at first use, so a command with one query need not wait for numpy.
"""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
