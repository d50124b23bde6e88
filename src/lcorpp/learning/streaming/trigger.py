"""A trigger decides on a person's class as soon as enough of the track is seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments, check_fields
from lcorpp.errors import DataError
from lcorpp.learning.evaluation.calibration import report_damage
from lcorpp.learning.streaming.timeline import PredictionTimeline, PrefixCalibration
from lcorpp.values import Array, Flags, Indices, freeze


@dataclass(frozen=True)
class EarlyDecision:
    """A decision on the class of a person before the end of the track, or at it.

    label: the class. probability: its calibrated probability then. points: number of points seen.
    """

    label: str
    probability: float
    points: int


@dataclass(frozen=True)
class AcceptedRun:
    """The last consecutive predictions that a trigger accepted, of one track or of (cases,).

    column: their class, -1 if the last prediction was not accepted. length: their number.
    """

    column: Indices | int = -1
    length: Indices | int = 0

    def extend(self, column: Indices | int, probability: Array | float, floors: Array) -> AcceptedRun:
        """Return the run after another prediction, which is accepted if its probability reaches its floor.

        Args:
            column: the most probable class. probability: of that class; NaN without a prediction.
            floors: (K,) for the classes; a floor of 1 is never reached.
        """
        floor = floors[column]
        is_accepted = (probability >= floor) & (floor < 1)
        length = np.where(is_accepted, np.where(column == self.column, self.length + 1, 1), 0)
        return AcceptedRun(np.where(is_accepted, column, -1), length)

    def decides(self, points: int, consecutive: int, last_points: float) -> Flags:
        """Whether the run is long enough, or the track has the last number of points."""
        return np.asarray((self.length >= consecutive) | (points >= last_points))


@dataclass(frozen=True)
class TriggerState:
    """The state of a trigger for a track. decision: the first one, which is final."""

    run: AcceptedRun = AcceptedRun()
    decision: EarlyDecision | None = None


@dataclass(frozen=True)
class EarlyScore:
    """Accuracy and earliness of decisions on some tracks.

    accuracy: fraction of correct decisions. seconds: mean age of a track at its decision.
    earliness: mean fraction of a track that was not needed: 1 at once, 0 at the end.

    Examples:
        >>> from lcorpp.learning import EarlyScore
        >>> early, late = EarlyScore(0.8, 2.0, earliness=0.8), EarlyScore(0.9, 9.0, earliness=0.1)
        >>> round(early.harmonic_mean, 3), round(late.harmonic_mean, 3)
        (0.8, 0.18)
        >>> round(early.value(0.01), 3), round(late.value(0.01), 3)  # if a second costs 0.01
        (0.78, 0.81)
    """

    accuracy: float
    seconds: float
    earliness: float

    def __str__(self) -> str:
        return f"accuracy {self.accuracy:.3f} after {self.seconds:.2f} s, earliness {self.earliness:.3f}"

    @property
    def harmonic_mean(self) -> float:
        """The harmonic mean of accuracy and earliness; 0 if both are 0."""
        total = self.accuracy + self.earliness
        return 2 * self.accuracy * self.earliness / total if total else 0.0

    @check_arguments
    def value(self, waiting_cost: float | None) -> float:
        """The goal of a choice: accuracy minus the cost of the seconds; the harmonic mean without a cost."""
        return self.harmonic_mean if waiting_cost is None else self.accuracy - waiting_cost * self.seconds


@dataclass(frozen=True, eq=False)
class Trigger:
    """Decide when the most probable class was the same, and probable enough, in consecutive predictions.

    A sample that gives several points, as after a gap, gives one prediction.

    After `last_points` points it decides in any case, and so does `decide` at the end of a recorded track. A
    floor of 1 is never reached, so that it decides at the end.

    calibration: of the probabilities, for each number of points.
    floors: (numbers of points, K) a prediction is accepted if the calibrated probability of its class is at
        least this, from `calibration.min_points` points on; longer tracks use the last row.
    consecutive: number of consecutive accepted predictions of one class that decide.
    last_points: number of points after which waiting ends.
    expected: its score on unseen people, if it was fitted.

    Examples:
        >>> import numpy as np
        >>> from lcorpp.learning import PredictionTimeline, fit_trigger
        >>> yes = np.array([[0.5, 0.5], [0.1, 0.9], [0.1, 0.9], [0.1, 0.9]])  # P(no), P(yes) at each point
        >>> timeline = PredictionTimeline(
        ...     10 * [yes, 1 - yes], (1, 2, 3, 4), 10 * ["yes", "no"], ("no", "yes"), 0.5, 5 * [0, 0, 1, 1]
        ... )
        >>> decision = fit_trigger(timeline).decide(timeline)[0]
        >>> decision.label, decision.points
        ('yes', 2)
    """

    calibration: PrefixCalibration
    floors: Array
    consecutive: int
    last_points: int
    expected: EarlyScore | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        object.__setattr__(self, "floors", freeze(self.floors))
        if self.floors.ndim != 2 or self.floors.shape[1] != len(self.classes) or not len(self.floors):
            raise DataError(
                f"the floors of a trigger have shape {self.floors.shape}; expected one row for each number of"
                f" points and {len(self.classes)} columns"
            )
        if np.isnan(self.floors).any() or self.consecutive < 1 or self.last_points < 1:
            raise DataError("a trigger needs floors that are numbers, and at least one point")

    def __repr__(self) -> str:
        score = "" if self.expected is None else f"; expected {self.expected}"
        low, high = self.floors.min(), self.floors.max()
        floors = f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
        return f"<Trigger: probability {floors} in {self.consecutive} consecutive predictions{score}>"

    @property
    def classes(self) -> tuple[str, ...]:
        """(K,) the class names."""
        return self.calibration.calibrations[0].classes

    def advance(self, state: TriggerState, points: int, probabilities: Array) -> TriggerState:
        """Return the state after another prediction for a track.

        Args:
            points: number of points so far. probabilities: (K,) the uncalibrated prediction for them.
        """
        row = points - self.calibration.min_points
        if state.decision is not None or row < 0:
            return state
        calibrated = self.calibration.at(points).calibrate(probabilities[None])[0]
        column, probability = int(calibrated.argmax()), float(calibrated.max())
        run = state.run.extend(column, probability, self.floors[min(row, len(self.floors) - 1)])
        if run.decides(points, self.consecutive, self.last_points):
            return TriggerState(run, EarlyDecision(self.classes[column], probability, points))
        return TriggerState(run)

    @check_arguments
    def decide(self, timeline: PredictionTimeline) -> tuple[EarlyDecision | None, ...]:
        """Return the decision on each recorded track, at its end at the latest; None without a prediction.

        Args:
            timeline: uncalibrated predictions for people that the trigger was not fitted to.

        Raises:
            DataError: the timeline is of other classes.
        """
        if timeline.classes != self.classes:
            raise DataError(f"the trigger is for {self.classes}, the timeline for {timeline.classes}")
        ages = Ages.of(self.calibration.calibrate(timeline))
        rows = (ages.points - self.calibration.min_points).clip(0, len(self.floors) - 1)
        fired = ages.find_first(self.floors[rows], self.consecutive, self.last_points)
        cases = np.arange(len(fired))
        columns = ages.columns[cases, fired]
        return tuple(
            EarlyDecision(self.classes[column], float(ages.probability[case, age]), int(ages.points[age]))
            if ages.known[case, age]
            else None
            for case, (age, column) in enumerate(zip(fired, columns, strict=True))
        )

    def to_json(self) -> dict[str, Any]:
        """Return the parameters as plain values, without the expected score."""
        return {
            "calibration": self.calibration.to_json(),
            "floors": self.floors.tolist(),
            "consecutive": self.consecutive,
            "last_points": self.last_points,
        }

    @classmethod
    def from_json(cls, numbers: Mapping[str, Any]) -> Self:
        """Restore the trigger that `to_json` returned.

        Raises:
            DataError: the parameters do not match.
        """
        with report_damage("a trigger"):
            calibration = PrefixCalibration.from_json(numbers["calibration"])
            counts = int(numbers["consecutive"]), int(numbers["last_points"])
            return cls(calibration, np.array(numbers["floors"]), *counts)


@dataclass(frozen=True, eq=False)
class Ages:
    """The calibrated predictions of a timeline at the ages at which they change.

    points: (ages,) numbers of points. seconds: (ages,). known: (cases, ages) whether there is a prediction.
    columns: (cases, ages) the most probable class. probability: (cases, ages) of that class, NaN if unknown.
    """

    points: npt.NDArray[np.int64]
    seconds: Array
    known: Flags
    columns: Indices
    probability: Array

    @classmethod
    def of(cls, timeline: PredictionTimeline) -> Ages:
        """Select the ages of a calibrated timeline.

        Raises:
            DataError: it has no predictions.
        """
        times = list_ages(timeline)
        if not times:
            raise DataError("the timeline has no predictions: the tracks are too short")
        p = timeline.probabilities[:, times]
        known: Flags = np.asarray(np.isfinite(p).all(axis=2))
        points = np.array(timeline.points, dtype=np.int64)[times]
        return cls(points, timeline.seconds[times], known, p.argmax(axis=2), p.max(axis=2))

    @property
    def last(self) -> Indices:
        """(cases,) the last age with a prediction; 0 without one."""
        return np.asarray((self.known * np.arange(len(self.points))).max(axis=1))

    def find_first(self, floors: Array, consecutive: int, last_points: float = np.inf) -> Indices:
        """(cases,) the age at which each case is decided, see `Trigger`. floors: (ages, K)."""
        fired, run = self.last, AcceptedRun()
        is_open = np.ones(len(fired), dtype=bool)
        for age, points in enumerate(self.points.tolist()):
            run = run.extend(self.columns[:, age], self.probability[:, age], floors[age])
            decides = is_open & self.known[:, age] & run.decides(points, consecutive, last_points)
            fired[decides], is_open = age, is_open & ~decides
        return fired


def list_ages(timeline: PredictionTimeline) -> list[int]:
    """Return the time points at which predictions change: the first one of each number of points."""
    known: Flags = np.asarray(np.isfinite(timeline.probabilities).all(axis=2).any(axis=0))
    first: dict[int, int] = {}
    for time, points in enumerate(timeline.points):
        if known[time]:
            first.setdefault(points, time)
    return list(first.values())
