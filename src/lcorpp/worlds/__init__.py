"""Worlds in which the robot acts: each executes actions and returns observations."""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
