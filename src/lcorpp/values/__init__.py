"""Values shared by all packages: frozen, and checked once at construction; each loads at its first use."""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
