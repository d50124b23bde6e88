"""Learning: classify trajectories. Data, features, classifiers, evaluation, streaming and the track store.

The names are loaded on first use, because torch and scikit-learn take seconds to import.
"""

from lcorpp import lazy_names as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
