"""Trajectory -> label: data, the LSTM, its validation and storage.

The names below load their part when they are first used: torch and scikit-learn take seconds to import.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lcorpp.learning.authors import read_authors
    from lcorpp.learning.classifier import TrainedClassifier, paper_pipeline, train, train_and_validate
    from lcorpp.learning.dataset import check_trainable, split
    from lcorpp.learning.leaks import end_position_leak, leak_note
    from lcorpp.learning.lstm import LstmClassifier
    from lcorpp.learning.motion import Motion, Scaling
    from lcorpp.learning.storage import load_classifier, save_classifier
    from lcorpp.learning.validation import Rate, Validation, cross_validate, rates_intervals

_HOMES = {
    "authors": ("read_authors",),
    "classifier": ("TrainedClassifier", "paper_pipeline", "train", "train_and_validate"),
    "dataset": ("check_trainable", "split"),
    "leaks": ("end_position_leak", "leak_note"),
    "lstm": ("LstmClassifier",),
    "motion": ("Motion", "Scaling"),
    "storage": ("load_classifier", "save_classifier"),
    "validation": ("Rate", "Validation", "cross_validate", "rates_intervals"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "LstmClassifier",
    "Motion",
    "Rate",
    "Scaling",
    "TrainedClassifier",
    "Validation",
    "check_trainable",
    "cross_validate",
    "end_position_leak",
    "leak_note",
    "load_classifier",
    "paper_pipeline",
    "rates_intervals",
    "read_authors",
    "save_classifier",
    "split",
    "train",
    "train_and_validate",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
