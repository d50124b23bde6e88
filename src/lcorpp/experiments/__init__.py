"""The paper's experiments: simulated people, trials, exact values, intervals and figures."""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
