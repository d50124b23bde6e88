"""Algorithm 1 with stores, batches, corrected labels, trust and alarms."""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
