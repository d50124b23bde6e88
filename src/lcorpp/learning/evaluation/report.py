"""Evaluation report: all results of a cross-validation in one value."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from sklearn.metrics import roc_curve

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.evaluation.calibration import Calibration, cross_calibrate, fit_calibration
from lcorpp.learning.evaluation.folds import count_people
from lcorpp.learning.evaluation.metrics import (
    ReliabilityBin,
    bootstrap_interval,
    brier,
    cluster_bootstrap_weights,
    compute_auc,
    expected_calibration_error,
    expected_ece_if_calibrated,
    reliability,
)
from lcorpp.learning.evaluation.prediction_sets import PredictionSets, fit_prediction_sets
from lcorpp.learning.evaluation.thresholds import GOALS, ThresholdChoice, choose_threshold
from lcorpp.learning.evaluation.validation import Rate, Validation
from lcorpp.notebook import html_table
from lcorpp.values import COVERAGE, Array, Flags, Interval

NAN = float("nan")


@dataclass(frozen=True, eq=False)
class ProbabilityQuality:
    """Quality of the probabilities of one class.

    scores: (cases,) the out-of-fold probabilities.
    brier: Brier score.
    ece: expected calibration error. ece_if_calibrated: its expectation if the probabilities were perfect,
        which is above 0 for a finite number of cases.
    reliability: the reliability diagram.
    """

    scores: Array
    brier: Interval
    ece: Interval
    ece_if_calibrated: float
    reliability: tuple[ReliabilityBin, ...]


@dataclass(frozen=True, eq=False)
class ClassReport:
    """Discrimination and calibration of one class against the others.

    name: the class. cases: number of its cases. positive: (all cases,) which cases are of it.
    auc: area under the ROC curve. roc: (2, points) the curve: false positive rate and true positive rate.
    raw: quality of the classifier's probabilities. calibrated: the same after calibration, each fold
        calibrated by a fit to the others.
    thresholds: the best decision threshold for each goal.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import QuadraticLogistic, build_report, cross_validate
        >>> data = Dataset([[0.1 * n] for n in range(20)], 10 * ["stands"] + 10 * ["walks"])  # speeds in m/s
        >>> walks = build_report(cross_validate(QuadraticLogistic(), data), positive="walks").classes[0]
        >>> walks.name, walks.cases, walks.auc
        ('walks', 10, Interval(0.990 [0.940, 1.000], 0.95))
    """

    name: str
    cases: int
    positive: Flags
    auc: Interval
    roc: Array
    raw: ProbabilityQuality
    calibrated: ProbabilityQuality
    thresholds: tuple[ThresholdChoice, ...]

    def __repr__(self) -> str:
        return f"<ClassReport {self.name}: {self.cases} cases; AUC {self.auc}; ECE {self.raw.ece}>"


@dataclass(frozen=True)
class Row:
    """A row of a report's table. predicted: column of the confusion matrix, "" for other quantities."""

    class_name: str
    quantity: str
    interval: Interval
    predicted: str = ""

    @property
    def has_interval(self) -> bool:
        """Whether the ends of the interval are estimated."""
        return not np.isnan(self.interval.low) or np.isnan(self.interval.estimate)


@dataclass(frozen=True, eq=False)
class EvaluationReport:
    """Performance of a classifier on unseen people, with 95 % intervals that resample people.

    learner: its name. source: the source of the data.
    cases, people, folds: their numbers.
    accuracy: fraction of correct predictions. rates: (K, K) rates of the confusion matrix.
    classes: one report per class; for two classes only the positive one, as the other is its mirror image.
    calibration, sets: fitted to all out-of-fold predictions, for the classifier trained on all cases.
    """

    learner: str
    source: str
    cases: int
    people: int
    folds: int
    accuracy: Interval
    rates: tuple[tuple[Rate, ...], ...]
    classes: tuple[ClassReport, ...]
    calibration: Calibration
    sets: PredictionSets

    def __repr__(self) -> str:
        lines = [f"<EvaluationReport: {self.title}; accuracy {self.accuracy}"]
        lines += [f"  {one.name}: AUC {one.auc}, ECE {one.raw.ece}" for one in self.classes[:6]]
        if len(self.classes) > 6:
            lines.append(f"  ... ({len(self.classes)} classes)")
        return "\n".join(lines) + ">"

    def _repr_html_(self) -> str:
        body = [
            (
                row.class_name,
                row.quantity,
                f"{row.interval if row.has_interval else row.interval.estimate:.3f}",
            )
            for row in self.rows()
        ]
        return html_table(("class", "quantity", "value [95 % interval]"), body, caption=self.title)

    @property
    def is_binary(self) -> bool:
        """Whether there are two classes, so that `classes` contains the positive one only."""
        return len(self.classes) == 1

    @property
    def title(self) -> str:
        """The learner and the size of the data, in words."""
        size = f"{self.cases} cases of {self.people} people, {self.folds} folds"
        return f"{self.learner or 'classifier'}: {size}"

    def rows(self) -> Iterator[Row]:
        """Yield every quantity of the report; the ends of the interval are NaN if it has none."""
        yield Row("", "accuracy", self.accuracy)
        for rates in self.rates:
            for rate in rates:
                yield Row(rate.true, f"predicted {rate.predicted}", rate.interval, rate.predicted)
        sets = f"prediction sets of coverage {self.sets.coverage:g}"
        for name, interval in zip(self.sets.classes, self.sets.coverages, strict=True):
            yield Row(name, f"{sets}: true class in the set", interval)
        for quantity in ("mean size", "full", "empty"):
            value = getattr(self.sets, quantity.replace(" ", "_"))
            yield Row("", f"{sets}: {quantity}", Interval(value, NAN, NAN))
        for one in self.classes:
            yield Row(one.name, "AUC", one.auc)
            for suffix, quality in (("", one.raw), (", calibrated", one.calibrated)):
                yield Row(one.name, f"Brier score{suffix}", quality.brier)
                yield Row(one.name, f"expected calibration error{suffix}", quality.ece)
                if_calibrated = f"expected calibration error if perfectly calibrated{suffix}"
                yield Row(one.name, if_calibrated, Interval(quality.ece_if_calibrated, NAN, NAN))
            for choice in one.thresholds:
                best = f"{choice.label} at prevalence {choice.prevalence:.3g}"
                yield Row(one.name, f"threshold for {best}", Interval(choice.probability, NAN, NAN))
                yield Row(one.name, best, Interval(choice.score, NAN, NAN))


