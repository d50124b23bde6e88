"""Decision thresholds: choose the best one for a given class prevalence.

The default threshold of a classifier trained on balanced classes is .5. If one person in fifty is interested,
that predicts too many positives; if a missed customer costs ten false positives, too few.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.arguments import check_arguments, check_fields
from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.evaluation.calibration import check_probabilities
from lcorpp.values import Array, Flags


@dataclass(frozen=True)
class DecisionThreshold:
    """The probability from which on a class is predicted; below it, the most probable other class is.

    Examples:
        >>> from lcorpp.learning import DecisionThreshold, apply_threshold
        >>> threshold = DecisionThreshold("interested", 0.2)  # to miss few who are
        >>> apply_threshold(["interested", "not_interested"], [[0.3, 0.7], [0.1, 0.9]], threshold)
        ['interested', 'not_interested']
    """

    name: str
    probability: float

    def __post_init__(self) -> None:
        check_fields(self)
        if not 0 <= self.probability <= 1 + 1e-9:
            raise DataError(f"the threshold of {self.name} is {self.probability}; expected 0..1")

    def __str__(self) -> str:
        return f"{self.name} from probability {self.probability:.3f} on"


@check_arguments
def apply_threshold(
    classes: Sequence[str], probabilities: Array, threshold: DecisionThreshold | None = None
) -> list[str]:
    """(cases,) the predicted classes: by the threshold, or the most probable class without one.

    Args:
        classes: (K,) the columns of `probabilities` (cases, K).

    Raises:
        DataError: there is a threshold of an unknown class, or the probabilities have another shape.

    Examples:
        >>> from lcorpp.learning import DecisionThreshold, apply_threshold
        >>> classes, probabilities = ["interested", "not_interested"], [[0.3, 0.7], [0.1, 0.9]]
        >>> apply_threshold(classes, probabilities)
        ['not_interested', 'not_interested']
        >>> apply_threshold(classes, probabilities, DecisionThreshold("interested", 0.2))
        ['interested', 'not_interested']
    """
    classes, probabilities = tuple(classes), check_probabilities(probabilities, len(classes))
    if threshold is None:
        return [classes[column] for column in probabilities.argmax(axis=1).tolist()]
    if threshold.name not in classes:
        raise DataError(f"a threshold of {threshold.name} is for other classes than {', '.join(classes)}")
    column = classes.index(threshold.name)
    others = probabilities.copy()
    others[:, column] = -1
    best = np.where(probabilities[:, column] >= threshold.probability, column, others.argmax(axis=1))
    return [classes[column] for column in best.tolist()]


UTILITY_TOLERANCE = 1e-12
"""Utilities that differ by less are treated as equal."""

Goal = Callable[[Array, Array, float], Array]
"""Utility (thresholds,) of true and false positive rates (thresholds,) at a prevalence; higher is better."""

GOALS: Mapping[str, Goal] = {
    "accuracy": lambda tpr, fpr, p: p * tpr + (1 - p) * (1 - fpr),
    "f1": lambda tpr, fpr, p: 2 * p * tpr / (p * tpr + (1 - p) * fpr + p),
    "youden": lambda tpr, fpr, p: tpr - fpr,
}
"""The goals of a threshold by name; Youden's J (Cancer 3, 1950) does not depend on the prevalence."""


@dataclass(frozen=True)
class ThresholdChoice:
    """The best threshold for a goal.

    goal: a name among `GOALS`, or "cost".
    prevalence: fraction of positives for which it was chosen.
    probability: cases with at least this probability are predicted positive.
    in_sample: utility on the cases from which it was chosen (optimistic); of costs, minus the mean cost.
    out_of_fold: utility if each fold uses a threshold chosen on the other folds.
    tpr, fpr: true and false positive rate on the cases from which it was chosen.

    Examples:
        >>> from lcorpp.learning import choose_threshold
        >>> scores, positive = [0.1, 0.2, 0.3, 0.6, 0.4, 0.7, 0.8, 0.9], 4 * [False] + 4 * [True]
        >>> choice = choose_threshold(scores, positive, 4 * [0, 1], prevalence=0.5)
        >>> round(choice.probability, 3), choice.tpr, choice.fpr
        (0.65, 0.75, 0.0)
    """

    goal: str
    prevalence: float
    probability: float
    in_sample: float
    out_of_fold: float
    tpr: float
    fpr: float

    @property
    def label(self) -> str:
        """The goal in words: "best f1", "least cost"."""
        return "least cost" if self.goal == "cost" else f"best {self.goal}"

    @property
    def score(self) -> float:
        """The out-of-fold value in the units of the goal: costs are positive."""
        return -self.out_of_fold if self.goal == "cost" else self.out_of_fold


