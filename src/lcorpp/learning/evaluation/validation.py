"""How good a classifier is: cross-validated on people it has not seen, with intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import joblib
import numpy as np
import numpy.typing as npt
from scipy.special import betaincinv
from sklearn.base import clone
from sklearn.metrics import confusion_matrix, roc_auc_score
from sklearn.model_selection import StratifiedGroupKFold

from lcorpp.errors import DataError
from lcorpp.learning.classifiers.contract import fitted, predicted, with_probabilities
from lcorpp.learning.data.dataset import check_trainable
from lcorpp.values import JEFFREYS, Array, ConfusionMatrix, Dataset, freeze
from lcorpp.workers import ignore_sigint

Progress = Callable[[int, int], None]
"""Told (parts done, parts in all)."""

Rows = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Rate:
    """How often cases of class `given` were called `called`: a share with its interval.

    count of cases were called so; value = count / cases; low and high bound the interval.
    """

    given: str
    called: str
    count: int
    cases: int
    value: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Validation:
    """What cross-validation found; every case was predicted once, by a classifier that never saw its group.

    confusion: counts over all folds, classes in sorted order.
    predictions: (cases,) the class each case was called.
    probabilities: (cases, K) the predicted distributions, columns as `classes`.
    auc: area under the ROC curve of the pooled probabilities; None unless there are two classes.
    folds: (cases,) the fold in which each case was held out.
    labels: (cases,) the class each case is of.
    groups: (cases,) whom each is of.
    """

    confusion: ConfusionMatrix
    predictions: tuple[str, ...]
    probabilities: Array
    auc: float | None
    folds: tuple[int, ...]
    labels: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "probabilities", freeze(self.probabilities))

    @property
    def classes(self) -> tuple[str, ...]:
        """(K,) the class names in sorted order."""
        return self.confusion.classes

    @property
    def accuracy(self) -> float:
        """The share of cases called what they are."""
        return float(np.trace(self.confusion.counts) / self.confusion.counts.sum())

    def rates_interval(self, level: float = 0.95) -> tuple[tuple[Rate, ...], ...]:
        """Every entry of the confusion matrix as a rate with its interval; see `rates_intervals`."""
        return rates_intervals(self.confusion, level)

    def recalled(self, predictions: Sequence[str]) -> Validation:
        """The same cases called otherwise, e.g. by another threshold: (cases,) class names."""
        counts = confusion_matrix(self.labels, list(predictions), labels=list(self.classes))
        confusion = ConfusionMatrix(self.classes, counts.astype(np.float64))
        return replace(self, confusion=confusion, predictions=tuple(predictions))

    def summary(self) -> tuple[Rate, ...]:
        """(K,) how often each class is recognised: the diagonal of `rates_interval`."""
        return tuple(row[i] for i, row in enumerate(self.rates_interval()))


def rates_intervals(
    confusion: ConfusionMatrix, level: float = 0.95, smoothing: Fraction = JEFFREYS
) -> tuple[tuple[Rate, ...], ...]:
    """Every entry of a confusion matrix as a rate of its row, with its Beta interval.

    The diagonal of two classes is what is called TPR and TNR. An end of the interval is 0 where nothing was
    counted and 1 where everything was, as is usual for Jeffreys' intervals.

    Args:
        level: the probability that the interval holds.
        smoothing: of the counts: `JEFFREYS` gives Jeffreys' interval, `LAPLACE` that of a uniform prior.

    Source: Brown, Cai and DasGupta, Statistical Science 16, 2001.
    """
    rows = []
    for given, row in zip(confusion.classes, confusion.counts.astype(int).tolist(), strict=True):
        cases = sum(row)
        rates = []
        for called, count in zip(confusion.classes, row, strict=True):
            a, b, tail = count + float(smoothing), cases - count + float(smoothing), (1 - level) / 2
            low = float(betaincinv(a, b, tail)) if count else 0.0
            high = float(betaincinv(a, b, 1 - tail)) if count < cases else 1.0
            rates.append(Rate(given, called, count, cases, count / cases if cases else 0.0, low, high))
        rows.append(tuple(rates))
    return tuple(rows)


def cross_validate(
    estimator: Any,
    dataset: Dataset,
    *,
    folds: int = 5,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> Validation:
    """Predict every case from training on the other folds; groups stay together, classes in proportion.

    Args:
        estimator: a scikit-learn classifier on (cases, channels, time points), see `with_probabilities`; it
            is cloned for every fold and stays as it is. Its own `progress` is not called.
        folds: parts the groups are divided into.
        seed: of the division.
        jobs: processes to use; the result is the same for any number.
        progress: told how many folds are done.

    Raises:
        DataError: `dataset` cannot be learnt from or divided so; see `check_trainable`. The estimator fails,
            or gives no probabilities.
    """
    return fit_and_validate(estimator, dataset, folds, seed, jobs, progress, whole=False)[1]


def fit_and_validate(
    estimator: Any,
    dataset: Dataset,
    folds: int,
    seed: int,
    jobs: int,
    progress: Progress | None,
    *,
    whole: bool = True,
) -> tuple[Any, Validation]:
    """`cross_validate`, and beside the folds a classifier trained on all cases (None unless `whole`)."""
    if folds < 2:
        raise DataError(f"cross-validation needs at least 2 folds, not {folds}")
    if not 0 <= seed < 2**32:
        raise DataError(f"the seed must lie between 0 and {2**32 - 1}, not {seed}")
    check_trainable(dataset, folds=folds)
    labels = np.array(dataset.labels)
    classes = np.unique(labels)
    held_out = _held_out(dataset, labels, folds, seed)
    everything = np.arange(len(dataset))
    parts: list[tuple[int, Rows, Rows]] = [
        (fold, everything[held_out != fold], everything[held_out == fold]) for fold in range(folds)
    ]
    if whole:
        parts.insert(0, (-1, everything, everything[:0]))  # the longest first, the others fill up

    quiet = _silenced(with_probabilities(estimator))
    work = (
        joblib.delayed(_part)(quiet, dataset.trajectories, labels, classes, fold, train, test)
        for fold, train, test in parts
    )
    final = None
    probabilities = np.empty((len(dataset), len(classes)))
    with joblib.parallel_config(backend="loky", n_jobs=min(jobs, len(parts)), inner_max_num_threads=1):
        with ignore_sigint():
            results = joblib.Parallel(return_as="generator_unordered")(work)
        for done, (fold, trained, told) in enumerate(results, start=1):
            if fold < 0:
                final = trained
            else:
                probabilities[held_out == fold] = told
            if progress is not None:
                progress(done, len(parts))

    predictions = classes[probabilities.argmax(axis=1)]
    names = tuple(classes.tolist())
    counts = confusion_matrix(labels, predictions, labels=classes).astype(np.float64)
    auc = float(roc_auc_score(labels == classes[1], probabilities[:, 1])) if len(classes) == 2 else None
    return final, Validation(
        ConfusionMatrix(names, counts),
        tuple(predictions.tolist()),
        probabilities,
        auc,
        tuple(held_out.tolist()),
        dataset.labels,
        dataset.groups,
    )


def _held_out(dataset: Dataset, labels: npt.NDArray[np.str_], folds: int, seed: int) -> Rows:
    """(cases,) the fold in which each case is held out."""
    held_out = np.empty(len(dataset), dtype=np.intp)
    splitter = StratifiedGroupKFold(folds, shuffle=True, random_state=seed)
    for fold, (_, test) in enumerate(splitter.split(labels, labels, np.array(dataset.groups))):
        held_out[test] = fold
    for fold in range(folds):
        missing = sorted(set(dataset.labels) - set(labels[held_out != fold].tolist()))
        if missing:  # can happen where a group holds several classes
            raise DataError(
                f"without fold {fold + 1} of {folds} there is no case of {', '.join(missing)} to learn"
            )
    return held_out


def _silenced(estimator: Any) -> Any:
    """A clone that reports no progress: its callback belongs to this process and may not travel."""
    names = [name for name in estimator.get_params() if name.split("__")[-1] == "progress"]
    kept = {name: estimator.get_params()[name] for name in names}
    if not any(value is not None for value in kept.values()):
        return clone(estimator)
    try:
        return clone(estimator.set_params(**dict.fromkeys(names)))
    finally:
        estimator.set_params(**kept)


def _part(
    estimator: Any,
    tracks: Array,
    labels: npt.NDArray[np.str_],
    classes: npt.NDArray[np.str_],
    fold: int,
    train: Rows,
    test: Rows,
) -> tuple[int, Any, Array | None]:
    """Train on some rows; the trained classifier where there is nothing to test, else the predictions."""
    trained = fitted(estimator, tracks[train], labels[train])
    if trained.classes_.tolist() != classes.tolist():
        raise DataError(f"the classifier learnt {trained.classes_.tolist()}, not {classes.tolist()}")
    if not len(test):
        return fold, trained, None
    return fold, None, predicted(trained, tracks[test])
