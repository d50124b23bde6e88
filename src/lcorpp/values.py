"""The values that pass between the rooms: frozen, checked once when they are made."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError, ModelError, expected

Array = npt.NDArray[np.float64]
"""Any array of numbers; its shape is given where it is used."""

Belief = npt.NDArray[np.float64]
"""(S,) a distribution over the states of a POMDP."""

Rational = int | float | Fraction
"""A probability as it may be given: exact where it can be."""


def frozen(array: npt.ArrayLike) -> Array:
    """A float64 copy of `array` that cannot be written to."""
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy


@dataclass(frozen=True, eq=False)
class Distribution:
    """A distribution over named values, e.g. the marginal of one attribute.

    values: (n,) the names, in the order they were declared.
    probabilities: (n,) non-negative, summing to 1.
    """

    values: tuple[str, ...]
    probabilities: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "probabilities", frozen(self.probabilities))
        p = self.probabilities
        if p.shape != (len(self.values),) or not len(p):
            raise ModelError(f"a distribution over {len(self.values)} values cannot have shape {p.shape}")
        if not np.all(np.isfinite(p)) or p.min() < 0 or abs(p.sum() - 1) > 1e-9:
            raise ModelError(f"{p.tolist()} over {', '.join(self.values)} is not a distribution")

    @classmethod
    def certain(cls, value: str, values: tuple[str, ...]) -> Distribution:
        """All mass on `value`.

        Raises:
            ModelError: `value` is not one of `values`.
        """
        if value not in values:
            raise ModelError(f"unknown value {value!r}; {expected(values)}")
        return cls(values, np.array([float(v == value) for v in values]))

    @classmethod
    def trusted(cls, values: tuple[str, ...], probabilities: Array) -> Distribution:
        """One that is right by the way it was made: the array, read-only, is neither checked nor copied."""
        made = object.__new__(cls)
        object.__setattr__(made, "values", values)
        object.__setattr__(made, "probabilities", probabilities)
        return made

    def __getitem__(self, value: str) -> float:
        if value not in self.values:
            raise ModelError(f"unknown value {value!r}; {expected(self.values)}")
        return float(self.probabilities[self.values.index(value)])

    def __iter__(self) -> Iterator[tuple[str, float]]:
        return iter(zip(self.values, self.probabilities.tolist(), strict=True))

    def most_likely(self) -> str:
        """The value with the highest probability, the first declared among equals."""
        return self.values[int(np.argmax(self.probabilities))]


@dataclass(frozen=True, eq=False)
class ConfusionMatrix:
    """How often a classifier said what about whom: C of Algorithm 1.

    classes: (n,) the class names; rows and columns have the same order.
    counts: (n, n) counts[i, j] cases of class i that were called class j.
    """

    classes: tuple[str, ...]
    counts: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "counts", frozen(self.counts))
        n = len(self.classes)
        if n < 2 or self.counts.shape != (n, n):
            raise DataError(f"a confusion matrix of {n} classes cannot have shape {self.counts.shape}")
        if not np.all(np.isfinite(self.counts)) or self.counts.min() < 0:
            raise DataError("a confusion matrix holds counts: finite and not negative")

    def rates(self, smoothing: Fraction = Fraction(1, 2)) -> tuple[tuple[Fraction, ...], ...]:
        """P(called j | is i), row by row, exact, smoothed so that no entry is 0 or 1.

        Args:
            smoothing: added to every count; 1/2 is Jeffreys' prior (the default), 1 is Laplace's.
        """
        rows = []
        for row in self.counts.tolist():
            raised = [Fraction(count) + smoothing for count in row]
            total = sum(raised)
            if total == 0:
                raise DataError("a class without cases needs smoothing above 0")
            rows.append(tuple(count / total for count in raised))
        return tuple(rows)

    @property
    def probabilities(self) -> Array:
        """(n, n) `rates()` as floats."""
        return np.array([[float(rate) for rate in row] for row in self.rates()])


@dataclass(frozen=True, eq=False)
class Instance:
    """What a robot perceives of one person before it acts: I of Algorithm 1.

    trajectory: (channels, time points) the motion, as the classifier wants it.
    context: the observed facts, P-log attribute -> value; beta of Algorithm 2.
    """

    trajectory: Array
    context: Mapping[str, str]

    def __post_init__(self) -> None:
        object.__setattr__(self, "trajectory", frozen(self.trajectory))
        object.__setattr__(self, "context", MappingProxyType(dict(self.context)))


@dataclass(frozen=True, eq=False)
class Step:
    """One turn of the loop of Algorithm 2, lines 8 to 12.

    action: what the robot did. observation: what it perceived then, None after a report.
    belief: (S,) the belief after both; a report leaves it as it was.
    """

    action: str
    observation: str | None
    belief: Belief


@dataclass(frozen=True, eq=False)
class Episode:
    """One decision from perception to report; it holds only what a robot could know.

    label: what the classifier said, None without a classifier.
    evidence: what the reasoner was given, P-log attribute -> value.
    marginal: the reasoner's posterior over the shared variable, None without an opinion.
    prior: (S,) the belief the planner started from.
    steps: the actions, observations and beliefs in order, the report last.
    report: the value of the shared variable that the robot reported, L of Algorithm 2; None where the
        terminal state was reached without a report.
    """

    label: str | None
    evidence: Mapping[str, str]
    marginal: Distribution | None
    prior: Belief
    steps: tuple[Step, ...]
    report: str | None

    def __post_init__(self) -> None:
        object.__setattr__(self, "evidence", MappingProxyType(dict(self.evidence)))


@dataclass(frozen=True, eq=False)
class Dataset:
    """Labelled trajectories: Omega of Algorithm 1.

    trajectories: (cases, channels, time points).
    labels: (cases,) class names.
    groups: (cases,) cases that must not be split between training and test share a group.
    source: where it comes from, for people to read.
    notes: what its user has to know, e.g. that it leaks its label.
    """

    trajectories: Array
    labels: tuple[str, ...]
    groups: tuple[str, ...] = ()
    source: str = ""
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        object.__setattr__(self, "trajectories", frozen(self.trajectories))
        n = len(self.labels)
        if not self.groups:
            object.__setattr__(self, "groups", tuple(str(i) for i in range(n)))
        if self.trajectories.ndim != 3 or len(self.trajectories) != n or len(self.groups) != n:
            raise DataError(
                f"{n} labels and {len(self.groups)} groups need trajectories of shape"
                f" ({n}, channels, time points), not {self.trajectories.shape}"
            )

    def __len__(self) -> int:
        return len(self.labels)

    def extended(self, pairs: Sequence[tuple[npt.ArrayLike, str]], groups: Sequence[str]) -> Dataset:
        """Omega with more (trajectory, label) pairs at its end: Algorithm 1, Omega <- Omega + omega.

        Args:
            pairs: trajectories (channels, time points) as those here, each with its believed class.
            groups: whom each is of; cases of one person share a group.

        Raises:
            DataError: a trajectory has another shape than those here.
        """
        tracks = [np.asarray(trajectory, dtype=np.float64) for trajectory, _ in pairs]
        for track in tracks:
            if track.shape != self.trajectories.shape[1:]:
                raise DataError(
                    f"a trajectory of shape {track.shape} does not fit a data set of trajectories of shape"
                    f" {self.trajectories.shape[1:]}"
                )
        return Dataset(
            np.concatenate([self.trajectories, np.reshape(tracks, (-1, *self.trajectories.shape[1:]))]),
            (*self.labels, *(label for _, label in pairs)),
            (*self.groups, *groups),
            self.source,
            self.notes,
        )

    def take(self, rows: npt.ArrayLike) -> Dataset:
        """The data set of the given rows, in their order. rows: (k,) indices."""
        index = np.asarray(rows, dtype=np.intp)
        return Dataset(
            self.trajectories[index],
            tuple(self.labels[i] for i in index),
            tuple(self.groups[i] for i in index),
            self.source,
            self.notes,
        )
