"""Small streams for the tests: predictions of people, made up with known probabilities."""

from __future__ import annotations

import numpy as np

from lcorpp.early_decision.stream_model import StreamModel
from lcorpp.learning import PredictionTimeline

CLASSES = ("interested", "not_interested")
INTERVAL = 0.5
POINTS = 6


def make_timeline(n: int = 400, seed: int = 0, *, shortest: int = POINTS) -> PredictionTimeline:
    """Predictions whose log odds are a random walk with a drift by class: later ones contain the earlier.

    None is at the start of a track, as one point shows no motion.
    """
    rng = np.random.default_rng(seed)
    labels = np.array([*CLASSES] * (n // 2))
    drift = np.where(labels == CLASSES[0], 0.5, -0.5)[:, None]
    odds = (drift + rng.normal(0, 1, (n, POINTS))).cumsum(axis=1)
    p = 1 / (1 + np.exp(-odds))
    lengths = rng.integers(shortest, POINTS + 1, size=n)
    p[np.arange(POINTS) >= lengths[:, None]] = np.nan
    p = np.column_stack([np.full(n, np.nan), p])
    return PredictionTimeline(
        np.stack([p, 1 - p], axis=2),
        tuple(range(1, POINTS + 2)),
        tuple(labels.tolist()),
        CLASSES,
        INTERVAL,
        folds=tuple((np.arange(n) % 5).tolist()),
    )


def make_stream(*, stages: int = 2, ends: float = 0.1) -> StreamModel:
    """Two bins: the first is right of .8 of the interested; the second stage repeats it with .9."""
    first = np.array([[0.2, 0.8], [0.7, 0.3]])
    step = np.array([[[0.9, 0.1], [0.1, 0.9]]] * 2)
    return StreamModel(
        CLASSES,
        tuple(range(2, 2 + stages)),
        tuple(1.0 + 2.0 * k for k in range(stages)),
        np.full((stages, 1), 0.5),
        first,
        np.array([step] * (stages - 1)).reshape(stages - 1, 2, 2, 2),
        np.full((stages, 2), ends),
    )
