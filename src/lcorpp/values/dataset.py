"""Labelled trajectories or features, and hashes that identify equal trajectories."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from hashlib import sha256
from typing import Literal

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments, check_fields
from lcorpp.errors import DataError
from lcorpp.notebook import html_table, join_some
from lcorpp.values.arrays import Array, check_rows, freeze
from lcorpp.values.padding import (
    Lengths,
    count_window,
    cut_tracks,
    measure_lengths,
    stack_signals,
    strip_padding,
)

GAZE_CHANNELS = ("gaze_angle", "robot_angle", "face_distance")
CHANNELS = ("x", "y", "velocity", "heading", "facing", *GAZE_CHANNELS)
"""The channels of motion: position (m), speed (m/s), direction of motion and of the body (rad). And of gaze:
the angles between the face and the direction to the robot, and between the robot's head and the direction to
the face (rad), and the distance of the face from the robot's head (m)."""

GROUP_SEPARATOR = " + "
"""Between the people of a case whose group has several, e.g. "ann + bob"."""

Kind = Literal["motion", "series", "table"]
"""Kinds of data: channels of motion, or channels of a domain's own, over time; features without time."""


def track_hash(trajectory: npt.ArrayLike) -> str:
    """Return the group of a track of an unknown person: a text that only equal trajectories share.

    The padding of a track (channels, time points) does not count.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.values import track_hash
        >>> track = np.array([[0.0, 0.5, 1.0], [2.0, 2.0, 2.0]])  # x and y of three time points
        >>> padded = np.hstack([track, np.full((2, 4), np.nan)])
        >>> track_hash(track) == track_hash(padded)
        True
    """
    numbers = np.ascontiguousarray(strip_padding(np.asarray(trajectory, dtype=np.float64)), dtype="<f8")
    return "track " + sha256(repr(numbers.shape).encode() + numbers.tobytes()).hexdigest()[:16]


