"""The two algorithms of the paper, over protocols only: any parts that fit can take part."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
