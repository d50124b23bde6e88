"""A trained classifier as the decision loop uses it: rho of the two algorithms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from sklearn.pipeline import Pipeline

from lcorpp.errors import DataError
from lcorpp.learning.classifiers.contract import fitted, predicted, with_probabilities
from lcorpp.learning.data.dataset import check_trainable
from lcorpp.learning.evaluation.calibration import Calibration, calibration_of
from lcorpp.learning.evaluation.thresholds import Cut, called
from lcorpp.learning.evaluation.validation import Progress, Validation, fit_and_validate
from lcorpp.learning.features.motion import Motion, Scaling
from lcorpp.values import Array, ConfusionMatrix, Dataset, Instance, Likelihood


@dataclass(frozen=True, eq=False)
class TrainedClassifier:
    """A fitted classifier and what is known of its errors; an `interfaces.Classifier`.

    estimator: a fitted scikit-learn classifier on (cases, channels, time points).
    confusion: cross-validated counts, None where it was not validated.
    calibration: how to put its probabilities right, None where it was not validated.
    cut: from which probability on a class is called; None calls the most probable one.
    """

    estimator: Any
    confusion: ConfusionMatrix | None = None
    calibration: Calibration | None = None
    cut: Cut | None = None

    def classify(self, instance: Instance) -> str:
        """The hard label of one person's trajectory (channels, time points).

        Raises:
            DataError: the trajectory does not fit the training data or is not finite.
        """
        return self.classify_many(instance.trajectory[None])[0]

    def classify_many(self, trajectories: npt.ArrayLike) -> list[str]:
        """The hard labels of (n, channels, time points); raises as `classify` does."""
        return called(self.classes, self.probabilities(trajectories), self.cut)

    def probabilities(self, trajectories: npt.ArrayLike) -> Array:
        """(n, K) how probable the estimator says each of `classes` is for (n, channels, time points)."""
        return predicted(self.estimator, np.asarray(trajectories, dtype=np.float64))

    @property
    def classes(self) -> tuple[str, ...]:
        """(K,) the class names in the order of the probabilities."""
        return tuple(str(name) for name in self.estimator.classes_)

    def soft(self) -> SoftClassifier:
        """The same classifier giving likelihoods in place of labels.

        Raises:
            DataError: it was not validated, so that nobody knows how right its probabilities are.
        """
        if self.calibration is None:
            raise DataError(
                "soft evidence needs a calibrated classifier; this one was trained without cross-validation"
            )
        return SoftClassifier(self, self.calibration)


@dataclass(frozen=True, eq=False)
class SoftClassifier:
    """A trained classifier that says how likely what it saw is under each class; an `interfaces.Classifier`.

    The reasoner weighs its own knowledge with that, see `Domain.soft_program`.
    """

    trained: TrainedClassifier
    calibration: Calibration

    def classify(self, instance: Instance) -> Likelihood:
        """The likelihood that one person's trajectory (channels, time points) gives each class.

        Raises:
            DataError: the trajectory does not fit the training data or is not finite.
        """
        return self.classify_many(instance.trajectory[None])[0]

    def classify_many(self, trajectories: npt.ArrayLike) -> list[Likelihood]:
        """The likelihoods of (n, channels, time points); raises as `classify` does."""
        return self.calibration.likelihoods(self.trained.probabilities(trajectories))


def paper_pipeline(
    *,
    epochs: int = 300,
    rate: float = 3.0,
    interval: float = 0.033,
    inputs: Sequence[str] = ("x", "y"),
    channels: Sequence[str] = ("x", "y"),
    batch_size: int = 32,
    learning_rate: float = 1e-3,
    schedule: str = "constant",
    class_weight: Any = "balanced",
    random_state: int = 0,
    device: str = "cpu",
) -> Pipeline:
    """The classifier of the paper: three points of motion a second, scaled, into an LSTM of 50 units.

    The defaults are the paper's, but for the class weights, which make no difference to its balanced data;
    see `Motion` and `LstmClassifier` for what the arguments mean. On two thousand simulated tracks 300
    epochs overfit (AUC .75, `fast_pipeline` .76); on the authors' 123 they do no harm (.82, .78).
    """
    from lcorpp.learning.lstm import LstmClassifier  # here, so that other classifiers do not load it

    lstm = LstmClassifier(
        epochs=epochs,
        batch_size=batch_size,
        learning_rate=learning_rate,
        schedule=schedule,
        class_weight=class_weight,
        random_state=random_state,
        device=device,
    )
    motion = Motion(rate=rate, interval=interval, channels=channels, inputs=inputs)
    return Pipeline([("motion", motion), ("scaling", Scaling()), ("lstm", lstm)])


def fast_pipeline(
    *, epochs: int = 20, learning_rate: float = 1e-2, schedule: str = "one-cycle", **others: Any
) -> Pipeline:
    """`paper_pipeline` in a fifteenth of its time: few passes, at a learning rate that rises and falls.

    On some hundred tracks or more it is the better of the two, for it does not overfit; on fewer its
    updates are too few. The other arguments are those of `paper_pipeline`.
    """
    return paper_pipeline(epochs=epochs, learning_rate=learning_rate, schedule=schedule, **others)


def train(estimator: Any, dataset: Dataset) -> TrainedClassifier:
    """A clone of `estimator` trained on all of `dataset`, its errors unknown.

    Raises:
        DataError: `dataset` cannot be learnt from, see `check_trainable`, or the estimator fails.
    """
    check_trainable(dataset)
    usable = with_probabilities(estimator)
    return TrainedClassifier(fitted(usable, dataset.trajectories, np.array(dataset.labels)))


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
    trained, validation = fit_and_validate(estimator, dataset, folds, seed, jobs, progress)
    return TrainedClassifier(trained, validation.confusion, calibration_of(validation)), validation
