"""The schema of a store: what all its tracks have in common."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from lcorpp.errors import DataError, expected_one_of
from lcorpp.values import CHANNELS, Dataset

MAX_POINTS = 2**20
"""Maximum number of time points of a track."""


@dataclass(frozen=True)
class TrackSchema:
    """Channels, interval, classes and length of all tracks in a store.

    channels: names of the rows of a trajectory, from `values.CHANNELS` (m, m/s, rad).
    interval: seconds between two time points.
    classes: the possible labels, i.e. the values of the robot's target, in their order.
    points: time points per track; None if the length varies.

    Raises:
        DataError: a name is empty, repeated or unknown, or a number is out of range.
    """

    channels: tuple[str, ...]
    interval: float
    classes: tuple[str, ...]
    points: int | None = None

    def __post_init__(self) -> None:
        for what, names in (("channels", self.channels), ("classes", self.classes)):
            object.__setattr__(self, what, _check_names(what, names))
        for name in self.channels:
            if name not in CHANNELS:
                raise DataError(f"unknown channel {name!r}; {expected_one_of(CHANNELS)}")
        if not isinstance(self.interval, int | float) or not 0 < self.interval < math.inf:
            raise DataError(f"the interval is {self.interval!r} s; expected a finite number above 0")
        object.__setattr__(self, "interval", float(self.interval))
        if self.points is not None and not (isinstance(self.points, int) and 2 <= self.points <= MAX_POINTS):
            raise DataError(f"tracks of {self.points!r} time points; expected 2 to {MAX_POINTS}, or None")

    @classmethod
    def from_dataset(cls, dataset: Dataset, classes: Sequence[str]) -> TrackSchema:
        """Return the schema of the tracks in `dataset`, labelled with `classes`."""
        return cls(dataset.channels, dataset.interval, tuple(classes), dataset.trajectories.shape[2])

    def check_equal(self, other: TrackSchema, where: str) -> None:
        """Check that tracks of the schema `other` fit a store of this schema.

        Args:
            where: the name of the store, for the message.

        Raises:
            DataError: the schemas differ; the message names the first difference.
        """
        for what, here, there in (
            ("channels", ", ".join(self.channels), ", ".join(other.channels)),
            ("interval", f"{self.interval:g} s", f"{other.interval:g} s"),
            ("classes", ", ".join(self.classes), ", ".join(other.classes)),
            ("time points of a track", self.points or "any number", other.points or "any number"),
        ):
            if here != there:
                raise DataError(f"{where}: its {what}: {here}; the tracks to be stored have: {there}")


def _check_names(what: str, names: Sequence[str]) -> tuple[str, ...]:
    if isinstance(names, str) or not isinstance(names, Sequence) or not names:
        raise DataError(f"the {what} of a store are a sequence of names, not {names!r}")
    for name in names:
        if not isinstance(name, str) or not name:
            raise DataError(f"{name!r} is no name for one of the {what}; expected text")
    if len(set(names)) < len(names):
        raise DataError(f"the {what} are {', '.join(names)}; expected every name once")
    return tuple(names)
