"""Trajectory -> label: data, the LSTM, its validation and storage.

The names below load their part when they are first used: torch and scikit-learn take seconds to import.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
