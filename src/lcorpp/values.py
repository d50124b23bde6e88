"""The values that pass between the rooms: frozen, checked once when they are made."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from hashlib import sha256
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError, ModelError, expected

Array = npt.NDArray[np.float64]
"""Any array of numbers; its shape is given where it is used."""

Belief = npt.NDArray[np.float64]
"""(S,) a distribution over the states of a POMDP."""

JEFFREYS, LAPLACE = Fraction(1, 2), Fraction(1)
"""What is added to every count so that no share is 0 or 1."""

Rational = int | float | Fraction
"""A probability as it may be given: exact where it can be."""


def frozen(array: npt.ArrayLike) -> Array:
    """A float64 copy of `array` that cannot be written to."""
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy


def fingerprint(trajectory: npt.ArrayLike) -> str:
    """A name that equal trajectories share and no others: a group for those whose person is not known."""
    numbers = np.ascontiguousarray(trajectory, dtype="<f8")
    return "track " + sha256(repr(numbers.shape).encode() + numbers.tobytes()).hexdigest()[:16]


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
class Likelihood:
    """Soft evidence about a named value: how likely what was seen is under each; only the ratios matter.

    A hard label says which value was seen; this says how strongly each is spoken for. Zero rules a value out.

    values: (n,) the names.
    weights: (n,) finite, not negative, not all zero; kept so that the largest is 1.

    Source: Pearl, Probabilistic Reasoning in Intelligent Systems, 1988, section 2.2.2 (virtual evidence).
    """

    values: tuple[str, ...]
    weights: Array

    def __post_init__(self) -> None:
        w = np.array(self.weights, dtype=np.float64)
        if w.shape != (len(self.values),) or not len(w) or len(set(self.values)) < len(w):
            raise ModelError(
                f"a likelihood needs one weight for each of {len(self.values)} different values, not shape"
                f" {w.shape}"
            )
        if not np.all(np.isfinite(w)) or w.min() < 0 or w.max() <= 0:
            told = ", ".join(f"{value} {weight:g}" for value, weight in zip(self.values, w, strict=True))
            raise ModelError(f"likelihood of {told}: expected finite weights, none negative, not all zero")
        object.__setattr__(self, "weights", frozen(w / w.max()))

    def __iter__(self) -> Iterator[tuple[str, float]]:
        return iter(zip(self.values, self.weights.tolist(), strict=True))

    def __str__(self) -> str:
        return ":".join(self.values) + " as " + ":".join(f"{weight:.3g}" for weight in self.weights.tolist())

    def renamed(self, names: Mapping[str, str]) -> Likelihood:
        """The same under other names: value -> name, one for each value."""
        return Likelihood(tuple(names[value] for value in self.values), self.weights)

    def most_likely(self) -> str:
        """The value with the largest weight, the first among equals."""
        return self.values[int(np.argmax(self.weights))]


Label = str | Likelihood
"""What a classifier says of a person: a class, or how likely what it saw is under each."""


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

    def rates(self, smoothing: Fraction = JEFFREYS) -> tuple[tuple[Fraction, ...], ...]:
        """P(called j | is i), row by row, exact, smoothed so that no entry is 0 or 1.

        Args:
            smoothing: added to every count, `JEFFREYS` or `LAPLACE`; 0 takes the counts as they are.

        Raises:
            DataError: `smoothing` is negative, or 0 where a class has no cases.
        """
        if smoothing < 0:
            raise DataError(f"the smoothing is {smoothing}; expected 0 or more")
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
    evidence: what the reasoner was given, P-log attribute -> value, or -> likelihood of each value.
    marginal: the reasoner's posterior over the shared variable, None without an opinion.
    prior: (S,) the belief the planner started from.
    steps: the actions, observations and beliefs in order, the report last.
    report: the value of the shared variable that the robot reported, L of Algorithm 2; None where the
        terminal state was reached without a report.
    """

    label: Label | None
    evidence: Mapping[str, Label]
    marginal: Distribution | None
    prior: Belief
    steps: tuple[Step, ...]
    report: str | None

    def __post_init__(self) -> None:
        object.__setattr__(self, "evidence", MappingProxyType(dict(self.evidence)))


CHANNELS = ("x", "y", "velocity", "heading", "facing")
"""What a trajectory may tell: place (m), speed (m/s), and where the body moves and faces (rad)."""


@dataclass(frozen=True, eq=False)
class Dataset:
    """Labelled trajectories: Omega of Algorithm 1.

    trajectories: (cases, channels, time points), metres, metres per second and radians.
    labels: (cases,) class names.
    groups: (cases,) cases that must not be split between training and test share a group.
    source: where it comes from, for people to read.
    notes: what its user has to know, e.g. that it leaks its label.
    interval: seconds between two time points.
    channels: (channels,) what each channel is, a name among `CHANNELS`; x and y are in the robot's frame.
    """

    trajectories: Array
    labels: tuple[str, ...]
    groups: tuple[str, ...] = ()
    source: str = ""
    notes: tuple[str, ...] = field(default=())
    interval: float = 0.033
    channels: tuple[str, ...] = ("x", "y")

    def __post_init__(self) -> None:
        object.__setattr__(self, "trajectories", frozen(self.trajectories))
        object.__setattr__(self, "channels", tuple(self.channels))
        n = len(self.labels)
        if not self.groups:
            object.__setattr__(self, "groups", tuple(str(i) for i in range(n)))
        if self.trajectories.ndim != 3 or len(self.trajectories) != n or len(self.groups) != n:
            raise DataError(
                f"{n} labels and {len(self.groups)} groups need trajectories of shape"
                f" ({n}, channels, time points), not {self.trajectories.shape}"
            )
        if not 0 < self.interval < float("inf"):
            raise DataError(f"the interval is {self.interval} s; expected a finite number above 0")
        unknown = [name for name in self.channels if name not in CHANNELS]
        if unknown:
            raise DataError(f"unknown channel {unknown[0]!r}; {expected(CHANNELS)}")
        if len(set(self.channels)) < len(self.channels):
            raise DataError(f"the channels are {', '.join(self.channels)}; expected every name once")
        if self.trajectories.shape[1] != len(self.channels):
            raise DataError(
                f"{len(self.channels)} channels ({', '.join(self.channels)}) need trajectories of shape"
                f" ({n}, {len(self.channels)}, time points), not {self.trajectories.shape}"
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
        return replace(
            self,
            trajectories=np.concatenate(
                [self.trajectories, np.reshape(tracks, (-1, *self.trajectories.shape[1:]))]
            ),
            labels=(*self.labels, *(label for _, label in pairs)),
            groups=(*self.groups, *groups),
        )

    def take(self, rows: npt.ArrayLike) -> Dataset:
        """The data set of the given rows, in their order. rows: (k,) indices."""
        index = np.asarray(rows, dtype=np.intp)
        return replace(
            self,
            trajectories=self.trajectories[index],
            labels=tuple(self.labels[i] for i in index),
            groups=tuple(self.groups[i] for i in index),
        )
