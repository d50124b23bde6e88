"""Unfitted estimators with the parameters that training data determine: interval and channels."""

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
    """Return an unfitted estimator of a learner, for training data of this interval and these channels.

    Args:
        name: the learner, see `learner`.
        epochs: None takes `data.epochs` for the learner "lstm", and the learner's default otherwise.
        features: the classifier's features, see `Motion`.

    Raises:
        DataError: as `learner`.
    """
    default_epochs = data.epochs if name == "lstm" else None
    return learner(
        name,
        interval=data.dataset.interval,
        inputs=data.dataset.channels,
        features=features,
        epochs=epochs or default_epochs,
        seed=seed,
        device=device,
    )
