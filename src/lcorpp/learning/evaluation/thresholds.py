"""From which probability on a case is called positive: the best threshold where the class is so common.

A classifier trained on as many of each class calls a case positive from .5 on. Where one person in fifty is
interested that is too many calls; where a missed customer costs ten false alarms it is too few.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lcorpp.errors import DataError, expected_one_of
from lcorpp.learning.evaluation.metrics import Flags
from lcorpp.values import Array


@dataclass(frozen=True)
class Cut:
    """A class of two is called from this probability of it on, and the other one below."""

    name: str
    probability: float

    def __post_init__(self) -> None:
        if not 0 <= self.probability <= 1 + 1e-9:
            raise DataError(f"a case cannot be called {self.name} from {self.probability} on; expected 0..1")


def called(classes: Sequence[str], probabilities: Array, cut: Cut | None = None) -> list[str]:
    """(cases,) the hard labels: the most probable class, or as the cut says.

    Args:
        classes: (K,) the columns of `probabilities` (cases, K).

    Raises:
        DataError: there is a cut, and there are not two classes with its own among them.
    """
    if cut is None:
        return [classes[column] for column in probabilities.argmax(axis=1).tolist()]
    if len(classes) != 2 or cut.name not in classes:
        raise DataError(f"a cut at {cut.name} is for two classes, not for {', '.join(classes)}")
    column = classes.index(cut.name)
    positive = probabilities[:, column] >= cut.probability
    return [cut.name if is_positive else classes[1 - column] for is_positive in positive.tolist()]


@dataclass(frozen=True)
class Rates:
    """What some thresholds lead to; every field (thresholds,).

    hit: P(called positive | positive), the TPR. alarm: P(called positive | not), the FPR.
    """

    hit: Array
    alarm: Array


Goal = Callable[[Rates, float], Array]
"""How good rates are (thresholds,) where this share of people is positive; more is better."""


def _f1(rates: Rates, prevalence: float) -> Array:
    called = prevalence * rates.hit + (1 - prevalence) * rates.alarm
    return np.asarray(2 * prevalence * rates.hit / (called + prevalence))


GOALS: Mapping[str, Goal] = {
    "accuracy": lambda rates, share: share * rates.hit + (1 - share) * (1 - rates.alarm),
    "f1": _f1,
    "youden": lambda rates, share: rates.hit - rates.alarm,
}
"""What a threshold may be best for; Youden's J (Cancer 3, 1950) does not depend on the prevalence."""


@dataclass(frozen=True)
class Threshold:
    """A case is called positive from this probability on.

    goal: what it is best for, a name among `GOALS` or "cost".
    prevalence: the share of positives it is meant for.
    value: what is reached on the cases it was chosen on, for costs their negative mean; optimistic.
    honest: what is reached when each fold is called by a threshold chosen on the others.
    hit, alarm: the share of positives and of others that are called positive, on the cases it was chosen on.
    """

    goal: str
    prevalence: float
    probability: float
    value: float
    honest: float
    hit: float
    alarm: float

    @property
    def told(self) -> tuple[str, float]:
        """What is reached, in words for people, and the honest figure: costs count as positive."""
        return ("least cost", -self.honest) if self.goal == "cost" else (f"best {self.goal}", self.honest)


def costs(missed: float, alarm: float) -> Goal:
    """The goal of least cost a person: the price of calling a positive negative, and the other way round.

    Raises:
        DataError: a price is negative, or neither is above 0.
    """
    if not (0 <= missed < np.inf and 0 <= alarm < np.inf and missed + alarm > 0):
        raise DataError(f"the costs are {missed} and {alarm}; expected numbers of at least 0, not both 0")
    return lambda rates, share: -(share * (1 - rates.hit) * missed + (1 - share) * rates.alarm * alarm)


def named_goal(goal: str | tuple[float, float]) -> tuple[str, Goal]:
    """The goal of that name, or of two costs, with its name.

    Raises:
        DataError: there is none.
    """
    if not isinstance(goal, str):
        return "cost", costs(*goal)
    if goal not in GOALS:
        raise DataError(f"unknown goal {goal!r}; {expected_one_of([*GOALS])} or two costs")
    return goal, GOALS[goal]


def choose_threshold(
    scores: Array,
    positive: Flags,
    folds: Sequence[int],
    *,
    prevalence: float,
    goal: str | tuple[float, float] = "accuracy",
) -> Threshold:
    """The threshold that is best on out-of-fold predictions, weighted to a prevalence.

    Args:
        scores: (cases,) the probability of the positive class. positive: (cases,) the truth.
        folds: (cases,) in which each case was held out.
        prevalence: the share of positives where the classifier will be used, between 0 and 1; the share among
            the cases does not matter.
        goal: "accuracy", "f1", "youden", or the costs of a missed positive and of a false alarm.

    Raises:
        DataError: the goal or the prevalence is none, or there are not cases of both kinds.

    Of equally good thresholds the one nearest to .5 is taken.
    """
    name, worth = named_goal(goal)
    if not 0 < prevalence < 1:
        raise DataError(f"the prevalence is {prevalence}; expected a share between 0 and 1")
    if positive.all() or not positive.any():
        raise DataError("a threshold needs cases of both kinds")
    at, reached = _best(scores, positive, prevalence, worth)
    own = _rates(scores, positive, np.array([at]))
    calls = np.zeros(len(scores), dtype=bool)
    held_out = np.array(folds)
    for fold in np.unique(held_out):
        rest = held_out != fold
        both = positive[rest].any() and not positive[rest].all()
        there = _best(scores[rest], positive[rest], prevalence, worth)[0] if both else at
        calls[~rest] = scores[~rest] >= there
    honest = Rates(np.array([calls[positive].mean()]), np.array([calls[~positive].mean()]))
    return Threshold(
        name,
        prevalence,
        at,
        reached,
        float(worth(honest, prevalence)[0]),
        float(own.hit[0]),
        float(own.alarm[0]),
    )


def _best(scores: Array, positive: Flags, prevalence: float, worth: Goal) -> tuple[float, float]:
    """The best threshold and what it reaches; candidates lie halfway between two scores, and at the ends."""
    distinct = np.unique(scores)
    candidates = np.concatenate([[0.0], (distinct[1:] + distinct[:-1]) / 2, [np.nextafter(1.0, 2.0)]])
    values = worth(_rates(scores, positive, candidates), prevalence)
    best = np.flatnonzero(values >= values.max() - 1e-12)
    chosen = best[np.argmin(np.abs(candidates[best] - 0.5))]
    return float(candidates[chosen]), float(values[chosen])


def _rates(scores: Array, positive: Flags, thresholds: Array) -> Rates:
    hits, others = np.sort(scores[positive]), np.sort(scores[~positive])
    return Rates(
        1 - np.searchsorted(hits, thresholds, side="left") / len(hits),
        1 - np.searchsorted(others, thresholds, side="left") / len(others),
    )