@dataclass(frozen=True)
class LabelEvidence:
    """What a robot's report, a label that may be wrong, is based on.

    belief: class -> probability, the robot's belief when it reported.
    context: attribute -> value, the observed facts.
    answers: pairs (action, observation) in their order, without the report; None if they were not recorded.

    Examples:
        >>> from lcorpp.values import LabelEvidence
        >>> evidence = LabelEvidence({"interested": 0.9, "not_interested": 0.1}, {"time": "morning"})
        >>> evidence.belief["interested"]
        0.9
    """

    belief: Mapping[str, float]
    context: Mapping[str, str] = field(default_factory=dict)
    answers: tuple[tuple[str, str], ...] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Dataset:
    """Labelled trajectories or features: Omega of Algorithm 1.

    trajectories: (cases, channels, time points), or (cases, features). Motion is in metres, metres per second
        and radians. A track that is shorter than others is padded: after its last time point all its channels
        are NaN.
    labels: (cases,) class names.
    groups: (cases,) group names, e.g. of people; cross-validation never splits a group between training and
        test. A case of several people has their names, joined by `GROUP_SEPARATOR`. Default: each case is its
        own group.
    source: origin of the data, for reports.
    notes: warnings for the user, e.g. that the data leak their label.
    interval: seconds between two time points; features have none, and ignore it.
    channels: (channels,) or (features,) different names. Those in `CHANNELS` are motion, x and y in the
        robot's frame. Default: x and y, and for features their numbers from 1.
    weights: (cases,) above 0: a case of weight 2 counts as two equal cases of one group, in the training and
        in the counts of cross-validation. A person whose class is uncertain is a case of each class, whose
        weights sum to 1, in one group. Default: 1 for all.
    evidence: (cases,) what the label of a case is based on; None for a certain label, e.g. by a person.
        Default: None for all.

    Examples:
        >>> from lcorpp import Dataset
        >>> tracks = [[[0, 1, 2], [0, 0, 0]], [[3, 3, 3], [1, 1, 1]]]  # (2, x and y, 3)
        >>> walks = Dataset(tracks, ("passing", "waiting"), interval=0.5)
        >>> walks
        Dataset(2 trajectories (passing: 1, waiting: 1), 3 points of x, y every 0.5 s, 2 groups)
        >>> walks.take([1]).labels
        ('waiting',)
    """

    trajectories: Array
    labels: tuple[str, ...]
    groups: tuple[str, ...] = ()
    source: str = ""
    notes: tuple[str, ...] = ()
    interval: float = 0.033
    channels: tuple[str, ...] = ()
    weights: Array = field(default_factory=lambda: np.ones(0))
    evidence: tuple[LabelEvidence | None, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self)
        for name in ("labels", "groups", "notes"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        object.__setattr__(self, "trajectories", freeze(self.trajectories))
        object.__setattr__(self, "channels", tuple(self.channels) or self._name_channels())
        n = len(self.labels)
        if not self.groups:
            object.__setattr__(self, "groups", tuple(str(i) for i in range(n)))
        object.__setattr__(self, "weights", freeze(self.weights if np.size(self.weights) else np.ones(n)))
        if self.weights.shape != (n,) or not ((self.weights > 0) & np.isfinite(self.weights)).all():
            raise DataError(f"{n} cases need as many weights, finite and above 0, not {self.weights}")
        if not self.evidence:
            object.__setattr__(self, "evidence", (None,) * n)
        if len(self.evidence) != n:
            raise DataError(f"{n} labels need evidence for as many, not for {len(self.evidence)}")
        shape = self.trajectories.shape
        if len(shape) not in (2, 3) or shape[0] != n or len(self.groups) != n:
            raise DataError(
                f"{n} labels and {len(self.groups)} groups need trajectories of shape"
                f" ({n}, channels, time points), or features of shape ({n}, features), not {shape}"
            )
        if not 0 < self.interval < float("inf"):
            raise DataError(f"the interval is {self.interval} s; expected a finite number above 0")
        for name in self.channels:
            if not isinstance(name, str) or not name.strip():
                raise DataError(f"a channel is named {name!r}; expected a text that is not blank")
        names = join_some(self.channels)
        if len(set(self.channels)) < len(self.channels):
            raise DataError(f"the channels are {names}; expected every name once")
        if shape[1] != len(self.channels):
            raise DataError(
                f"{len(self.channels)} channels ({names}) need trajectories of shape"
                f" ({n}, {len(self.channels)}, time points), or features of shape ({n},"
                f" {len(self.channels)}), not {shape}"
            )

    def _name_channels(self) -> tuple[str, ...]:
        is_table = self.trajectories.ndim == 2
        return tuple(str(i + 1) for i in range(self.trajectories.shape[1])) if is_table else ("x", "y")

    @property
    def kind(self) -> Kind:
        """Motion, if all channels are in `CHANNELS`; another series; or a table of features."""
        if self.trajectories.ndim == 2:
            return "table"
        return "motion" if set(self.channels) <= set(CHANNELS) else "series"

    @cached_property
    def lengths(self) -> Lengths:
        """(cases,) the number of time points of each case, without padding; 1 for features."""
        if self.trajectories.ndim == 2:
            return np.ones(len(self), dtype=np.int64)
        return measure_lengths(self.trajectories)

    @property
    def unit(self) -> str:
        """The plural noun of the cases, for reports."""
        return "tracks" if self.kind == "motion" else "cases"

    def __len__(self) -> int:
        return len(self.labels)

    def __repr__(self) -> str:
        counts = [f"{label}: {count}" for label, count in Counter(self.labels).items()]
        source = f", source={self.source!r}" if self.source else ""
        groups, names = f"{len(set(self.groups))} groups{source}", join_some(self.channels)
        if self.kind == "table":
            return f"Dataset({len(self)} cases ({join_some(counts)}), features {names}, {groups})"
        return (
            f"Dataset({len(self)} trajectories ({join_some(counts)}), {self.extent} of {names} every"
            f" {self.interval:g} s, {groups})"
        )

    def _repr_html_(self) -> str:
        counts = Counter(self.labels).items()
        people = Counter(label for label, _ in set(zip(self.labels, self.groups, strict=True)))
        rows = [(label, str(count), str(people[label])) for label, count in counts]
        return html_table(("class", self.unit, "groups"), rows, caption=repr(self))

    @property
    def extent(self) -> str:
        """How long the tracks are, for reports: "304 points", or "2 to 60 s" if they differ."""
        known = self.lengths if len(self) else [self.trajectories.shape[2]]
        shortest, longest = min(known), max(known)
        if shortest == longest:
            return f"{longest} points"
        first, last = (round((points - 1) * self.interval, 2) for points in (shortest, longest))
        return f"{first:g} to {last:g} s"

    @property
    def is_weighted(self) -> bool:
        """Whether some weight is not 1."""
        return bool((self.weights != 1).any())

    @property
    def n_people(self) -> float:
        """The sum of the weights: a person of uncertain class, who is a case of each class, counts once."""
        return round(float(self.weights.sum()), 6)

    @check_arguments
    def append(
        self,
        pairs: Sequence[tuple[npt.ArrayLike, str]],
        groups: Sequence[str],
        evidence: Sequence[LabelEvidence | None] = (),
    ) -> Dataset:
        """Return the data set with more (trajectory, label) pairs, of weight 1, at its end.

        Args:
            pairs: trajectories (channels, time points) of any length, or features (features,), each with its
                label.
            groups: the group of each pair; cases of one person share a group.
            evidence: what each label is based on, as the field; by default the labels are certain.

        Raises:
            DataError: a trajectory has other channels, or other features.
        """
        if len(pairs) != len(groups):
            raise DataError(f"{len(pairs)} pairs need as many groups, not {len(groups)}")
        shape = self.trajectories.shape[1:]
        tracks = [np.asarray(track, dtype=np.float64) for track, _ in pairs]
        signals = [*self.trajectories, *tracks]
        for track in tracks:
            if track.ndim != len(shape) or len(track) != shape[0]:
                raise DataError(
                    f"a trajectory of shape {track.shape} does not fit a data set of trajectories of shape"
                    f" {shape}"
                )
        return replace(
            self,
            trajectories=stack_signals(signals) if signals else self.trajectories,
            labels=(*self.labels, *(label for _, label in pairs)),
            groups=(*self.groups, *groups),
            weights=np.concatenate([self.weights, np.ones(len(pairs))]),
            evidence=(*self.evidence, *(evidence or (None,) * len(pairs))),
        )

    @check_arguments
    def last(self, seconds: float) -> Dataset:
        """Return the last seconds of each case, two time points at least.

        Raises:
            DataError: features have no duration, or the seconds are not a finite number above 0.
        """
        if self.kind == "table":
            raise DataError("features have no duration; expected no seconds to cut them to")
        part = slice(-count_window(seconds, self.interval), None)
        return replace(self, trajectories=cut_tracks(self.trajectories, part))

    def take(self, rows: npt.ArrayLike) -> Dataset:
        """Return the data set of the given rows, in their order; a DataError if there are none such.

        rows: (k,) indices.
        """
        index = check_rows(rows, len(self))
        return replace(
            self,
            trajectories=self.trajectories[index],
            labels=tuple(self.labels[i] for i in index),
            groups=tuple(self.groups[i] for i in index),
            weights=self.weights[index],
            evidence=tuple(self.evidence[i] for i in index),
        )
