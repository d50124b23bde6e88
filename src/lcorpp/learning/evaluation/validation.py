"""Cross-validation on unseen people, with intervals for the rates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

import joblib
import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments, check_fields
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.contract import clone_unfitted, ensure_predict_proba, fit_clone, predict_proba
from lcorpp.learning.evaluation.folds import assign_training_folds, choose_folds, find_training_cases
from lcorpp.learning.evaluation.metrics import compute_auc, jeffreys_interval
from lcorpp.notebook import html_table
from lcorpp.values import JEFFREYS, Array, ConfusionMatrix, Dataset, Flags, Interval, freeze
from lcorpp.workers import run_in_workers

Progress = Callable[[int, int], None]
"""Callback (parts done, number of parts)."""

WHOLE = -1
"""The part of the work that trains on all cases; the others are the numbers of the folds."""


@dataclass(frozen=True)
class Rate:
    """The fraction of cases of class `true` with predicted class `predicted`: count / cases.

    count, cases: sums of weights if the cases have some.

    Examples:
        >>> from lcorpp import ConfusionMatrix
        >>> from lcorpp.learning import estimate_rates
        >>> rate = estimate_rates(ConfusionMatrix(("no", "yes"), [[8, 2], [1, 9]]))[0][1]
        >>> rate.true, rate.predicted, rate.value
        ('no', 'yes', 0.2)
    """

    true: str
    predicted: str
    count: float
    cases: float
    interval: Interval

    @property
    def value(self) -> float:
        """count / cases; 0 if there are no cases."""
        return self.interval.estimate


@dataclass(frozen=True, eq=False)
class Validation:
    """Result of cross-validation: each case is predicted once, by a classifier trained without its group.

    confusion: counts over all folds, classes in sorted order.
    predictions: (cases,) the predicted classes.
    probabilities: (cases, K) the predicted distributions, columns as `classes`.
    auc: area under the ROC curve of the pooled probabilities; None unless there are two classes.
    folds: (cases,) the fold in which each case was held out.
    labels: (cases,) the true classes.
    groups: (cases,) the group, e.g. the person, of each case.
    weights: (cases,) as in `Dataset`; `confusion`, `auc` and what follows from them count cases by weight.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import QuadraticLogistic, cross_validate
        >>> data = Dataset([[0.1 * n] for n in range(20)], 10 * ["stands"] + 10 * ["walks"])  # speeds in m/s
        >>> validation = cross_validate(QuadraticLogistic(), data)
        >>> validation.accuracy, validation.auc, validation.recalls[1].value
        (0.95, 0.99, 0.9)
    """

    confusion: ConfusionMatrix
    predictions: tuple[str, ...]
    probabilities: Array
    auc: float | None
    folds: tuple[int, ...]
    labels: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()
    weights: Array = field(default_factory=lambda: np.ones(0))

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "probabilities", freeze(self.probabilities))
        object.__setattr__(
            self, "weights", freeze(self.weights if np.size(self.weights) else np.ones(len(self.labels)))
        )

    def __repr__(self) -> str:
        auc = "" if self.auc is None else f", AUC {self.auc:.3f}"
        return (
            f"<Validation: {len(self.labels)} cases, {len(set(self.groups))} groups,"
            f" {len(set(self.folds))} folds; accuracy {self.accuracy:.3f}{auc}>"
        )

    def _repr_html_(self) -> str:
        rows = [[row[0].true, *(f"{r.count:g} ({r.interval})" for r in row)] for row in self.rates]
        header = ["true class", *(f"predicted {name}" for name in self.classes)]
        return html_table(header, rows, caption=repr(self)[1:-1])

    @property
    def classes(self) -> tuple[str, ...]:
        """(K,) the class names in sorted order."""
        return self.confusion.classes

    @property
    def accuracy(self) -> float:
        """The fraction of correct predictions."""
        return float(np.trace(self.confusion.counts) / self.confusion.counts.sum())

    @property
    def rates(self) -> tuple[tuple[Rate, ...], ...]:
        """(K, K) the rates of the confusion matrix with Jeffreys' 95 % intervals; see `estimate_rates`."""
        return estimate_rates(self.confusion)

    @property
    def recalls(self) -> tuple[Rate, ...]:
        """(K,) the recall of each class: the diagonal of `rates`."""
        return tuple(row[i] for i, row in enumerate(self.rates))

    @check_arguments
    def with_predictions(self, predictions: Sequence[str]) -> Validation:
        """Return a copy with other predicted classes (cases,), e.g. by another decision threshold.

        Raises:
            DataError: there are other numbers of cases and predictions, or an unknown class.
        """
        unknown = sorted(set(predictions) - set(self.classes))
        if unknown:
            raise DataError(f"unknown class {unknown[0]!r}; {expected_one_of(self.classes)}")
        if len(predictions) != len(self.labels):
            raise DataError(f"{len(self.labels)} cases need as many predictions, not {len(predictions)}")
        confusion = count_confusion(self.classes, self.labels, predictions, self.weights)
        return replace(self, confusion=confusion, predictions=tuple(predictions))


