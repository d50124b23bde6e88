"""Conformal prediction sets for each prefix length: a set after two seconds is not that of a whole track."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from lcorpp.arguments import check_arguments, check_fields
from lcorpp.errors import DataError
from lcorpp.learning.evaluation.calibration import report_damage
from lcorpp.learning.evaluation.prediction_sets import PredictionSets, fit_prediction_sets
from lcorpp.learning.evaluation.validation import Validation, count_confusion
from lcorpp.learning.streaming.timeline import PredictionTimeline, fit_by_points, select_by_points
from lcorpp.values import COVERAGE, Array, check_coverage


@dataclass(frozen=True, eq=False)
class PrefixSets:
    """The prediction sets of each prefix length.

    The coverage is that of each number of points among the people whose tracks last so long, not that of all
    the sets of a person together.

    min_points: points of the shortest prefix with a prediction.
    sets: for prefixes of `min_points` points, of one more, and so on; longer tracks use the last ones.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.learning import PredictionTimeline, fit_prefix_sets
        >>> yes = np.array([[0.4, 0.6], [0.1, 0.9]])  # P(no), P(yes) after one point, after two
        >>> tracks = 8 * [yes] + 2 * [1 - yes] + 8 * [1 - yes] + 2 * [yes]  # correct in 80 % of the cases
        >>> labels, folds = 10 * ["yes"] + 10 * ["no"], 10 * [0, 1]
        >>> timeline = PredictionTimeline(tracks, (1, 2), labels, ("no", "yes"), 0.5, folds)
        >>> sets = fit_prefix_sets(timeline, 0.9)
        >>> sets.at(1).predict([[0.2, 0.8]]), sets.at(2).predict([[0.2, 0.8]])
        ([('yes',)], [('yes', 'no')])
    """

    min_points: int
    sets: tuple[PredictionSets, ...]

    def __post_init__(self) -> None:
        check_fields(self)
        if not self.sets:
            raise DataError("there are no predictions to form sets of: the tracks are too short")

    def __repr__(self) -> str:
        last = self.min_points + len(self.sets) - 1
        return f"<PrefixSets of {self.sets[0].coverage:.3g} for {self.min_points} to {last} points>"

    @property
    def classes(self) -> tuple[str, ...]:
        """(K,) the class names."""
        return self.sets[0].classes

    @check_arguments
    def at(self, points: int) -> PredictionSets:
        """The prediction sets for prefixes of `points` points.

        Raises:
            DataError: there are no predictions for prefixes as short as that.
        """
        return select_by_points(self.sets, self.min_points, points)

    def to_json(self) -> dict[str, Any]:
        """Return the parameters as plain values."""
        return {"min_points": self.min_points, "sets": [each.to_json() for each in self.sets]}

    @classmethod
    def from_json(cls, numbers: Mapping[str, Any]) -> Self:
        """Restore the sets that `to_json` returned.

        Raises:
            DataError: the parameters do not match.
        """
        with report_damage("the prediction sets of prefixes"):
            return cls(int(numbers["min_points"]), tuple(map(PredictionSets.from_json, numbers["sets"])))


@check_arguments
def fit_prefix_sets(
    timeline: PredictionTimeline, coverage: float = COVERAGE, *, by_class: bool = True
) -> PrefixSets:
    """Fit prediction sets for each number of points, as `calibrate_prefixes` fits calibrations.

    Args:
        timeline: the uncalibrated result of `cross_predict_over_time`.
        coverage, by_class: as for `fit_prediction_sets`.

    Raises:
        DataError: the coverage is not between 0 and 1, or the timeline has no folds or no predictions.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.learning import PredictionTimeline, fit_prefix_sets
        >>> yes = np.array([[0.4, 0.6], [0.1, 0.9]])  # P(no), P(yes) after one point, after two
        >>> tracks = 8 * [yes] + 2 * [1 - yes] + 8 * [1 - yes] + 2 * [yes]  # correct in 80 % of the cases
        >>> labels, folds = 10 * ["yes"] + 10 * ["no"], 10 * [0, 1]
        >>> timeline = PredictionTimeline(tracks, (1, 2), labels, ("no", "yes"), 0.5, folds)
        >>> sets = fit_prefix_sets(timeline, 0.9)
        >>> sets.at(1).floors.round(2).tolist(), sets.at(2).floors.round(2).tolist()
        ([0.4, 0.4], [0.1, 0.1])
    """
    check_coverage(coverage)
    timeline.require_folds()

    def fit(part: PredictionTimeline, probabilities: Array) -> PredictionSets:
        predictions = tuple(part.classes[column] for column in probabilities.argmax(axis=1))
        confusion = count_confusion(part.classes, part.labels, predictions, part.weights)
        validation = Validation(
            confusion, predictions, probabilities, None, part.folds, part.labels, part.groups, part.weights
        )
        return fit_prediction_sets(validation, coverage, by_class=by_class)

    return PrefixSets(*fit_by_points(timeline, fit))
