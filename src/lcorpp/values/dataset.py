"""Labelled trajectories, and hashes that identify equal trajectories."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import sha256

import numpy as np
import numpy.typing as npt

from lcorpp.errors import DataError, expected_one_of
from lcorpp.notebook import join_some
from lcorpp.values.arrays import Array, freeze

CHANNELS = ("x", "y", "velocity", "heading", "facing")
"""Possible channels of a trajectory: position (m), speed (m/s), direction of motion and of the body (rad)."""


def track_hash(trajectory: npt.ArrayLike) -> str:
    """Return the group of a track of an unknown person: a text that only equal trajectories share."""
    numbers = np.ascontiguousarray(trajectory, dtype="<f8")
    return "track " + sha256(repr(numbers.shape).encode() + numbers.tobytes()).hexdigest()[:16]


@dataclass(frozen=True, eq=False, repr=False)
class Dataset:
    """Labelled trajectories: Omega of Algorithm 1.

    trajectories: (cases, channels, time points), metres, metres per second and radians.
    labels: (cases,) class names.
    groups: (cases,) group names; cross-validation never splits a group between training and test. Default:
        each case is its own group.
    source: origin of the data, for reports.
    notes: warnings for the user, e.g. that the data leak their label.
    interval: seconds between two time points.
    channels: (channels,) names from `CHANNELS`; x and y are in the robot's frame.
    """

    trajectories: Array
    labels: tuple[str, ...]
    groups: tuple[str, ...] = ()
    source: str = ""
    notes: tuple[str, ...] = ()
    interval: float = 0.033
    channels: tuple[str, ...] = ("x", "y")

    def __post_init__(self) -> None:
        object.__setattr__(self, "trajectories", freeze(self.trajectories))
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
            raise DataError(f"unknown channel {unknown[0]!r}; {expected_one_of(CHANNELS)}")
        if len(set(self.channels)) < len(self.channels):
            raise DataError(f"the channels are {', '.join(self.channels)}; expected every name once")
        if self.trajectories.shape[1] != len(self.channels):
            raise DataError(
                f"{len(self.channels)} channels ({', '.join(self.channels)}) need trajectories of shape"
                f" ({n}, {len(self.channels)}, time points), not {self.trajectories.shape}"
            )

    def __len__(self) -> int:
        return len(self.labels)

    def __repr__(self) -> str:
        counts = [f"{label}: {count}" for label, count in Counter(self.labels).items()]
        source = f", source={self.source!r}" if self.source else ""
        return (
            f"Dataset({len(self)} trajectories ({join_some(counts)}), {self.trajectories.shape[2]} points of"
            f" {', '.join(self.channels)} every {self.interval:g} s, {len(set(self.groups))} groups{source})"
        )

    def append(self, pairs: Sequence[tuple[npt.ArrayLike, str]], groups: Sequence[str]) -> Dataset:
        """Return the data set with more (trajectory, label) pairs at its end.

        Args:
            pairs: trajectories (channels, time points) of the same shape, each with its label.
            groups: the group of each pair; cases of one person share a group.

        Raises:
            DataError: a trajectory has another shape.
        """
        tracks, shape = (
            [np.asarray(track, dtype=np.float64) for track, _ in pairs],
            self.trajectories.shape[1:],
        )
        for track in tracks:
            if track.shape != shape:
                raise DataError(
                    f"a trajectory of shape {track.shape} does not fit a data set of trajectories of shape"
                    f" {shape}"
                )
        return replace(
            self,
            trajectories=np.concatenate([self.trajectories, np.reshape(tracks, (-1, *shape))]),
            labels=(*self.labels, *(label for _, label in pairs)),
            groups=(*self.groups, *groups),
        )

    def take(self, rows: npt.ArrayLike) -> Dataset:
        """Return the data set of the given rows, in their order. rows: (k,) indices."""
        index = np.asarray(rows, dtype=np.intp)
        return replace(
            self,
            trajectories=self.trajectories[index],
            labels=tuple(self.labels[i] for i in index),
            groups=tuple(self.groups[i] for i in index),
        )