def resolve_goal(goal: str | tuple[float, float]) -> tuple[str, Goal]:
    """Return name and utility function of a goal, given by name or as costs of a miss and of a false alarm.

    Raises:
        DataError: the goal is unknown, or a cost is negative, or both are 0.
    """
    if isinstance(goal, str):
        if goal not in GOALS:
            raise DataError(f"unknown goal {goal!r}; {expected_one_of([*GOALS])} or two costs")
        return goal, GOALS[goal]
    missed, false_alarm = goal
    if not (0 <= missed < np.inf and 0 <= false_alarm < np.inf and missed + false_alarm > 0):
        raise DataError(
            f"the costs are {missed} and {false_alarm}; expected numbers of at least 0, not both 0"
        )
    return "cost", lambda tpr, fpr, p: -(p * (1 - tpr) * missed + (1 - p) * fpr * false_alarm)


@check_arguments
def choose_threshold(
    scores: Array,
    positive: Flags,
    folds: Sequence[int],
    *,
    prevalence: float,
    goal: str | tuple[float, float] = "accuracy",
    weights: Array | None = None,
) -> ThresholdChoice:
    """Choose the best threshold from out-of-fold predictions, reweighted to a prevalence.

    Args:
        scores: (cases,) the probability of the positive class. positive: (cases,) the truth.
        folds: (cases,) the fold in which each case was held out.
        prevalence: fraction of positives where the classifier is used, between 0 and 1; the fraction among
            the cases does not matter.
        goal: "accuracy", "f1", "youden", or the costs of a false negative and of a false positive.
        weights: (cases,) how much each case counts; None counts all alike.

    Raises:
        DataError: the goal or the prevalence is invalid, or there are no positive or no negative cases.

    Among equally good thresholds the one nearest to .5 is chosen.

    Examples:
        >>> from lcorpp.learning import choose_threshold
        >>> scores, positive = [0.1, 0.2, 0.3, 0.6, 0.4, 0.7, 0.8, 0.9], 4 * [False] + 4 * [True]
        >>> for goal in ("accuracy", (9.0, 1.0)):  # or the costs of a miss and of a false alarm
        ...     choice = choose_threshold(scores, positive, 4 * [0, 1], prevalence=0.5, goal=goal)
        ...     print(round(choice.probability, 3), choice.tpr, choice.fpr)
        0.65 0.75 0.0
        0.35 1.0 0.25
    """
    name, utility = resolve_goal(goal)
    if not 0 < prevalence < 1:
        raise DataError(f"the prevalence is {prevalence}; expected a fraction between 0 and 1")
    scores, positive = np.asarray(scores, dtype=np.float64), np.asarray(positive, dtype=np.bool_)
    if not (np.isfinite(scores).all() and scores.shape == positive.shape == (len(folds),)):
        raise DataError(
            f"scores, truth and folds of shapes {scores.shape}, {positive.shape} and ({len(folds)},);"
            " expected a finite number, a truth value and a fold for each case"
        )
    if positive.all() or not positive.any():
        raise DataError("a threshold needs positive and negative cases")
    counts = np.ones(len(scores)) if weights is None else weights
    best, in_sample = _find_best(scores, positive, counts, prevalence, utility)
    tpr, fpr = _compute_rates(scores, positive, counts, np.array([best]))
    predicted = np.zeros(len(scores), dtype=bool)
    held_out = np.array(folds)
    for fold in np.unique(held_out):
        rest = held_out != fold
        has_both = positive[rest].any() and not positive[rest].all()
        fold_best = (
            _find_best(scores[rest], positive[rest], counts[rest], prevalence, utility)[0]
            if has_both
            else best
        )
        predicted[~rest] = scores[~rest] >= fold_best
    new_tpr, new_fpr = (
        np.array([np.average(predicted[cases], weights=counts[cases])]) for cases in (positive, ~positive)
    )
    out_of_fold = float(utility(new_tpr, new_fpr, prevalence)[0])
    return ThresholdChoice(name, prevalence, best, in_sample, out_of_fold, float(tpr[0]), float(fpr[0]))


def _find_best(
    scores: Array, positive: Flags, weights: Array, prevalence: float, utility: Goal
) -> tuple[float, float]:
    """Find the best threshold and its utility; candidates lie halfway between two scores, and at the ends."""
    distinct = np.unique(scores)
    candidates = np.concatenate([[0.0], (distinct[1:] + distinct[:-1]) / 2, [np.nextafter(1.0, 2.0)]])
    values = utility(*_compute_rates(scores, positive, weights, candidates), prevalence)
    best = np.flatnonzero(values >= values.max() - UTILITY_TOLERANCE)
    chosen = best[np.argmin(np.abs(candidates[best] - 0.5))]
    return float(candidates[chosen]), float(values[chosen])


def _compute_rates(scores: Array, positive: Flags, weights: Array, thresholds: Array) -> tuple[Array, Array]:
    """True and false positive rate (thresholds,) of each threshold."""

    def rate(cases: Flags) -> Array:
        order = np.argsort(scores[cases])
        below = np.concatenate([[0.0], np.cumsum(weights[cases][order])])  # weight of the lowest scores
        missed: Array = below[np.searchsorted(scores[cases][order], thresholds, side="left")] / below[-1]
        return 1 - missed

    return rate(positive), rate(~positive)
