"""Fit triggers: choose when enough of a track is seen, by cross-validation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.streaming.timeline import (
    PredictionTimeline,
    calibrate_prefixes,
    cross_calibrate_prefixes,
)
from lcorpp.learning.streaming.trigger import Ages, EarlyScore, Trigger
from lcorpp.values import Array, Flags

RULES = ("threshold", "teaser")
"""The kinds of triggers."""

THRESHOLDS = 51
"""Number of thresholds to choose from, from that of chance to 1, which is never reached."""

REJECTED = (0.05, 0.1, 0.25, 0.5)
"""Fractions of the correct predictions that the one-class check of TEASER rejects, to choose from."""

MAX_CONSECUTIVE = 5
"""The largest number of consecutive agreeing predictions to choose from."""


Candidate = tuple[float, int]
"""A threshold, or the fraction of correct predictions that are rejected; and consecutive points."""


@dataclass(frozen=True, eq=False)
class TriggerSearch:
    """The choice of a trigger.

    trigger: the best one. chosen: its number among `candidates`.
    candidates, scores: all triggers to choose from, each with its score on the out-of-fold predictions.
    seconds, accuracy: (ages,) the accuracy if all tracks that last so long are decided at one age.
    """

    trigger: Trigger
    chosen: int
    candidates: tuple[Candidate, ...]
    scores: tuple[EarlyScore, ...]
    seconds: Array
    accuracy: Array

    def __repr__(self) -> str:
        return f"<TriggerSearch among {len(self.candidates)}: {self.trigger!r}>"


@check_arguments
def fit_trigger(
    timeline: PredictionTimeline, *, rule: str = "threshold", waiting_cost: float | None = None
) -> Trigger:
    """Return the trigger of `search_trigger`; arguments and errors are the same.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.learning import PredictionTimeline, fit_trigger
        >>> yes = np.array([[0.5, 0.5], [0.1, 0.9], [0.1, 0.9], [0.1, 0.9]])  # P(no), P(yes) at each point
        >>> timeline = PredictionTimeline(
        ...     10 * [yes, 1 - yes], (1, 2, 3, 4), 10 * ["yes", "no"], ("no", "yes"), 0.5, 5 * [0, 0, 1, 1]
        ... )
        >>> print(fit_trigger(timeline).expected)
        accuracy 1.000 after 0.50 s, earliness 0.667
    """
    return search_trigger(timeline, rule=rule, waiting_cost=waiting_cost).trigger


@check_arguments
def search_trigger(
    timeline: PredictionTimeline, *, rule: str = "threshold", waiting_cost: float | None = None
) -> TriggerSearch:
    """Choose the trigger that is best for the out-of-fold predictions, each calibrated by the other folds.

    `Trigger.expected` is a fair score: that of each fold with the trigger that is best for the others.

    Args:
        timeline: the result of `cross_predict_over_time`.
        rule: "threshold", one threshold of the calibrated probability at all ages; or "teaser".
        waiting_cost: of a second, if a wrong class costs 1; None maximises the harmonic mean of accuracy and
            earliness.

    Raises:
        DataError: an argument is wrong, or the timeline has no folds or no predictions.

    The rule "teaser" accepts a prediction if a one-class check finds it typical of the correct predictions of
    this class and age, and decides after some consecutive accepted predictions of one class. The check is a
    quantile of the calibrated probability, where the paper has a one-class support vector machine on the
    probabilities: with two classes both see one number.

    Source: Schäfer and Leser, "TEASER: early and accurate time series classification", Data Mining and
    Knowledge Discovery 34, 2020.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.learning import PredictionTimeline, search_trigger
        >>> yes = np.array([[0.5, 0.5], [0.1, 0.9], [0.1, 0.9], [0.1, 0.9]])  # P(no), P(yes) at each point
        >>> timeline = PredictionTimeline(
        ...     10 * [yes, 1 - yes], (1, 2, 3, 4), 10 * ["yes", "no"], ("no", "yes"), 0.5, 5 * [0, 0, 1, 1]
        ... )
        >>> search = search_trigger(timeline)
        >>> search.seconds.tolist(), search.accuracy.tolist(), search.candidates[search.chosen]
        ([0.0, 0.5, 1.0, 1.5], [0.5, 1.0, 1.0, 1.0], (0.51, 1))
    """
    if rule not in RULES:
        raise DataError(f"the rule of a trigger is {rule!r}; {expected_one_of(RULES)}")
    if waiting_cost is not None and not 0 <= waiting_cost < np.inf:
        raise DataError(f"the cost of a second is {waiting_cost!r}; expected a finite number, 0 or more")
    timeline.require_folds()
    timeline.require_equal_weights("a trigger")
    ages = Ages.of(cross_calibrate_prefixes(timeline))
    has_prediction = ages.known.any(axis=1)
    labels, folds = np.array(timeline.labels), np.array(timeline.folds)
    correct: Flags = np.asarray(np.array(timeline.classes)[ages.columns] == labels[:, None])
    k = len(timeline.classes)

    def find_floors(parameter: float, used: Flags) -> Array:
        if rule == "threshold":
            return np.full((len(ages.points), k), parameter)
        return _find_typical(ages, correct & used[:, None], k, parameter)

    candidates = _list_candidates(rule, k)
    outcomes = np.stack([_decide(ages, correct, folds, each, find_floors) for each in candidates])

    def score(number: int, used: Flags) -> EarlyScore:
        return EarlyScore(*outcomes[number][:, used & has_prediction].mean(axis=1).tolist())

    def choose(used: Flags) -> int:
        values = [score(number, used).value(waiting_cost) for number in range(len(candidates))]
        return int(np.argmax(values))

    everyone = np.ones(len(labels), dtype=bool)
    held_out = np.empty(outcomes.shape[1:])
    for fold in np.unique(folds):
        held_out[:, folds == fold] = outcomes[choose(folds != fold)][:, folds == fold]
    expected = EarlyScore(*held_out[:, has_prediction].mean(axis=1).tolist())
    chosen = choose(everyone)
    calibration = calibrate_prefixes(timeline)
    numbers = np.arange(calibration.min_points, ages.points[-1] + 1)
    rows = np.searchsorted(ages.points, numbers, side="right") - 1  # the last age with at most so many points
    parameter, consecutive = candidates[chosen]
    floors = find_floors(parameter, everyone)[rows]
    return TriggerSearch(
        Trigger(calibration, floors, consecutive, int(ages.points[-1]), expected),
        chosen,
        candidates,
        tuple(score(number, everyone) for number in range(len(candidates))),
        ages.seconds,
        np.array([correct[known, age].mean() for age, known in enumerate(ages.known.T)]),
    )


def _list_candidates(rule: str, k: int) -> tuple[Candidate, ...]:
    if rule == "threshold":
        return tuple((threshold, 1) for threshold in np.linspace(1 / k, 1, THRESHOLDS).tolist())
    return tuple(product(REJECTED, range(1, MAX_CONSECUTIVE + 1)))


def _decide(
    ages: Ages,
    correct: Flags,
    folds: npt.NDArray[np.int64],
    candidate: Candidate,
    find_floors: Callable[[float, Flags], Array],
) -> Array:
    """(3, cases) whether the decision is correct, its seconds, its earliness; floors by the other folds."""
    (parameter, consecutive), fired = candidate, np.empty(len(folds), dtype=np.intp)
    for fold in np.unique(folds):
        part = folds == fold
        own = replace(
            ages, known=ages.known[part], columns=ages.columns[part], probability=ages.probability[part]
        )
        fired[part] = own.find_first(find_floors(parameter, ~part), consecutive)
    seconds, duration = ages.seconds[fired], ages.seconds[ages.last]
    return np.stack(
        [correct[np.arange(len(fired)), fired], seconds, 1 - seconds / np.maximum(duration, 1e-9)]
    )


def _find_typical(ages: Ages, correct: Flags, k: int, rejected: float) -> Array:
    """(ages, K) the quantile of the probability of correct predictions; 1, never reached, without any."""
    floors = np.ones((len(ages.points), k))
    for age, column in np.ndindex(*floors.shape):
        own = correct[:, age] & ages.known[:, age] & (ages.columns[:, age] == column)
        if own.any():
            floors[age, column] = np.quantile(ages.probability[own, age], rejected)
    return floors
