"""A domain is a folder: what is observed, learnt, known, shared, planned and simulated, in its own words."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
