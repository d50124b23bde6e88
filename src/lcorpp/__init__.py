"""lcorpp: learn what can be learnt, reason with what people know, plan what to ask, then decide.

An implementation of LCORPP (Amiri, Shirazi and Zhang, AAAI 2020). The names below load their part of the
package when they are first used, so that `import lcorpp` stays cheap.
"""

import lazy_loader as _lazy

__version__ = "0.1.0"
__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
