"""Algorithms 1 and 2 of the paper and the strategies, written against `lcorpp.protocols` only."""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
