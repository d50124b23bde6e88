"""Tracker of people on the floor: a constant-velocity Kalman filter for each, with global assignment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import isfinite

import numpy as np
import numpy.typing as npt

from lcorpp.arguments import check_arguments, check_fields, to_numbers
from lcorpp.errors import DataError
from lcorpp.values import Array

Sample = tuple[float, int, float, float]
"""Time in seconds, id of the track, x and y in metres."""

START_SPEED = 1.0
"""Standard deviation of the velocity of a new track in m/s, of each component: people walk at about 1.3."""

MAX_POSITION = 1e6
"""Maximum size of a coordinate in metres; squares of larger numbers lose precision."""

CLOCK_TOLERANCE = 1e-6
"""Seconds that a gap may be longer than its limit: rounding of the clock."""

NOT_ASSIGNED = 1e6
"""Cost of a pair outside of the gate; larger than the sum of all costs inside."""


@dataclass(frozen=True)
class TrackerOptions:
    """Constants of the motion model and the rules for birth and death of tracks.

    noise: standard deviation of a measured position, m, of each coordinate, where `Tracker.update` gets no
        covariances.
    acceleration: standard deviation of the white-noise acceleration, m/s^2 for one second.
    gate: maximum squared Mahalanobis distance of a measurement; 13.8 keeps 99.9 % of a track's own.
    min_hits: measurements before a track is confirmed.
    max_tentative_gap: seconds without a measurement that end a track that is not confirmed.
    max_gap: seconds without a measurement that end a confirmed track.

    Raises:
        DataError: a constant is not positive.

    Examples:
        >>> from lcorpp.camera import Tracker, TrackerOptions
        >>> tracker = Tracker(TrackerOptions(min_hits=2))
        >>> tracker.update(0.0, [[1.0, 2.0]])
        []
        >>> [id for time, id, x, y in tracker.update(0.1, [[1.1, 2.0]])]  # of both samples
        [1, 1]
    """

    noise: float = 0.1
    acceleration: float = 2.0
    gate: float = 13.8
    min_hits: int = 3
    max_tentative_gap: float = 0.3
    max_gap: float = 1.5

    def __post_init__(self) -> None:
        check_fields(self)
        for name, value in vars(self).items():
            if not (isfinite(value) and value > 0):
                raise DataError(f"tracker: {name} is {value:g}; expected a number above 0")


@dataclass(eq=False, slots=True)
class _Track:
    """A person's filter.

    mean: (4,) x, y, vx, vy. covariance: (4, 4). last: the sample of its last measurement, without the id.
    id: 0 until it is confirmed. samples: those not yet returned. missed: times of the updates since `last`.
    """

    mean: Array
    covariance: Array
    last: tuple[float, float, float]
    id: int = 0
    hits: int = 1
    samples: list[tuple[float, float, float]] = field(default_factory=list)
    missed: list[float] = field(default_factory=list)


class Tracker:
    """Track people by their positions on the floor.

    A measurement belongs to at most one track and a track has at most one measurement, so that the sum of
    the negative log-likelihoods is least (Hungarian algorithm); confirmed tracks are assigned first. What no
    track takes begins a new one, which is confirmed, and gets its id, after `min_hits` measurements.

    Source: Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
    section 6.2 (discretised white-noise acceleration); Blackman and Popoli, Design and Analysis of Modern
    Tracking Systems, 1999, chapter 6 (global nearest neighbour).

    Examples:
        >>> from lcorpp.camera import Tracker
        >>> tracker = Tracker()
        >>> for n in range(11):  # two people walk towards each other at 1 m/s, seen 10 times a second
        ...     samples = tracker.update(n / 10, [[n / 10, 0.0], [5 - n / 10, 1.0]])
        >>> {id: [round(number, 1) for number in state] for id, state in tracker.people.items()}
        {1: [1.0, 0.0, 1.0, 0.0], 2: [4.0, 1.0, -1.0, 0.0]}
    """

    @check_arguments
    def __init__(self, options: TrackerOptions | None = None) -> None:
        self.options = options or TrackerOptions()
        self._tracks: list[_Track] = []
        self._time: float | None = None
        self._last_id = 0

    def __repr__(self) -> str:
        confirmed = sum(track.id > 0 for track in self._tracks)
        return f"<Tracker: {confirmed} people at {self._time} s, {self._last_id} in all>"

    @property
    def people(self) -> dict[int, tuple[float, float, float, float]]:
        """Id -> x, y (m), vx, vy (m/s) of each confirmed track now; predicted where it is not seen."""
        return {track.id: _as_tuple(track.mean) for track in self._tracks if track.id}

    def update(
        self, time: float, positions: npt.ArrayLike, covariances: npt.ArrayLike | None = None
    ) -> list[Sample]:
        """Process the positions that were measured at one time.

        Args:
            time: seconds, above that of the last call.
            positions: (n, 2) metres; n may be 0.
            covariances: (n, 2, 2) of the positions, m^2; None takes `TrackerOptions.noise`.

        Returns:
            The new samples of all confirmed tracks, those of each track in the order of time. The earlier
            samples of a track come with the one that confirms it, and the interpolated ones of an interval
            in which it was not seen with the next measurement.

        Raises:
            DataError: the time does not rise, or an array has another shape or numbers that are not finite.
        """
        measured, noise = self._check(time, positions, covariances)
        if self._time is not None:
            _predict(self._tracks, time - self._time, self.options.acceleration)
        self._time = time
        free = np.arange(len(measured))
        for is_confirmed in (True, False):
            tracks = [track for track in self._tracks if (track.id > 0) == is_confirmed]
            rows, columns = _assign(tracks, measured[free], noise[free], self.options.gate)
            for row, index in zip(rows.tolist(), free[columns].tolist(), strict=True):
                self._correct(tracks[row], time, measured[index], noise[index])
            free = np.delete(free, columns)
        self._end_tracks(time)
        for index in free.tolist():
            self._begin(time, measured[index], noise[index])
        return self._take_samples()

    def _check(
        self, time: float, positions: npt.ArrayLike, covariances: npt.ArrayLike | None
    ) -> tuple[Array, Array]:
        """Return (n, 2) positions and (n, 2, 2) covariances."""
        if not isfinite(time) or (self._time is not None and time <= self._time):
            last = "" if self._time is None else f" above {self._time:.15g}, the last one"
            raise DataError(f"tracker: time {time:.15g} s; expected a finite number{last}")
        measured = to_numbers(positions, "tracker: positions")
        measured = measured.reshape(0, 2) if measured.size == 0 else measured
        if measured.ndim != 2 or measured.shape[1] != 2:
            raise DataError(f"tracker: positions of shape {measured.shape}; expected (n, 2)")
        if not (np.abs(measured) <= MAX_POSITION).all():
            raise DataError(
                f"tracker: a position at {time:.15g} s is not finite, or above {MAX_POSITION:g} m"
            )
        if covariances is None:
            return measured, np.tile(self.options.noise**2 * np.eye(2), (len(measured), 1, 1))
        noise = to_numbers(covariances, "tracker: covariances").reshape(-1, 2, 2)
        if len(noise) != len(measured):
            raise DataError(f"tracker: {len(noise)} covariances for {len(measured)} positions")
        if not np.isfinite(noise).all() or (np.linalg.eigvalsh(noise) <= 0).any():
            raise DataError(f"tracker: a covariance at {time:.15g} s is not finite and positive definite")
        return measured, noise

    def _begin(self, time: float, position: Array, noise: Array) -> None:
        covariance = np.zeros((4, 4))
        covariance[:2, :2], covariance[2:, 2:] = noise, START_SPEED**2 * np.eye(2)
        x, y = position.tolist()
        track = _Track(np.array([x, y, 0.0, 0.0]), covariance, (time, x, y), samples=[(time, x, y)])
        self._tracks.append(track)
        self._confirm(track)

    def _correct(self, track: _Track, time: float, position: Array, noise: Array) -> None:
        """Update a track with its measurement, and record the samples since the last one."""
        gain = np.linalg.solve(track.covariance[:2, :2] + noise, track.covariance[:2]).T
        track.mean = track.mean + gain @ (position - track.mean[:2])
        covariance = track.covariance - gain @ track.covariance[:2]
        track.covariance = (covariance + covariance.T) / 2
        then, now = track.last, (time, float(track.mean[0]), float(track.mean[1]))
        for at in track.missed:
            share = (at - then[0]) / (time - then[0])
            x, y = then[1] + share * (now[1] - then[1]), then[2] + share * (now[2] - then[2])
            track.samples.append((at, x, y))
        track.samples.append(now)
        track.last, track.missed, track.hits = now, [], track.hits + 1
        self._confirm(track)

    def _confirm(self, track: _Track) -> None:
        if not track.id and track.hits >= self.options.min_hits:
            self._last_id += 1
            track.id = self._last_id

    def _end_tracks(self, time: float) -> None:
        """Remove the tracks that have had no measurement for too long; note the others' missed updates."""
        limits = (self.options.max_tentative_gap, self.options.max_gap)
        self._tracks = [t for t in self._tracks if time - t.last[0] <= limits[t.id > 0] + CLOCK_TOLERANCE]
        for track in self._tracks:
            if track.last[0] < time:
                track.missed.append(time)

    def _take_samples(self) -> list[Sample]:
        taken: list[Sample] = []
        for track in self._tracks:
            if track.id:
                taken += [(at, track.id, x, y) for at, x, y in track.samples]
                track.samples = []
        return taken


