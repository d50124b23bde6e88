"""Trust: how far knowledge, classifiers and hearing can be relied on, learnt from the answers of people."""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
