"""Resample one person's samples to a fixed rate as they arrive: order, check, interpolate.

`StreamRules` are the options, `TrackResampler` applies them to one person, `RepairCounts` counts its repairs.
"""

from __future__ import annotations

from bisect import insort
from dataclasses import dataclass, fields
from math import hypot, isfinite

from lcorpp.errors import DataError
from lcorpp.learning.data.tracks import JUMP_TOLERANCE, MAX_NUMBER
from lcorpp.learning.features.resampling import SAME_TIME
from lcorpp.values import wrap_angle

Sample = tuple[float, ...]
"""The measurements at one time, in the order of the inputs."""


@dataclass(frozen=True)
class StreamRules:
    """Rules for late, missing and impossible samples; `StreamingClassifier` describes the options.

    rate: points per second. max_speed: metres per second. All others are seconds.
    """

    rate: float
    allowed_lateness: float
    max_gap: float
    max_duration: float
    max_speed: float
    max_silence: float

    def __post_init__(self) -> None:
        for name in ("max_gap", "max_duration", "max_speed", "max_silence"):
            if not getattr(self, name) > 0:
                raise DataError(f"{name} must be above 0, not {getattr(self, name)}")
        if not isfinite(self.max_gap):
            raise DataError(f"max_gap must be finite, not {self.max_gap}")
        if not 0 <= self.allowed_lateness <= self.max_gap:
            raise DataError(
                f"allowed_lateness must be at least 0 and at most max_gap, {self.max_gap:g} s,"
                f" not {self.allowed_lateness}"
            )
        if self.max_silence < self.max_gap:
            raise DataError(
                f"max_silence must be at least max_gap, {self.max_gap:g} s, not {self.max_silence}:"
                " until then a track may continue"
            )
        if self.max_duration * self.rate < 2:
            raise DataError(
                f"max_duration must be at least two points, {2 / self.rate:g} s, not {self.max_duration}"
            )


@dataclass
class RepairCounts:
    """Counts of the samples, and of the repairs, of one person or of many.

    samples: samples that arrived.
    rejected: samples that are not finite or beyond `MAX_NUMBER`; first_rejected describes the first one.
    duplicates: samples dropped because of an equal time stamp; the first sample is kept.
    late: samples dropped because a later sample was already used.
    interpolated_gaps: gaps longer than the time between two points, interpolated linearly.
    long_gaps, jumps, clock_resets, overlong_tracks: tracks that ended because of a gap longer than `max_gap`,
        a speed above `max_speed`, a clock that went back by more than `max_gap`, or a duration above
        `max_duration`; a new track follows each.
    """

    samples: int = 0
    rejected: int = 0
    first_rejected: str = ""
    duplicates: int = 0
    late: int = 0
    interpolated_gaps: int = 0
    long_gaps: int = 0
    jumps: int = 0
    clock_resets: int = 0
    overlong_tracks: int = 0

    def add(self, other: RepairCounts) -> None:
        """Add the counts of `other`."""
        for field in fields(self):
            if field.name != "first_rejected":
                setattr(self, field.name, getattr(self, field.name) + getattr(other, field.name))
        self.first_rejected = self.first_rejected or other.first_rejected

    def __str__(self) -> str:
        words = [f"{self.samples} samples"]
        if self.rejected:
            words.append(f"rejected: {self.rejected} (the first: {self.first_rejected})")
        words += [
            f"{text}: {getattr(self, name)}" for name, text in REPAIR_TEXTS.items() if getattr(self, name)
        ]
        return "; ".join(words)


REPAIR_TEXTS = {
    "duplicates": "duplicates dropped",
    "late": "late samples dropped",
    "interpolated_gaps": "gaps interpolated",
    "long_gaps": "new tracks after long gaps",
    "jumps": "new tracks after jumps",
    "clock_resets": "new tracks after clock resets",
    "overlong_tracks": "new tracks after the maximal duration",
}
"""Count -> text in a report."""


