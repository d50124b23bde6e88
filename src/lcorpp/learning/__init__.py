"""Trajectory -> label: data, the LSTM, its validation and storage.

The names below load their part when they are first used: torch and scikit-learn take seconds to import.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lcorpp.learning.authors import read_authors
    from lcorpp.learning.calibration import Calibration, calibrate, cross_calibrated
    from lcorpp.learning.classifier import (
        SoftClassifier,
        TrainedClassifier,
        fast_pipeline,
        paper_pipeline,
        train,
        train_and_validate,
    )
    from lcorpp.learning.data.reading import read_data, read_recording
    from lcorpp.learning.data.rectangular import load_dataset, save_dataset
    from lcorpp.learning.data.tracks import Recording, Track
    from lcorpp.learning.data.windows import dataset_of
    from lcorpp.learning.data.writing import write_recording
    from lcorpp.learning.dataset import check_trainable, split
    from lcorpp.learning.leaks import Leak, leak_check, leak_note
    from lcorpp.learning.learners import LEARNERS, learner
    from lcorpp.learning.logistic import QuadraticLogistic
    from lcorpp.learning.lstm import LstmClassifier, LstmState
    from lcorpp.learning.motion import Motion, Scaling
    from lcorpp.learning.report import Report, report_on
    from lcorpp.learning.report_figure import plot_report
    from lcorpp.learning.report_files import write_report
    from lcorpp.learning.resampling import regular
    from lcorpp.learning.storage import load_classifier, save_classifier
    from lcorpp.learning.store import Entry, Layout, Store, read_store
    from lcorpp.learning.streaming import (
        Answer,
        ByAge,
        Early,
        OverTime,
        Streams,
        at_every_age,
        calibrate_over_time,
        follow,
        out_of_fold_over_time,
        prefix,
    )
    from lcorpp.learning.summaries import Summaries
    from lcorpp.learning.thresholds import Cut, Threshold, choose_threshold
    from lcorpp.learning.validation import Rate, Validation, cross_validate, rates_intervals

_HOMES = {
    "authors": ("read_authors",),
    "calibration": ("Calibration", "calibrate", "cross_calibrated"),
    "classifier": (
        *("SoftClassifier", "TrainedClassifier", "fast_pipeline", "paper_pipeline"),
        *("train", "train_and_validate"),
    ),
    "data.reading": ("read_data", "read_recording"),
    "data.rectangular": ("load_dataset", "save_dataset"),
    "data.tracks": ("Recording", "Track"),
    "data.windows": ("dataset_of",),
    "data.writing": ("write_recording",),
    "dataset": ("check_trainable", "split"),
    "leaks": ("Leak", "leak_check", "leak_note"),
    "learners": ("LEARNERS", "learner"),
    "logistic": ("QuadraticLogistic",),
    "lstm": ("LstmClassifier", "LstmState"),
    "motion": ("Motion", "Scaling"),
    "report": ("Report", "report_on"),
    "report_figure": ("plot_report",),
    "report_files": ("write_report",),
    "resampling": ("regular",),
    "storage": ("load_classifier", "save_classifier"),
    "store": ("Entry", "Layout", "Store", "read_store"),
    "streaming": (
        *("Answer", "ByAge", "Early", "OverTime", "Streams"),
        *("at_every_age", "calibrate_over_time", "follow", "out_of_fold_over_time", "prefix"),
    ),
    "summaries": ("Summaries",),
    "thresholds": ("Cut", "Threshold", "choose_threshold"),
    "validation": ("Rate", "Validation", "cross_validate", "rates_intervals"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "LEARNERS",
    "Answer",
    "ByAge",
    "Calibration",
    "Cut",
    "Early",
    "Entry",
    "Layout",
    "Leak",
    "LstmClassifier",
    "LstmState",
    "Motion",
    "OverTime",
    "QuadraticLogistic",
    "Rate",
    "Recording",
    "Report",
    "Scaling",
    "SoftClassifier",
    "Store",
    "Streams",
    "Summaries",
    "Threshold",
    "Track",
    "TrainedClassifier",
    "Validation",
    "at_every_age",
    "calibrate",
    "calibrate_over_time",
    "check_trainable",
    "choose_threshold",
    "cross_calibrated",
    "cross_validate",
    "dataset_of",
    "fast_pipeline",
    "follow",
    "leak_check",
    "leak_note",
    "learner",
    "load_classifier",
    "load_dataset",
    "out_of_fold_over_time",
    "paper_pipeline",
    "plot_report",
    "prefix",
    "rates_intervals",
    "read_authors",
    "read_data",
    "read_recording",
    "read_store",
    "regular",
    "report_on",
    "save_classifier",
    "save_dataset",
    "split",
    "train",
    "train_and_validate",
    "write_recording",
    "write_report",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
