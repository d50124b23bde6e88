"""A trained classifier as the decision loop uses it: rho of the two algorithms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy.typing as npt
from sklearn.base import clone
from sklearn.pipeline import Pipeline

from lcorpp.learning.dataset import check_trainable
from lcorpp.learning.motion import Motion, Scaling
from lcorpp.learning.validation import Progress, Validation, fit_and_validate
from lcorpp.values import ConfusionMatrix, Dataset, Instance


@dataclass(frozen=True, eq=False)
class TrainedClassifier:
    """A fitted classifier and what is known of its errors; an `interfaces.Classifier`.

    estimator: a fitted scikit-learn classifier on (cases, channels, time points).
    confusion: cross-validated counts, None where it was not validated.
    """

    estimator: Any
    confusion: ConfusionMatrix | None = None

    def classify(self, instance: Instance) -> str:
        """The hard label of one person's trajectory (channels, time points).

        Raises:
            DataError: the trajectory does not fit the training data or is not finite.
        """
        return self.classify_many(instance.trajectory[None])[0]

    def classify_many(self, trajectories: npt.ArrayLike) -> list[str]:
        """The hard labels of (n, channels, time points); raises as `classify` does."""
        return [str(label) for label in self.estimator.predict(trajectories)]


def paper_pipeline(
    *,
    epochs: int = 300,
    points: int = 30,
    batch_size: int = 32,
    learning_rate: float = 1e-3,
    random_state: int = 0,
    device: str = "cpu",
) -> Pipeline:
    """The classifier of the paper: 30 points of motion, scaled, into an LSTM of 50 units.

    The defaults are the paper's; see `LstmClassifier` for what the others mean. On a thousand simulated
    tracks 300 epochs overfit (AUC .70, 20 epochs .78); on the authors' 123 they do no harm (.81).

    Raises:
        DataError: torch is not installed.
    """
    from lcorpp.learning.lstm import LstmClassifier  # here, so that other classifiers need no torch

    lstm = LstmClassifier(
        epochs=epochs,
        batch_size=batch_size,
        learning_rate=learning_rate,
        random_state=random_state,
        device=device,
    )
    return Pipeline([("motion", Motion(points=points)), ("scaling", Scaling()), ("lstm", lstm)])


def train(estimator: Any, dataset: Dataset) -> TrainedClassifier:
    """A clone of `estimator` trained on all of `dataset`, its errors unknown.

    Raises:
        DataError: `dataset` cannot be learnt from; see `check_trainable`.
    """
    check_trainable(dataset)
    return TrainedClassifier(clone(estimator).fit(dataset.trajectories, list(dataset.labels)))


def train_and_validate(
    estimator: Any,
    dataset: Dataset,
    *,
    folds: int = 5,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> tuple[TrainedClassifier, Validation]:
    """Algorithm 1, lines 1 and 2: rho trained on all of `dataset`, and C by cross-validation.

    The final training runs beside the folds, as one more part of the work; arguments and errors are those
    of `cross_validate`.
    """
    fitted, validation = fit_and_validate(estimator, dataset, folds, seed, jobs, progress)
    return TrainedClassifier(fitted, validation.confusion), validation
