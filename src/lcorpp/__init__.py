"""lcorpp: a robot learns from data, reasons with P-log, plans with POMDPs, and decides.

An implementation of LCORPP (Amiri, Shirazi and Zhang, AAAI 2020). `__init__.pyi` lists the exported names;
each one imports its package at first use, so `import lcorpp` is cheap.
"""

from lcorpp import lazy_names as _lazy

__version__ = "0.9.0"
__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
