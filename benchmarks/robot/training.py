"""Training of the streaming classifier on people in the corridor."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from lcorpp import Domain
from lcorpp.learning import (
    StreamingClassifier,
    calibrate_prefixes,
    cross_predict_over_time,
    fast_pipeline,
    train,
    with_prefix_ensemble,
)
from lcorpp.simulation import Population
from lcorpp.values import Dataset

sys.path.insert(0, str(Path(__file__).parents[2] / "examples" / "robot"))

from corridor import Corridor
from walkers import draw_visitors

STEP, RATE = 0.5, 2.0
"""Seconds of a step of the simulation, and points of motion per second for the classifier."""
TRACK_SAMPLES = 21
"""Samples of a person that are classified: ten seconds, as in the domain."""
TRAINING_HOURS, TRAINING_PER_MINUTE, MIN_SAMPLES = 4, 6.0, 12
FEATURES = ("velocity", "acceleration", "turn_rate", "approach", "distance", "distance_rate")


def train_streams(domain: Domain, seed: int) -> StreamingClassifier:
    """Train the streaming classifier on people in the corridor, while the robot stands still."""
    visitors = draw_visitors(
        Population(domain),
        np.random.default_rng([seed, 1]),
        seconds=3600 * TRAINING_HOURS,
        per_minute=TRAINING_PER_MINUTE,
    )
    corridor = Corridor(visitors, domain, max_people=8, step=STEP, seed=seed)
    tracks = dict[int, list[tuple[float, float]]]()
    for _ in range(round(3600 * TRAINING_HOURS / STEP)):
        corridor.step()
        for person, x, y in corridor.people:
            tracks.setdefault(person, []).append((x, y))
    used = [person for person, track in tracks.items() if len(track) >= MIN_SAMPLES]
    signals = np.full((len(used), 2, TRACK_SAMPLES), np.nan)
    for row, person in enumerate(used):
        track = np.array(tracks[person][:TRACK_SAMPLES])
        signals[row, :, : len(track)] = track.T
    label_of = {visitor.number: visitor.attributes["intention"] for visitor in visitors}
    dataset = Dataset(signals, tuple(label_of[person] for person in used), interval=STEP)
    pipeline = fast_pipeline(rate=RATE, interval=STEP, features=FEATURES, random_state=seed)
    learner = with_prefix_ensemble(pipeline, fractions=(0.4, 0.7, 1.0))
    timeline = cross_predict_over_time(learner, dataset, folds=4)
    return StreamingClassifier.from_trained(
        train(learner, dataset), prefix_calibration=calibrate_prefixes(timeline), max_silence=600.0
    )
