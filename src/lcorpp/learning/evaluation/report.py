"""All that cross-validation says of a classifier, in one value: for a table, for files and for a figure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from sklearn.metrics import roc_curve

from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.evaluation.calibration import Calibration, calibration_of, cross_calibrated
from lcorpp.learning.evaluation.intervals import Interval, percentile_interval, resampled
from lcorpp.learning.evaluation.metrics import (
    Bin,
    Flags,
    auc,
    brier,
    calibration_error,
    error_by_chance,
    reliability,
)
from lcorpp.learning.evaluation.thresholds import GOALS, Threshold, choose_threshold
from lcorpp.learning.evaluation.validation import Rate, Validation, rates_intervals
from lcorpp.values import Array


@dataclass(frozen=True, eq=False)
class Probabilities:
    """How right the probabilities of one class are.

    scores: (cases,) the probabilities themselves, out of fold.
    brier: mean squared distance from the truth. error: expected calibration error; by_chance is the one that
        probabilities would show that are exactly right, so many cases being few.
    """

    scores: Array
    brier: Interval
    error: Interval
    by_chance: float
    reliability: tuple[Bin, ...]


@dataclass(frozen=True, eq=False)
class OneClass:
    """How well one class is told from the others.

    name: the class. cases: how many are of it. positive: (cases in all,) which.
    auc: area under the ROC curve. roc: (2, points) the curve, false alarms and hits.
    said: the probabilities as the classifier gives them. calibrated: put right, each fold by the others.
    thresholds: from where on to call a case so, for each goal.
    """

    name: str
    cases: int
    positive: Flags
    auc: Interval
    roc: Array
    said: Probabilities
    calibrated: Probabilities
    thresholds: tuple[Threshold, ...]


@dataclass(frozen=True, eq=False)
class Report:
    """How good a classifier is, on people it had not seen.

    learner: what it is called. source: of the data.
    cases, people, folds: how many. Intervals are by people, 95 %.
    accuracy: the share of cases called right. rates: of the confusion matrix, row by row.
    classes: one for each class; of two only the positive one, as the other is its mirror image.
    calibration: as fitted on all out-of-fold predictions, for the classifier trained on all cases.
    """

    learner: str
    source: str
    cases: int
    people: int
    folds: int
    accuracy: Interval
    rates: tuple[tuple[Rate, ...], ...]
    classes: tuple[OneClass, ...]
    calibration: Calibration


def report_on(
    validation: Validation,
    *,
    positive: str | None = None,
    prevalence: Mapping[str, float] | None = None,
    costs: tuple[float, float] | None = None,
    learner: str = "",
    source: str = "",
) -> Report:
    """Work out everything that a cross-validation says.

    Args:
        validation: with its labels, as `cross_validate` gives it.
        positive: of two classes the one to tell of; None takes the last in order.
        prevalence: class -> how common it is where the classifier will be used; None takes the shares among
            the cases. Thresholds are chosen for it.
        costs: of missing somebody of the class, and of a false alarm: one more goal of thresholds.
        learner, source: names for people to read.

    Raises:
        DataError: there is no such class, or a prevalence is not between 0 and 1.
    """
    classes, labels = validation.classes, np.array(validation.labels)
    if positive is not None and positive not in classes:
        raise DataError(f"no case is of class {positive!r}; {expected_one_of(classes)}")
    told = classes if len(classes) > 2 else (positive or classes[-1],)
    common = prevalence or {name: float(np.mean(labels == name)) for name in classes}
    missing = [name for name in told if name not in common]
    if missing:
        raise DataError(f"the prevalence of {missing[0]} is missing; expected {', '.join(told)}")
    weights = resampled(validation.groups)
    calibrated = cross_calibrated(validation)
    goals: list[str | tuple[float, float]] = [*GOALS, *([costs] if costs else [])]
    parts = []
    for name in told:
        column, flags = classes.index(name), labels == name
        scores = validation.probabilities[:, column]
        alarms, hits, _ = roc_curve(flags, scores)
        parts.append(
            OneClass(
                name,
                int(flags.sum()),
                flags,
                _interval(auc, scores, flags, weights),
                np.stack([alarms, hits]),
                _probabilities(scores, flags, weights),
                _probabilities(calibrated[:, column], flags, weights),
                tuple(
                    choose_threshold(scores, flags, validation.folds, prevalence=common[name], goal=goal)
                    for goal in goals
                ),
            )
        )
    right = np.array(validation.predictions) == labels
    return Report(
        learner,
        source,
        len(labels),
        len(set(validation.groups)),
        len(set(validation.folds)),
        percentile_interval(float(right.mean()), weights @ right / weights.sum(axis=1)),
        rates_intervals(validation.confusion),
        tuple(parts),
        calibration_of(validation),
    )


def _probabilities(scores: Array, positive: Flags, weights: Array) -> Probabilities:
    return Probabilities(
        scores,
        _interval(brier, scores, positive, weights),
        _interval(calibration_error, scores, positive, weights),
        error_by_chance(scores),
        reliability(scores, positive),
    )


def _interval(
    figure: Callable[[Array, Flags, Array], Array], scores: Array, positive: Flags, weights: Array
) -> Interval:
    alone = np.ones((1, len(scores)))
    return percentile_interval(float(figure(scores, positive, alone)[0]), figure(scores, positive, weights))