@check_arguments
def build_report(
    validation: Validation,
    *,
    positive: str | None = None,
    prevalence: Mapping[str, float] | None = None,
    costs: tuple[float, float] | None = None,
    learner: str = "",
    source: str = "",
    coverage: float = COVERAGE,
) -> EvaluationReport:
    """Compute all metrics of a cross-validation.

    Args:
        validation: the result of `cross_validate`, with labels.
        positive: the positive one of two classes; None takes the last in order.
        prevalence: class -> its prevalence where the classifier is used, for which thresholds are chosen;
            None takes the frequencies among the cases.
        costs: of a false negative and of a false positive: an additional goal of thresholds.
        learner, source: names to print.
        coverage: of the prediction sets.

    Raises:
        DataError: `positive` is unknown, a prevalence is missing or not between 0 and 1, or the cases are
            weighted.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import QuadraticLogistic, build_report, cross_validate
        >>> data = Dataset([[0.1 * n] for n in range(20)], 10 * ["stands"] + 10 * ["walks"])  # speeds in m/s
        >>> build_report(cross_validate(QuadraticLogistic(), data)).accuracy
        Interval(0.950 [0.850, 1.000], 0.95)
    """
    if (validation.weights != 1).any():
        raise DataError("a report is of cases of weight 1; these are weighted")
    classes, labels = validation.classes, np.array(validation.labels)
    if positive is not None and positive not in classes:
        raise DataError(f"no case is of class {positive!r}; {expected_one_of(classes)}")
    reported = classes if len(classes) > 2 else (positive or classes[-1],)
    prevalences = prevalence or {name: float(np.mean(labels == name)) for name in classes}
    missing = [name for name in reported if name not in prevalences]
    if missing:
        raise DataError(f"the prevalence of {missing[0]} is missing; expected {', '.join(reported)}")
    weights = cluster_bootstrap_weights(validation.groups)
    calibrated = cross_calibrate(validation)
    goals: list[str | tuple[float, float]] = [*GOALS, costs] if costs else [*GOALS]
    parts = []
    for name in reported:
        column, flags = classes.index(name), labels == name
        scores = validation.probabilities[:, column]
        fpr, tpr, _ = roc_curve(flags, scores)
        parts.append(
            ClassReport(
                name,
                int(flags.sum()),
                flags,
                _bootstrap(compute_auc, scores, flags, weights),
                np.stack([fpr, tpr]),
                _measure_quality(scores, flags, weights),
                _measure_quality(calibrated[:, column], flags, weights),
                tuple(
                    choose_threshold(scores, flags, validation.folds, prevalence=prevalences[name], goal=goal)
                    for goal in goals
                ),
            )
        )
    correct = np.array(validation.predictions) == labels
    return EvaluationReport(
        learner,
        source,
        len(labels),
        count_people(validation.groups),
        len(set(validation.folds)),
        bootstrap_interval(float(correct.mean()), weights @ correct / weights.sum(axis=1)),
        validation.rates,
        tuple(parts),
        fit_calibration(classes, validation.probabilities, validation.labels),
        fit_prediction_sets(validation, coverage),
    )


def _measure_quality(scores: Array, positive: Flags, weights: Array) -> ProbabilityQuality:
    return ProbabilityQuality(
        scores,
        _bootstrap(brier, scores, positive, weights),
        _bootstrap(expected_calibration_error, scores, positive, weights),
        expected_ece_if_calibrated(scores),
        reliability(scores, positive),
    )


def _bootstrap(
    metric: Callable[[Array, Flags, Array], Array], scores: Array, positive: Flags, weights: Array
) -> Interval:
    once = np.ones((1, len(scores)))
    return bootstrap_interval(float(metric(scores, positive, once)[0]), metric(scores, positive, weights))
