"""Numbers from data: maximum-likelihood estimates of the numbers of pr-atoms.

result = fit(program, read_records("records.csv"))
"""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