@check_arguments
def estimate_rates(
    confusion: ConfusionMatrix, level: float = 0.95, smoothing: Fraction = JEFFREYS
) -> tuple[tuple[Rate, ...], ...]:
    """(K, K) the entries of a confusion matrix as rates of their row, with Beta intervals.

    For two classes the diagonal is the true positive rate and the true negative rate.

    Args:
        level: the posterior probability of the interval, between 0 and 1.
        smoothing: of the counts: `JEFFREYS` gives Jeffreys' interval, `LAPLACE` that of a uniform prior.

    Raises:
        DataError: `level` is not between 0 and 1.

    Examples:
        >>> from lcorpp import ConfusionMatrix
        >>> from lcorpp.learning import estimate_rates
        >>> rates = estimate_rates(ConfusionMatrix(("no", "yes"), [[8, 2], [1, 9]]))
        >>> rates[0][1].interval  # P(predicted yes | true no)
        Interval(0.200 [0.044, 0.503], 0.95)
    """
    if not 0 < level < 1:
        raise DataError(f"the level of an interval is {level}; expected a number between 0 and 1")
    names, counts = confusion.classes, confusion.counts
    counts = (counts.astype(int) if (counts == np.round(counts)).all() else counts).tolist()

    def rate(row: int, column: int) -> Rate:
        count, cases = counts[row][column], sum(counts[row])
        own, others = confusion.effective_counts[row, column].tolist()
        interval = jeffreys_interval(own, own + others, level=level, smoothing=float(smoothing))
        estimate = count / cases if cases else 0.0
        return Rate(names[row], names[column], count, cases, replace(interval, estimate=estimate))

    n = len(names)
    return tuple(tuple(rate(row, column) for column in range(n)) for row in range(n))


