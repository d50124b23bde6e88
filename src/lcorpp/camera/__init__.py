"""People seen by a camera: detectors, depth images, a tracker, and the frames that they work on."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
