"""Predictions over the duration of tracks, and their calibration for each prefix length.

A classifier trained on whole tracks is as confident after a second as at the end, and biased to one class. A
calibration for each number of points, fitted to predictions for other people's prefixes of that length, gives
weak evidence at first and stronger evidence later.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self, TypeVar

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments, check_fields
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.evaluation.calibration import Calibration, fit_calibration, report_damage
from lcorpp.learning.evaluation.metrics import compute_auc
from lcorpp.values import Array, Lengths, check_rows, freeze, measure_lengths

T = TypeVar("T")

MIN_CASES = 20
"""The number of tracks that a calibration is fitted to, if not all tracks last so long."""


@dataclass(frozen=True, eq=False)
class PredictionTimeline:
    """The predictions for recorded tracks after each of their samples.

    probabilities: (cases, time points, K) after each sample, NaN before the first prediction and after the
        end of a track that is shorter than others.
    points: (time points,) number of points at the fixed rate after each sample; predictions change only with
        this number.
    labels: (cases,) the true classes. classes: (K,). interval: seconds between two time points.
    folds: (cases,) the fold in which each case was held out; () if the predictions are not out of fold.
    groups: (cases,) the group, e.g. the person, of each case; () if it is unknown.
    weights: (cases,) as in `Dataset`: AUC, calibrations and prediction sets count cases by weight.

    Examples:
        >>> from lcorpp.learning import PredictionTimeline
        >>> yes = [[0.5, 0.5], [0.3, 0.7], [0.1, 0.9]]  # of "no" and "yes" after each of three samples
        >>> no = [[0.6, 0.4], [0.2, 0.8], [0.7, 0.3]]
        >>> timeline = PredictionTimeline([yes, no], [1, 2, 3], ["yes", "no"], ["no", "yes"], interval=0.5)
        >>> timeline.seconds.tolist(), timeline.auc.tolist()
        ([0.0, 0.5, 1.0], [1.0, 0.0, 1.0])
    """

    probabilities: Array
    points: tuple[int, ...]
    labels: tuple[str, ...]
    classes: tuple[str, ...]
    interval: float
    folds: tuple[int, ...] = ()
    groups: tuple[str, ...] = ()
    weights: Array = field(default_factory=lambda: np.ones(0))

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "probabilities", freeze(self.probabilities))
        weights = self.weights if np.size(self.weights) else np.ones(len(self.labels))
        object.__setattr__(self, "weights", freeze(weights))

    def __repr__(self) -> str:
        cases, samples, _ = self.probabilities.shape
        aucs = ""
        if len(self.classes) == 2:
            quarter, half, whole = (self.auc_at(fraction) for fraction in (0.25, 0.5, 1.0))
            aucs = f"; AUC {quarter:.2f}, {half:.2f}, {whole:.2f} at a quarter, half, end"
        return f"<PredictionTimeline: {cases} tracks of {samples * self.interval:.3g} s{aucs}>"

    def take(self, cases: npt.ArrayLike) -> PredictionTimeline:
        """Return the timeline of some cases, by their numbers (k,); a DataError if there are none such."""
        cases = check_rows(cases, len(self.labels))
        return replace(
            self,
            probabilities=self.probabilities[cases],
            labels=tuple(self.labels[case] for case in cases),
            folds=tuple(self.folds[case] for case in cases) if self.folds else (),
            groups=tuple(self.groups[case] for case in cases) if self.groups else (),
            weights=self.weights[cases],
        )

    def require_folds(self) -> None:
        """Check that the predictions are out of fold.

        Raises:
            DataError: they are not.
        """
        if not self.folds:
            raise DataError("the timeline has no folds; expected the result of cross_predict_over_time")

    def require_equal_weights(self, name: str) -> None:
        """Check that all cases have weight 1.

        Args:
            name: what counts all cases alike.

        Raises:
            DataError: some have another weight.
        """
        if (self.weights != 1).any():
            raise DataError(f"{name} is of cases of weight 1; these are weighted")

    @property
    def seconds(self) -> Array:
        """(time points,) since the start of the track."""
        return np.arange(self.probabilities.shape[1], dtype=np.float64) * self.interval

    @check_arguments
    def probability_of(self, name: str) -> Array:
        """(cases, time points) the probability of a class.

        Raises:
            DataError: the class is unknown.
        """
        if name not in self.classes:
            raise DataError(f"unknown class {name!r}; {expected_one_of(self.classes)}")
        return self.probabilities[:, :, self.classes.index(name)]

    @property
    def auc(self) -> Array:
        """(time points,) the AUC of two classes among the tracks that last so long.

        It is NaN before the first prediction, and if these tracks are all of one class.

        Raises:
            DataError: there are not two classes.
        """
        scores = self._find_scores().T
        auc = np.full(len(scores), np.nan)
        for t, now in enumerate(scores):
            is_unchanged = t and np.array_equal(now, scores[t - 1], equal_nan=True)
            auc[t] = auc[t - 1] if is_unchanged else self._compute_auc(now)
        return auc

    @check_arguments
    def auc_at(self, fraction: float) -> float:
        """The AUC after the first `fraction` of each track, rounded as in `truncate`; raises as `auc`."""
        if not 0 <= fraction <= 1:
            raise DataError(f"the fraction of a track must lie in [0, 1], not {fraction}")
        last = np.rint(fraction * self.lengths).astype(np.int64).clip(1, self.probabilities.shape[1]) - 1
        return self._compute_auc(self._find_scores()[np.arange(len(last)), last])

    @property
    def lengths(self) -> Lengths:
        """(cases,) the number of time points until the last prediction of each track; 0 without one."""
        return measure_lengths(self.probabilities.transpose(0, 2, 1))

    def _find_scores(self) -> Array:
        """(cases, time points) the probability of the second of two classes."""
        if len(self.classes) != 2:
            raise DataError(f"an AUC needs two classes, not {len(self.classes)}")
        return self.probability_of(self.classes[1])

    def _compute_auc(self, scores: Array) -> float:
        """The AUC of scores of the second class (cases,); NaN are left out."""
        known = np.isfinite(scores)
        is_second = (np.array(self.labels) == self.classes[1])[known]
        return float(compute_auc(scores[known], is_second, self.weights[known][None])[0])


@dataclass(frozen=True, eq=False)
class PrefixCalibration:
    """One calibration per prefix length.

    min_points: points of the shortest prefix with a prediction.
    calibrations: for prefixes of `min_points` points, of one more, and so on; longer tracks use the last one.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.learning import PredictionTimeline, calibrate_prefixes
        >>> yes = np.array([[0.4, 0.6], [0.1, 0.9]])  # P(no), P(yes) after one point, after two
        >>> tracks = 8 * [yes] + 2 * [1 - yes] + 8 * [1 - yes] + 2 * [yes]  # correct in 80 % of the cases
        >>> labels, folds = 10 * ["yes"] + 10 * ["no"], 10 * [0, 1]
        >>> timeline = PredictionTimeline(tracks, (1, 2), labels, ("no", "yes"), 0.5, folds)
        >>> calibrated = calibrate_prefixes(timeline).calibrate(timeline)
        >>> calibrated.probability_of("yes")[0].round(2).tolist()
        [0.71, 0.75]
    """

    min_points: int
    calibrations: tuple[Calibration, ...]

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.calibrations:
            raise DataError("there is no prediction to calibrate: the tracks are too short")

    def __repr__(self) -> str:
        last = self.min_points + len(self.calibrations) - 1
        return f"<PrefixCalibration for {self.min_points} to {last} points>"

    @check_arguments
    def at(self, points: int) -> Calibration:
        """The calibration for prefixes of `points` points.

        Raises:
            DataError: there are no predictions for prefixes as short as that.
        """
        return select_by_points(self.calibrations, self.min_points, points)

    @check_arguments
    def calibrate(self, timeline: PredictionTimeline) -> PredictionTimeline:
        """Return the timeline with calibrated probabilities."""
        calibrated = np.array(timeline.probabilities)
        for column, points in enumerate(timeline.points):
            known = np.isfinite(calibrated[:, column]).all(axis=1)
            if known.any():
                calibrated[known, column] = self.at(points).calibrate(calibrated[known, column])
        return replace(timeline, probabilities=calibrated)

    def to_json(self) -> dict[str, Any]:
        """Return the parameters as plain values."""
        return {"least": self.min_points, "calibrations": [each.to_json() for each in self.calibrations]}

    @classmethod
    def from_json(cls, numbers: Mapping[str, Any]) -> Self:
        """Restore the calibration that `to_json` returned.

        Raises:
            DataError: the parameters do not match.
        """
        with report_damage("the calibrations of prefixes"):
            return cls(int(numbers["least"]), tuple(map(Calibration.from_json, numbers["calibrations"])))


@check_arguments
def calibrate_prefixes(timeline: PredictionTimeline) -> PrefixCalibration:
    """Fit a calibration for each number of points to out-of-fold predictions.

    Of tracks of unequal length the last one is for the largest number of points that tracks of every class
    reach, `MIN_CASES` in all. If the samples are farther apart than the points, a number of points without a
    prediction has the calibration of the next smaller one.

    Args:
        timeline: the result of `cross_predict_over_time`.

    Raises:
        DataError: the timeline has no predictions.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.learning import PredictionTimeline, calibrate_prefixes
        >>> yes = np.array([[0.4, 0.6], [0.1, 0.9]])  # P(no), P(yes) after one point, after two
        >>> tracks = 8 * [yes] + 2 * [1 - yes] + 8 * [1 - yes] + 2 * [yes]  # correct in 80 % of the cases
        >>> labels, folds = 10 * ["yes"] + 10 * ["no"], 10 * [0, 1]
        >>> timeline = PredictionTimeline(tracks, (1, 2), labels, ("no", "yes"), 0.5, folds)
        >>> calibrate_prefixes(timeline).at(2).calibrate([[0.1, 0.9]]).round(2).tolist()
        [[0.25, 0.75]]
    """
    return PrefixCalibration(
        *fit_by_points(
            timeline, lambda part, p: fit_calibration(part.classes, p, list(part.labels), part.weights)
        )
    )


def fit_by_points(
    timeline: PredictionTimeline, fit: Callable[[PredictionTimeline, Array], T]
) -> tuple[int, tuple[T, ...]]:
    """Return the smallest number of points with a prediction, and the fits to it, one more, and so on.

    Args:
        fit: (part, probabilities) -> the fit to the cases with a prediction, probabilities (cases, K).
    """
    labels, fits = np.array(timeline.labels), dict[int, T]()
    for column, points in enumerate(timeline.points):
        known = np.isfinite(timeline.probabilities[:, column]).all(axis=1)
        is_enough = known.all() or (known.sum() >= MIN_CASES and set(labels[known]) == set(labels))
        if is_enough and points not in fits:
            part = timeline.take(np.flatnonzero(known))
            fits[points] = fit(part, part.probabilities[:, column])
    first, last = min(fits, default=0), max(fits, default=-1)
    for points in range(first, last):
        fits.setdefault(points + 1, fits[points])
    return first, tuple(fits[points] for points in range(first, last + 1))


def select_by_points(fits: Sequence[T], min_points: int, points: int) -> T:
    """Return the fit for prefixes of `points` points; `fits` begin at `min_points`, longer ones use the last.

    Raises:
        DataError: there are no predictions for prefixes as short as that.
    """
    if points < min_points:
        raise DataError(f"there is no prediction after {points} points; {min_points} are needed")
    return fits[min(points - min_points, len(fits) - 1)]


@check_arguments
def cross_calibrate_prefixes(timeline: PredictionTimeline) -> PredictionTimeline:
    """Return the timeline with the predictions of each fold calibrated by a fit to the other folds.

    Raises:
        DataError: the timeline has no folds or no predictions.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.learning import PredictionTimeline, cross_calibrate_prefixes
        >>> yes = np.array([[0.4, 0.6], [0.1, 0.9]])  # P(no), P(yes) after one point, after two
        >>> tracks = 8 * [yes] + 2 * [1 - yes] + 8 * [1 - yes] + 2 * [yes]  # correct in 80 % of the cases
        >>> labels, folds = 10 * ["yes"] + 10 * ["no"], 10 * [0, 1]
        >>> timeline = PredictionTimeline(tracks, (1, 2), labels, ("no", "yes"), 0.5, folds)
        >>> cross_calibrate_prefixes(timeline).probability_of("yes")[0].round(2).tolist()
        [0.65, 0.71]
    """
    timeline.require_folds()
    folds = np.array(timeline.folds)
    calibrated = np.array(timeline.probabilities)
    for fold in np.unique(folds):
        calibration = calibrate_prefixes(timeline.take(np.flatnonzero(folds != fold)))
        part = timeline.take(np.flatnonzero(folds == fold))
        calibrated[folds == fold] = calibration.calibrate(part).probabilities
    return replace(timeline, probabilities=calibrated)