@check_arguments
def cross_validate(
    estimator: Any,
    dataset: Dataset,
    *,
    folds: int | None = None,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> Validation:
    """Predict every case by a classifier trained on the other folds.

    The folds are stratified and keep groups whole.

    Args:
        estimator: a scikit-learn classifier on (cases, channels, time points), see `ensure_predict_proba`;
            each fold uses a clone. Its own `progress` is not called.
        folds: number of folds; None takes 5, or holds out each of at most ten people alone.
        seed: seed of the split.
        jobs: number of processes; it does not affect the result.
        progress: callback after each fold.

    Raises:
        DataError: `dataset` is not trainable or cannot be split, see `check_trainable`; or the estimator
            fails, or gives no probabilities.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import QuadraticLogistic, cross_validate
        >>> labels = 4 * ["stands"] + ["walks"] + 5 * ["stands"] + 10 * ["walks"]  # one person walks slowly
        >>> validation = cross_validate(QuadraticLogistic(), Dataset([[0.1 * n] for n in range(20)], labels))
        >>> validation.confusion.counts.tolist(), validation.predictions[4]
        ([[8.0, 1.0], [1.0, 10.0]], 'stands')
    """
    return fit_and_validate(estimator, dataset, folds, seed, jobs, progress, whole=False)[1]


def fit_and_validate(
    estimator: Any,
    dataset: Dataset,
    folds: int | None,
    seed: int,
    jobs: int,
    progress: Progress | None,
    *,
    whole: bool = True,
) -> tuple[Any, Validation]:
    """`cross_validate`, and in parallel a classifier trained on all cases (None unless `whole`)."""
    if jobs < 1 and jobs != -1:
        raise DataError(f"jobs is {jobs}; expected a number of processes, 1 or more, or -1 for all cores")
    labels = np.array(dataset.labels)
    classes, weights = np.unique(labels), dataset.weights
    folds = choose_folds(dataset) if folds is None else folds
    fold_of = assign_training_folds(dataset, folds, seed)
    parts = [WHOLE, *range(folds)] if whole else list(range(folds))  # the longest first, to balance the load
    quiet = _clone_without_progress(ensure_predict_proba(estimator))
    work = (
        joblib.delayed(_train_and_predict)(
            quiet, dataset.trajectories, labels, weights, fold_of == part, dataset.groups, part
        )
        for part in parts
    )
    final = None
    probabilities = np.empty((len(dataset), len(classes)))
    own = joblib.parallel_config(backend="loky")  # processes, whatever the caller has configured
    with own, run_in_workers(work, jobs=min(jobs, len(parts)), threads=1) as results:
        for done, (part, result) in enumerate(results, start=1):
            if part == WHOLE:
                final = result
            else:
                probabilities[fold_of == part] = result
            if progress is not None:
                progress(done, len(parts))

    predictions = tuple(classes[probabilities.argmax(axis=1)].tolist())
    confusion = count_confusion(tuple(classes.tolist()), dataset.labels, predictions, weights)
    auc = None
    if len(classes) == 2:
        auc = float(compute_auc(probabilities[:, 1], labels == classes[1], weights[None])[0])
    held_out = tuple(fold_of.tolist())
    return final, Validation(
        confusion, predictions, probabilities, auc, held_out, dataset.labels, dataset.groups, weights
    )


def count_confusion(
    classes: tuple[str, ...], labels: Sequence[str], predictions: Sequence[str], weights: Array
) -> ConfusionMatrix:
    """Return the matrix of labels (cases,) by predictions (cases,), each case with its weight (cases,)."""
    columns = {name: column for column, name in enumerate(classes)}
    counts = np.zeros((len(classes), len(classes)))
    np.add.at(counts, ([columns[name] for name in labels], [columns[name] for name in predictions]), weights)
    return ConfusionMatrix(classes, counts)


def _clone_without_progress(estimator: Any) -> Any:
    """Clone the estimator without its progress callbacks, which may not be picklable."""
    parameters = estimator.get_params()
    callbacks = {name: value for name, value in parameters.items() if name.split("__")[-1] == "progress"}
    if all(value is None for value in callbacks.values()):
        return clone_unfitted(estimator)
    try:
        return clone_unfitted(estimator.set_params(**dict.fromkeys(callbacks)))
    finally:
        estimator.set_params(**callbacks)


def _train_and_predict(
    estimator: Any,
    tracks: Array,
    labels: npt.NDArray[np.str_],
    weights: Array,
    held_out: Flags,
    groups: Sequence[str],
    part: int,
) -> tuple[int, Any]:
    """Train without the cases of a fold, and of its people; return its number and the predictions for it.

    For `WHOLE`, without held out cases, the classifier stands in place of the predictions.
    """
    train = find_training_cases(held_out, groups)
    trained = fit_clone(estimator, tracks[train], labels[train], weights[train])
    return part, trained if part == WHOLE else predict_proba(trained, tracks[held_out])
