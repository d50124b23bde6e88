"""Conformal prediction sets: classes that contain the true one with a chosen frequency, and their likelihood.

A set of one class is an answer, a set of all classes is "don't know"; a poor classifier has large sets. The
frequency is for people exchangeable with those of the data, and is not guaranteed, as by a held-out part: the
quantiles are those of the classifiers of the folds, the sets of the one trained on all cases. If that one is
less certain of the true classes of new people than they are, the sets contain them less often than reported.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments, check_fields
from lcorpp.errors import DataError
from lcorpp.learning.evaluation.calibration import check_probabilities, report_damage
from lcorpp.learning.evaluation.metrics import jeffreys_interval
from lcorpp.learning.evaluation.validation import Validation
from lcorpp.notebook import join_some
from lcorpp.values import COVERAGE, Array, Flags, Indices, Interval, Likelihood, check_coverage, freeze

ROUNDING = 1e-9
"""Tolerance of a sum of masses, so that the 19th of 19 people is a 95 % quantile."""


@dataclass(frozen=True, eq=False)
class PredictionSets:
    """Prediction sets of a classifier, and how often each was predicted for the cases of each class.

    What is predicted for a case, its outcome, is the most probable class and the set: the set alone would
    discard the classifier's opinion wherever it contains all classes.

    evidence: the name in `lcorpp.values.EVIDENCE`.
    classes: (K,) the class names, in the order of the probabilities.
    coverage: the intended fraction of cases whose set contains the true class.
    floors: (K,) a class is in the set if its probability is at least this; 0 if it always is.
    best: (outcomes,) the column of the most probable class. members: (outcomes, K) the classes in the set.
    counts: (outcomes, K) out-of-fold people of each true class, by weight; the cases of a person share a
        count of 1, and the sets of a fold have the floors of the other folds.

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import QuadraticLogistic, cross_validate, fit_prediction_sets
        >>> labels = 4 * ["stands"] + ["walks"] + 5 * ["stands"] + 10 * ["walks"]  # one person walks slowly
        >>> validation = cross_validate(QuadraticLogistic(), Dataset([[0.1 * n] for n in range(20)], labels))
        >>> sets = fit_prediction_sets(validation, 0.85)
        >>> sets.predict([[0.6, 0.4], [0.5, 0.5]])  # the second set means "don't know"
        [('stands',), ('stands', 'walks')]
    """

    evidence: ClassVar[str] = "set"
    classes: tuple[str, ...]
    coverage: float
    floors: Array
    best: Indices
    members: Flags
    counts: Array

    def __post_init__(self) -> None:
        check_fields(self)
        check_coverage(self.coverage)
        for name in ("floors", "counts"):
            object.__setattr__(self, name, freeze(getattr(self, name)))
        object.__setattr__(self, "best", np.asarray(self.best, dtype=np.intp))
        object.__setattr__(self, "members", np.asarray(self.members, dtype=np.bool_))
        k, outcomes = len(self.classes), len(self.best)
        shapes = [self.floors.shape, self.best.shape, self.members.shape, self.counts.shape]
        if not outcomes or shapes != [(k,), (outcomes,), (outcomes, k), (outcomes, k)]:
            raise DataError(
                f"prediction sets of {k} classes cannot have floors, outcomes and counts of shapes {shapes}"
            )
        numbers = np.concatenate([self.floors, self.counts.ravel()])
        if (
            not np.isfinite(numbers).all()
            or numbers.min() < 0
            or not 0 <= self.best.min() <= self.best.max() < k
        ):
            raise DataError("the floors and counts of prediction sets are finite and not negative")

    def __repr__(self) -> str:
        covered = [f"{name} covered {part}" for name, part in zip(self.classes, self.coverages, strict=True)]
        shown = covered if len(covered) <= 6 else [*covered[:6], f"and {len(covered) - 6} more classes"]
        return (
            f"<PredictionSets of {self.coverage:.3g}: {', '.join(shown)}; mean size {self.mean_size:.2f},"
            f" {self.full:.3f} full, {self.empty:.3f} empty>"
        )

    def contains(self, probabilities: Array) -> Flags:
        """(cases, K) whether each class is in the set of each case, from the uncalibrated probabilities."""
        return np.asarray(check_probabilities(probabilities, len(self.classes)) >= self.floors)

    def predict(self, probabilities: Array) -> list[tuple[str, ...]]:
        """Return the set of each case (cases, K), the most probable class first."""
        members = self.contains(probabilities)
        orders = np.argsort(-np.asarray(probabilities), axis=1, kind="stable")
        return [
            tuple(self.classes[column] for column in order if inside[column])
            for order, inside in zip(orders, members, strict=True)
        ]

    def likelihoods(self, probabilities: Array) -> list[Likelihood]:
        """The likelihood of each case (cases, K): P(most probable class and set | class).

        It is the posterior mean of multinomial rates. The prior counts as one person of each class, spread
        over the outcomes as if the most probable class and the members of the set were independent.
        Each likelihood describes its set.
        """
        members, columns = self.contains(probabilities), np.argmax(probabilities, axis=1)
        k, people = len(self.classes), self.counts.sum(axis=0)
        best_rates = (np.eye(k)[self.best].T @ self.counts + 0.5) / (people + k / 2)
        member_rates = (self.members.T.astype(float) @ self.counts + 0.5) / (people + 1)
        result = []
        for best, inside, names in zip(columns, members, self.predict(probabilities), strict=True):
            prior = best_rates[best] * np.where(inside[:, None], member_rates, 1 - member_rates).prod(axis=0)
            counts = self._counts_of.get((int(best), inside.tobytes()), np.zeros(k))
            result.append(
                Likelihood(self.classes, (counts + prior) / (people + 1), self._describe(best, names))
            )
        return result

    def _describe(self, best: int, names: tuple[str, ...]) -> str:
        """Describe a set by its class names; `best` is the most probable class, also of an empty set."""
        kind = f"prediction set of {self.coverage:.3g}"
        if not names:
            return f"{kind}: empty, unlike the people of every class; most probable {self.classes[best]}"
        unknown = " (don't know)" if len(names) == len(self.classes) else ""
        return f"{kind}: {join_some(names)}{unknown}"

    @cached_property
    def _counts_of(self) -> Mapping[tuple[int, bytes], Array]:
        keys = zip(self.best.tolist(), map(np.ndarray.tobytes, self.members), strict=True)
        return dict(zip(keys, self.counts, strict=True))

    @property
    def coverages(self) -> tuple[Interval, ...]:
        """(K,) fraction of the people of each class whose set contains it, with Jeffreys' 95 % interval."""
        covered = (self.members * self.counts).sum(axis=0)
        return tuple(map(jeffreys_interval, covered.tolist(), self.counts.sum(axis=0).tolist()))

    @property
    def mean_size(self) -> float:
        """The mean number of classes in a set, over all people."""
        return self._mean(self.members.sum(axis=1))

    @property
    def full(self) -> float:
        """The fraction of people whose set contains all classes: "don't know"."""
        return self._mean(self.members.all(axis=1))

    @property
    def empty(self) -> float:
        """The fraction of people whose set is empty: unlike the people of every class."""
        return self._mean(~self.members.any(axis=1))

    def _mean(self, of_outcome: npt.ArrayLike) -> float:
        return float(np.asarray(of_outcome) @ self.counts.sum(axis=1) / self.counts.sum())

    def to_json(self) -> dict[str, Any]:
        """Return the parameters as plain values."""
        return {
            "classes": list(self.classes),
            "coverage": self.coverage,
            "floors": self.floors.tolist(),
            "best": self.best.tolist(),
            "members": self.members.astype(int).tolist(),
            "counts": self.counts.tolist(),
        }

    @classmethod
    def from_json(cls, numbers: Mapping[str, Any]) -> PredictionSets:
        """Restore the sets that `to_json` returned.

        Raises:
            DataError: the parameters do not match.
        """
        with report_damage("prediction sets"):
            return cls(
                tuple(map(str, numbers["classes"])),
                float(numbers["coverage"]),
                np.array(numbers["floors"]),
                np.array(numbers["best"], dtype=np.intp),
                np.array(numbers["members"], dtype=bool),
                np.array(numbers["counts"]),
            )


