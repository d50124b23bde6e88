"""Classifying people while they move: samples come one by one, the answer is always up to date.

`track` puts the samples of one person in order and gives them a fixed rate, `memory` keeps what a classifier
knows of each person, `streams` brings the two together for everybody at once. `prefixes` asks the same
classifier about the beginnings of recorded tracks, `over_time` holds what it said, `early` makes of that how
far to trust it so early, and `plots` draws it; `ages` trains one that is good early.
"""

from lcorpp.learning.streaming.predictions import Answer, Report
from lcorpp.learning.streaming.prefix_calibration import Early, calibrate_over_time
from lcorpp.learning.streaming.prefix_ensemble import ByAge, at_every_age
from lcorpp.learning.streaming.prefix_predictions import OverTime
from lcorpp.learning.streaming.prefixes import follow, out_of_fold_over_time, prefix
from lcorpp.learning.streaming.streams import Streams
from lcorpp.learning.streaming.track import Repairs

__all__ = [
    "Answer",
    "ByAge",
    "Early",
    "OverTime",
    "Repairs",
    "Report",
    "Streams",
    "at_every_age",
    "calibrate_over_time",
    "follow",
    "out_of_fold_over_time",
    "prefix",
]