def _predict(tracks: Sequence[_Track], seconds: float, acceleration: float) -> None:
    """Move the filters by some seconds."""
    step = np.kron([[1.0, seconds], [0.0, 1.0]], np.eye(2))
    noise = np.kron([[seconds**4 / 4, seconds**3 / 2], [seconds**3 / 2, seconds**2]], np.eye(2))
    for track in tracks:
        track.mean = step @ track.mean
        track.covariance = step @ track.covariance @ step.T + acceleration**2 * noise


def _assign(
    tracks: Sequence[_Track], measured: Array, noise: Array, gate: float
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Return the indices of tracks and those of their measurements, (n, 2) with (n, 2, 2) covariances."""
    if not tracks or not len(measured):
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    from scipy.optimize import linear_sum_assignment  # loads in a third of a second, for trackers alone

    means = np.stack([track.mean[:2] for track in tracks])
    covariances = np.stack([track.covariance[:2, :2] for track in tracks])[:, None] + noise
    offsets = measured - means[:, None]
    distances = np.einsum("tmi,tmij,tmj->tm", offsets, np.linalg.inv(covariances), offsets)
    costs = np.where(distances <= gate, distances + np.log(np.linalg.det(covariances)), NOT_ASSIGNED)
    rows, columns = linear_sum_assignment(costs)
    kept = distances[rows, columns] <= gate
    return rows[kept], columns[kept]


def _as_tuple(mean: Array) -> tuple[float, float, float, float]:
    x, y, vx, vy = mean.tolist()
    return x, y, vx, vy