@check_arguments
def fit_prediction_sets(
    validation: Validation, coverage: float = COVERAGE, *, by_class: bool = True
) -> PredictionSets:
    """Fit prediction sets to the out-of-fold predictions of a cross-validation.

    Args:
        coverage: the fraction of people whose set contains the true class, between 0 and 1. With fewer than
            coverage / (1 - coverage) people of a class, 19 for .95, it is in every set.
        by_class: whether each class is covered that often (Mondrian), or all cases together, so that a rare
            class may be covered less.

    Raises:
        DataError: the coverage is not between 0 and 1.

    A person counts once for each class: the cases of a person share its mass, as they are not exchangeable
    with those of others.

    Source: Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World, 2005; Barber, Candès, Ramdas
    and Tibshirani, Annals of Statistics 49, 2021 (the jackknife, of which this is the form with folds: no
    guarantee); Sadinle, Lei and Wasserman, JASA 114, 2019 (sets by class); Lee, Barber and Willett,
    arXiv:2306.06342 (several cases of a person).

    Examples:
        >>> from lcorpp import Dataset
        >>> from lcorpp.learning import QuadraticLogistic, cross_validate, fit_prediction_sets
        >>> data = Dataset([[0.1 * n] for n in range(20)], 10 * ["stands"] + 10 * ["walks"])  # speeds in m/s
        >>> validation = cross_validate(QuadraticLogistic(), data)
        >>> [fit_prediction_sets(validation, coverage).mean_size for coverage in (0.5, 0.8, 0.95)]
        [0.5, 1.0, 2.0]
    """
    check_coverage(coverage)
    columns = np.searchsorted(np.array(validation.classes), np.array(validation.labels))
    groups = np.unique(validation.groups or np.arange(len(columns)), return_inverse=True)[1]
    p, k = validation.probabilities, len(validation.classes)
    parts = columns if by_class else np.zeros_like(columns)
    masses, own = _share(validation.weights, groups * k + parts), p[np.arange(len(p)), columns]

    def find_floors(used: Flags) -> Array:
        each = [used & (parts == part) for part in (range(k) if by_class else [0])]
        return np.broadcast_to([_find_floor(own[part], masses[part], coverage) for part in each], k)

    folds = np.array(validation.folds)
    members = np.empty(p.shape, dtype=bool)
    for fold in np.unique(folds):
        held_out = folds == fold
        members[held_out] = p[held_out] >= find_floors(~held_out)
    outcomes, index = np.unique(np.column_stack([p.argmax(axis=1), members]), axis=0, return_inverse=True)
    counts = np.zeros((len(outcomes), k))
    np.add.at(counts, (index.ravel(), columns), _share(validation.weights, groups * k + columns))
    everyone = np.ones(len(p), dtype=bool)
    return PredictionSets(
        validation.classes, coverage, find_floors(everyone), outcomes[:, 0], outcomes[:, 1:] > 0, counts
    )


def _share(weights: Array, owners: npt.NDArray[np.int64]) -> Array:
    """(cases,) the weights, each divided by the number of cases with the same owner."""
    _, index, cases = np.unique(owners, return_inverse=True, return_counts=True)
    return np.asarray(weights / cases[index])


def _find_floor(probabilities: Array, masses: Array, coverage: float) -> float:
    """The largest bound at or above which lies `coverage` of the mass, that of a new case, 1, being below."""
    order = np.argsort(-probabilities, kind="stable")
    above = np.cumsum(masses[order])
    needed = coverage * (masses.sum() + 1) - ROUNDING
    position = int(np.searchsorted(above, needed))
    return float(probabilities[order[position]]) if position < len(order) else 0.0
