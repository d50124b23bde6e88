"""Models from episodes: hidden states, interaction and knowledge, estimated from what a robot recorded."""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
