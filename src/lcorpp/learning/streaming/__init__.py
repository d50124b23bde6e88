"""Streaming classification: predictions for moving people, updated with every sample.

`resampler` orders the samples of one person and resamples them to a fixed rate, `state` keeps the classifier
state of each person, and `streaming_classifier` combines both for all people. `prefixes` applies a classifier
to the beginnings of recorded tracks, `timeline` contains and calibrates these predictions, and `plots` draws
them; `prefix_ensemble` trains a classifier for short prefixes.
"""

from lcorpp.learning.streaming.predictions import Prediction, StreamReport
from lcorpp.learning.streaming.prefix_ensemble import PrefixEnsemble, with_prefix_ensemble
from lcorpp.learning.streaming.prefixes import cross_predict_over_time, predict_over_time, truncate
from lcorpp.learning.streaming.resampler import RepairCounts
from lcorpp.learning.streaming.streaming_classifier import StreamingClassifier
from lcorpp.learning.streaming.timeline import PredictionTimeline, PrefixCalibration, calibrate_prefixes

__all__ = [
    "Prediction",
    "PredictionTimeline",
    "PrefixCalibration",
    "PrefixEnsemble",
    "RepairCounts",
    "StreamReport",
    "StreamingClassifier",
    "calibrate_prefixes",
    "cross_predict_over_time",
    "predict_over_time",
    "truncate",
    "with_prefix_ensemble",
]
