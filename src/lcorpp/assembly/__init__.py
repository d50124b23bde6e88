"""From a domain to a robot: classifiers, policy, strategies, and the parts that a log describes."""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
