"""Planning: from a prior belief to actions.

The problem (`Pomdp`, in parts `Factored`), the belief update, the policy and the solver are kept apart. The
names that not every program needs load their part of the package when they are first used.
"""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