class TrackResampler:
    """Resample one person's samples, in any order of arrival, to a fixed rate from the first sample.

    A sample is used once a sample arrives that is `allowed_lateness` seconds younger, or at once if
    `allowed_lateness` is 0. Samples are used in the order of their stamps; a sample older than the last used
    one is dropped. The points equal `resample` of the samples used.

    Args:
        inputs: the names of the values of a sample. angles: indices of the inputs that are angles.

    Attributes:
        track_count: number of tracks so far, including the current one.
        lone_samples: number of samples in a row that long gaps made tracks of their own.
        repairs: counts of the repairs.
    """

    def __init__(self, rules: StreamRules, inputs: tuple[str, ...], angles: tuple[int, ...]) -> None:
        self._rules, self._inputs, self._angles = rules, inputs, frozenset(angles)
        self._xy = (inputs.index("x"), inputs.index("y")) if {"x", "y"} <= set(inputs) else None
        self._waiting: list[tuple[float, Sample]] = []  # samples within `allowed_lateness`, by time
        self._latest = 0.0  # the latest stamp that arrived
        self._begin = 0.0  # stamp of the first sample of the track
        self._last: Sample | None = None  # the last sample used; None before the first track
        self._elapsed = 0.0  # seconds from the first sample of the track to the last one used
        self._next = 0  # index of the next point, due at _next / rate seconds
        self._points: list[Sample] = []  # points since the last `take_points`
        self._is_new = False  # whether these points begin a new track
        self.track_count = self.lone_samples = 0
        self.repairs = RepairCounts()

    @property
    def time(self) -> float | None:
        """Stamp of the last point in seconds; None before the first point."""
        return self._begin + (self._next - 1) / self._rules.rate if self._last is not None else None

    @property
    def point_count(self) -> int:
        """Number of points of the current track."""
        return self._next if self._last is not None else 0

    def add(self, time: float, sample: Sample) -> None:
        """Add a sample; `take_points` returns the points that it completes."""
        repairs = self.repairs
        repairs.samples += 1
        if not self._accept(time, sample):
            return
        if self._last is None and not self._waiting:  # the first sample
            self._latest = time
        elif time < self._latest - self._rules.max_gap:
            repairs.clock_resets += 1
            self.flush()
            self._last, self._latest = None, time
        self._latest = max(self._latest, time)
        ready = self._latest - self._rules.allowed_lateness
        if self._last is not None and time - self._begin <= self._elapsed:
            if time - self._begin == self._elapsed:
                repairs.duplicates += 1
            else:
                repairs.late += 1
        elif not self._waiting and time <= ready:
            self._use(time, sample)
        elif any(time == other for other, _ in self._waiting):
            repairs.duplicates += 1
        else:
            insort(self._waiting, (time, sample))
            while self._waiting and self._waiting[0][0] <= ready:
                self._use(*self._waiting.pop(0))

    def flush(self) -> None:
        """Use the waiting samples at once."""
        for time, sample in self._waiting:
            self._use(time, sample)
        self._waiting.clear()

    def take_points(self) -> tuple[list[Sample], bool]:
        """Return the points completed since the last call, and whether they begin a new track."""
        taken = self._points, self._is_new
        self._points, self._is_new = [], False
        return taken

    def _accept(self, time: float, sample: Sample) -> bool:
        """Return whether a sample is finite and within `MAX_NUMBER`; count it as rejected if not."""
        bad = next((i for i, value in enumerate(sample) if not abs(value) <= MAX_NUMBER), None)
        if not isfinite(time):
            fault = f"its time is {time}"
        elif bad is not None:
            fault = f"{self._inputs[bad]} is {sample[bad]} at {time:.3f} s"
        else:
            return True
        self.repairs.first_rejected = self.repairs.first_rejected or fault
        self.repairs.rejected += 1
        return False

    def _use(self, time: float, sample: Sample) -> None:
        """Extend the track to the next sample, or start a new track with it."""
        last, rate = self._last, self._rules.rate
        elapsed = time - self._begin
        if last is None or self._is_broken(last, sample, elapsed):
            self.track_count += 1
            self._begin, self._elapsed, self._last, self._next = time, 0.0, sample, 1
            self._points, self._is_new = [sample], True  # drops the points of the previous track
            return
        self.lone_samples = 0
        gap = elapsed - self._elapsed
        if gap > 1 / rate + SAME_TIME:
            self.repairs.interpolated_gaps += 1
        due = self._next / rate
        while elapsed >= due - SAME_TIME:
            weight = 1.0 if elapsed <= due else (due - self._elapsed) / gap
            self._points.append(self._interpolate(last, sample, weight))
            self._next += 1
            due = self._next / rate
        self._last, self._elapsed = sample, elapsed

    def _is_broken(self, last: Sample, sample: Sample, elapsed: float) -> bool:
        """Return whether the track ends before a sample `elapsed` seconds after its start, and count why."""
        rules, repairs, gap = self._rules, self.repairs, elapsed - self._elapsed
        x, y = self._xy or (0, 0)
        distance = hypot(sample[x] - last[x], sample[y] - last[y]) if self._xy else 0.0
        if gap > rules.max_gap:
            repairs.long_gaps += 1
            self.lone_samples += 1
        elif distance > rules.max_speed * (gap + JUMP_TOLERANCE):
            repairs.jumps += 1
        elif elapsed > rules.max_duration:
            repairs.overlong_tracks += 1
        else:
            return False
        return True

    def _interpolate(self, start: Sample, end: Sample, weight: float) -> Sample:
        """Interpolate one point as `resampling.interpolate` does. weight: of `end`, 0 to 1."""
        rest = 1 - weight
        return tuple(
            a + wrap_angle(b - a) * weight if channel in self._angles else a * rest + b * weight
            for channel, (a, b) in enumerate(zip(start, end, strict=True))
        )
