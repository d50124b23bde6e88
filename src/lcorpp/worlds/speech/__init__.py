"""Speech: voices of the robot, and a recogniser of people's answers with a learnt confidence."""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
