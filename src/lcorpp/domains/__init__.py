"""Domains: folders with a `domain.toml`, a P-log program, a POMDP and, optionally, simulated people."""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
