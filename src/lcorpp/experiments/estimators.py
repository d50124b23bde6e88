"""Unfitted estimators for the interval and the channels of training data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lcorpp.experiments.training_data import TrainingData
from lcorpp.learning import learner

FOLDS = 5
"""Folds of every cross-validation."""


def make_estimator(
    data: TrainingData,
    name: str = "lstm",
    *,
    epochs: int | None = None,
    seed: int = 0,
    device: str = "cpu",
    features: Sequence[str] = ("x", "y"),
) -> Any:
    """Return an unfitted estimator for the interval and the channels of some training data.

    Args:
        name: the learner, see `learner`.
        epochs: None takes the number that suits the data for "lstm", and the learner's default otherwise.
        features: the classifier's features, see `Motion`.

    Raises:
        DataError: as `learner`.
    """
    suitable = data.epochs if name == "lstm" else None
    return learner(
        name,
        interval=data.dataset.interval,
        inputs=data.dataset.channels,
        features=features,
        epochs=epochs or suitable,
        seed=seed,
        device=device,
    )
