"""How far to trust a classifier that has seen only the beginning of a track.

A classifier that learnt from whole tracks does not know that it is early: after a second it is as sure of
what it cannot know yet as at the end, and leans to either class. Calibrated for each number of points, by
what it said of other people's tracks at that number, it says little at first and more as it sees more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from lcorpp.errors import DataError
from lcorpp.learning.evaluation.calibration import Calibration, calibrate
from lcorpp.learning.streaming.prefix_predictions import OverTime


@dataclass(frozen=True, eq=False)
class Early:
    """A calibration for each number of points seen.

    least: points of the shortest tracks with an answer.
    calibrations: for tracks of `least` points, of one more, and so on; longer tracks take the last.
    """

    least: int
    calibrations: tuple[Calibration, ...]

    def __post_init__(self) -> None:
        if not self.calibrations:
            raise DataError("there is no answer to calibrate: the tracks are too short")

    def at(self, points: int) -> Calibration:
        """The calibration of answers about tracks of `points` points.

        Raises:
            DataError: there are no answers as early as that.
        """
        if points < self.least:
            raise DataError(f"nothing is known after {points} points; {self.least} are needed")
        return self.calibrations[min(points - self.least, len(self.calibrations) - 1)]

    def calibrated(self, said: OverTime) -> OverTime:
        """What was said of tracks while they lasted, put right for each time."""
        right = np.array(said.probabilities)
        for column, points in enumerate(said.points):
            if np.isfinite(right[:, column]).all():
                right[:, column] = self.at(points).calibrated(right[:, column])
        return replace(said, probabilities=right)

    def to_json(self) -> dict[str, Any]:
        """The numbers as plain values."""
        return {"least": self.least, "calibrations": [each.to_json() for each in self.calibrations]}

    @classmethod
    def from_json(cls, numbers: Mapping[str, Any]) -> Self:
        """What `to_json` gave.

        Raises:
            DataError: the numbers do not belong together.
        """
        return cls(int(numbers["least"]), tuple(map(Calibration.from_json, numbers["calibrations"])))


def calibrate_over_time(said: OverTime) -> Early:
    """A calibration for each number of points, fitted to what a classifier said of tracks new to it.

    Args:
        said: of `out_of_fold_over_time`.

    Raises:
        DataError: nothing was said at all.
    """
    columns = [
        column
        for column, points in enumerate(said.points)
        if np.isfinite(said.probabilities[:, column]).all()
        and (not column or points > said.points[column - 1])
    ]
    calibrations = [calibrate(said.classes, said.probabilities[:, column], said.labels) for column in columns]
    return Early(said.points[columns[0]] if columns else 0, tuple(calibrations))
