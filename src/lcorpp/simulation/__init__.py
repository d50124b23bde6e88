"""Simulated people: a population drawn from a P-log program, their trajectories, and worlds to act in."""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
