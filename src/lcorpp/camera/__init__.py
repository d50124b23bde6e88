"""People seen by a camera: detectors, depth images, a tracker, and the frames that they work on."""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
