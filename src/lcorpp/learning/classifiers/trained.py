"""Trained classifier for the decision loop: rho of the two algorithms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments, to_numbers
from lcorpp.errors import DataError
from lcorpp.learning.contract import ensure_predict_proba, fit_clone, name_of, predict_proba
from lcorpp.learning.data.dataset import check_trainable
from lcorpp.learning.evaluation.calibration import Calibration, fit_calibration
from lcorpp.learning.evaluation.prediction_sets import PredictionSets, fit_prediction_sets
from lcorpp.learning.evaluation.thresholds import DecisionThreshold, apply_threshold
from lcorpp.learning.evaluation.validation import Progress, Validation, fit_and_validate
from lcorpp.notebook import html_table
from lcorpp.values import COVERAGE, Array, ConfusionMatrix, Dataset, EvidenceKind, Likelihood, check_coverage


@dataclass(frozen=True, eq=False)
class TrainedClassifier:
    """A fitted classifier with its measured errors; a `protocols.Classifier`.

    estimator: a fitted scikit-learn classifier on (cases, channels, time points), or (cases, features).
    confusion: cross-validated counts; None if it was not validated.
    calibration: calibration of its probabilities; None if it was not validated.
    threshold: decision threshold of one class; if None, the label is the most probable class.
    inputs: the channels or features of its training data; () if they are unknown.
    prediction_sets: its conformal prediction sets; None if it was not validated.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import QuadraticLogistic, train
        >>> data = Dataset([[0.1 * n] for n in range(20)], 10 * ["stands"] + 10 * ["walks"])  # speeds in m/s
        >>> classifier = train(QuadraticLogistic(C=1), data)
        >>> classifier.classify([1.3]), classifier.probabilities([[1.3]]).round(2).tolist()
        ('walks', [[0.23, 0.77]])
    """

    estimator: Any
    confusion: ConfusionMatrix | None = None
    calibration: Calibration | None = None
    threshold: DecisionThreshold | None = None
    inputs: tuple[str, ...] = ()
    prediction_sets: PredictionSets | None = None

    def __repr__(self) -> str:
        parts = [name_of(self.estimator), f"classes {', '.join(self.classes)}"]
        if self.confusion is not None:
            counts = self.confusion.counts
            parts.append(f"accuracy {np.trace(counts) / counts.sum():.3f} of {counts.sum():g} cases")
        if self.threshold is not None:
            parts.append(str(self.threshold))
        return f"<TrainedClassifier: {'; '.join(parts)}>"

    def _repr_html_(self) -> str:
        measured = self.confusion
        rows = [] if measured is None else zip(measured.classes, measured.probabilities, strict=True)
        cells = [(name, *(f"{rate:.3f}" for rate in own)) for name, own in rows]
        header = ("true class", *(f"P(predicted {name})" for name in self.classes))
        return html_table(header, cells, caption=repr(self)[1:-1])

    def classify(self, signal: Array) -> str:
        """Return the hard label of one person's trajectory (channels, time points), or features (features,).

        Raises:
            DataError: the trajectory does not match the training data or is not finite.
        """
        return self.classify_many(to_numbers(signal, "the signal")[None])[0]

    def classify_many(self, trajectories: npt.ArrayLike) -> list[str]:
        """Return the hard labels of (n, channels, time points); raises as `classify`."""
        return apply_threshold(self.classes, self.probabilities(trajectories), self.threshold)

    def probabilities(self, trajectories: npt.ArrayLike) -> Array:
        """(n, K) the uncalibrated probabilities of `classes` for (n, channels, time points)."""
        return predict_proba(self.estimator, to_numbers(trajectories, "the trajectories"))

    @property
    def classes(self) -> tuple[str, ...]:
        """(K,) the class names in the order of the probabilities."""
        return tuple(str(name) for name in self.estimator.classes_)

    def soft(self) -> SoftClassifier:
        """Return the same classifier with likelihoods instead of labels.

        Raises:
            DataError: it was not validated, so it has no calibration.
        """
        if self.calibration is None:
            raise DataError(
                "soft evidence needs a calibrated classifier; this one was trained without cross-validation"
            )
        return SoftClassifier(self, self.calibration)

    @check_arguments
    def sets(self, coverage: float | None = None) -> SoftClassifier:
        """Return the same classifier with likelihoods of its prediction sets instead of labels.

        Args:
            coverage: the expected coverage of the sets; None accepts any.

        Raises:
            DataError: it was not validated, so it has no prediction sets, or theirs is another coverage.
        """
        sets = self.prediction_sets
        if sets is None:
            raise DataError(
                "evidence by sets needs a classifier with prediction sets; this one was trained without"
                " cross-validation, or by an older version"
            )
        if coverage is not None and coverage != sets.coverage:
            raise DataError(
                f"the classifier has prediction sets of coverage {sets.coverage:g}, not {coverage:g}; train"
                " it again for another one"
            )
        return SoftClassifier(self, sets)

    def as_evidence(self, kind: EvidenceKind) -> TrainedClassifier | SoftClassifier:
        """Return the classifier that gives a kind of evidence; raises as `soft` and `sets`."""
        makers: dict[str, Callable[[], TrainedClassifier | SoftClassifier]] = {
            "hard": lambda: self,
            "soft": self.soft,
            "set": lambda: self.sets(kind.coverage),
        }
        return makers[kind.name]()


@dataclass(frozen=True, eq=False)
class SoftClassifier:
    """A trained classifier that returns the likelihood of each class; a `protocols.Classifier`.

    The reasoner multiplies its prior knowledge by the likelihood, see `Domain.soft_program`.

    source: of the likelihoods: calibrated probabilities, or prediction sets.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import QuadraticLogistic, train_and_validate
        >>> data = Dataset([[0.1 * n] for n in range(20)], 10 * ["stands"] + 10 * ["walks"])  # speeds in m/s
        >>> classifier, _ = train_and_validate(QuadraticLogistic(C=1), data)
        >>> classifier.soft().classify([1.9])
        Likelihood(stands: 0.06..., walks: 1)
    """

    trained: TrainedClassifier
    source: Calibration | PredictionSets

    def __repr__(self) -> str:
        return f"<SoftClassifier of {self.trained!r}; evidence {self.evidence}>"

    @property
    def evidence(self) -> EvidenceKind:
        """The kind of evidence that it gives."""
        return EvidenceKind(self.source.evidence)

    def classify(self, signal: Array) -> Likelihood:
        """Return the likelihood of each class for one person's trajectory (channels, time points).

        Raises:
            DataError: the trajectory does not match the training data or is not finite.
        """
        return self.classify_many(to_numbers(signal, "the signal")[None])[0]

    def classify_many(self, trajectories: npt.ArrayLike) -> list[Likelihood]:
        """Return the likelihoods of (n, channels, time points); raises as `classify`."""
        return self.source.likelihoods(self.trained.probabilities(trajectories))


@check_arguments
def train(estimator: Any, dataset: Dataset) -> TrainedClassifier:
    """Train a clone of `estimator` on all of `dataset`, without validation.

    Args:
        estimator: a scikit-learn classifier on (cases, channels, time points), or (cases, features), e.g. a
            `learner`.

    Raises:
        DataError: `dataset` is not trainable, see `check_trainable`, or the estimator fails.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import QuadraticLogistic, train
        >>> data = Dataset([[0.1 * n] for n in range(20)], 10 * ["stands"] + 10 * ["walks"])  # speeds in m/s
        >>> train(QuadraticLogistic(), data).classify_many([[0.2], [1.3]])
        ['stands', 'walks']
    """
    check_trainable(dataset)
    usable = ensure_predict_proba(estimator)
    fitted = fit_clone(usable, dataset.trajectories, np.array(dataset.labels), dataset.weights)
    return TrainedClassifier(fitted, inputs=dataset.channels)


@check_arguments
def train_and_validate(
    estimator: Any,
    dataset: Dataset,
    *,
    folds: int | None = None,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
    coverage: float = COVERAGE,
) -> tuple[TrainedClassifier, Validation]:
    """Train on all of `dataset` and cross-validate: rho and C of Algorithm 1, lines 1 and 2.

    The final training runs in parallel with the folds; arguments and errors are those of `cross_validate`.
    Calibration and prediction sets are fitted to all out-of-fold predictions; `coverage` is that of the sets.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import QuadraticLogistic, train_and_validate
        >>> labels = 4 * ["stands"] + ["walks"] + 5 * ["stands"] + 10 * ["walks"]  # one person walks slowly
        >>> data = Dataset([[0.1 * n] for n in range(20)], labels)
        >>> classifier, validation = train_and_validate(QuadraticLogistic(), data)
        >>> classifier.confusion.counts.tolist(), validation.predictions[4]
        ([[8.0, 1.0], [1.0, 10.0]], 'stands')
    """
    check_coverage(coverage)
    trained, validation = fit_and_validate(estimator, dataset, folds, seed, jobs, progress)
    calibration = fit_calibration(
        validation.classes, validation.probabilities, validation.labels, validation.weights
    )
    sets = fit_prediction_sets(validation, coverage)
    classifier = TrainedClassifier(trained, validation.confusion, calibration, None, dataset.channels, sets)
    return classifier, validation
